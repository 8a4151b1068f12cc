#include "coordinator/bake_target.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/archive/format.h"
#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/steady_clock.h"
#include "common/domain/direction_grid.h"
#include "common/round/settings_json.h"
#include "coordinator/work_folder.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using AxisSteps = std::array<int, kBakeAxes>;  ///< how often each axis is refined

// ---- What to bake next ----

/// What one step along an axis is expected to do. Factors are those of teapots, goblets and a bunny between
/// spatial tolerances of 0.3 and 0.09, 162 and 642 directions, a quarter of the rays and all, one lobe and
/// four; a round that takes longer than expected is stopped under a budget, and is lost.
struct AxisModel {
  ErrorCause cause;
  double gain;            ///< the cause's part after the step, of that before
  double seconds, bytes;  ///< factors
};
constexpr std::array<AxisModel, kBakeAxes> kModels = {{
    {ErrorCause::kSpatial, 0.68, 1.8, 2.0},
    {ErrorCause::kAngular, 0.65, 1.5, 1.9},
    {ErrorCause::kRays, 0.75, 1.4, 1.05},
    {ErrorCause::kLobes, 0.75, 1.4, 1.2},
    {ErrorCause::kBits, 0.5, 1.1, 1.3},
}};

/// An axis is refined while its cause is above this part of the largest, and of the tolerance: errors add up
/// by their squares, so that what is below changes the whole by an eighth at most.
constexpr double kNotable = 0.5;
constexpr double kNotableOfTolerance = 0.25;
/// What an axis may leave of its cause in any case, as a part of the tolerance: four equal ones make it up.
constexpr double kShareOfTolerance = 0.5;
constexpr int kMostSteps = 3;
/// Axes of at least this part of the best one's worth are refined in the same round, to save rounds.
constexpr double kLikeWorth = 0.5;
constexpr float kFinestDrop = 1.0f / 65536;
constexpr int kMostRays = 1 << 17;
constexpr int kCoarsestLevel = 2;
constexpr float kFinestSpatialTolerance = 0.02f, kSpatialStep = 1.5f;
/// A first bake's spatial tolerance, in units of the tolerance, and its limits.
constexpr float kFirstSpatial = 1.2f, kFinestFirst = 0.05f, kCoarsestFirst = 0.3f;

double Cause(const TargetRound& round, int axis) {
  return round.cause[static_cast<size_t>(kModels[axis].cause)];
}

/// One step finer; false: there is none.
bool Refine(int axis, BakeSettings* s) {
  const bool shared = s->method == GatherMethod::kShared;
  int& most_rays = shared ? s->max_rays : s->paper_rays;
  switch (static_cast<BakeAxis>(axis)) {
    case BakeAxis::kVertices:
      if (s->spatial_tolerance <= kFinestSpatialTolerance) return false;
      s->spatial_tolerance /= kSpatialStep;
      return true;
    case BakeAxis::kDirections:
      if (s->grid_level >= DirectionGrid::kMaxLevel) return false;
      ++s->grid_level;
      s->angular_tolerance /= 2;
      return true;
    case BakeAxis::kRays:
      if (most_rays >= kMostRays) return false;
      most_rays *= 2;
      if (shared) s->rays_per_kappa *= 2, s->min_rays = std::min(2 * s->min_rays, s->max_rays);
      return true;
    case BakeAxis::kLobes:
      if (!shared || s->slice_lobes >= kMaxSliceLobes) return false;
      s->slice_lobes = std::min(2 * s->slice_lobes, kMaxSliceLobes);
      return true;
    case BakeAxis::kBits:
      if (s->drop <= kFinestDrop) return false;
      s->drop /= 4;
      s->bits_tolerance /= 4;
      return true;
  }
  return false;
}

/// Factor that the steps along an axis are expected to take of a cost.
double Growth(double of_a_step, int steps) { return std::pow(of_a_step, steps); }

BakeSettings Refined(const TargetRound& round, const AxisSteps& steps) {
  BakeSettings settings = round.settings;
  for (int a = 0; a < kBakeAxes; ++a)
    for (int i = 0; i < steps[a]; ++i) Refine(a, &settings);
  return settings;
}

struct RoundCost {
  double seconds, bytes;
};

/// What a round by those steps is expected to cost.
RoundCost Expected(const TargetRound& round, const AxisSteps& steps) {
  RoundCost cost = {round.seconds, static_cast<double>(round.bytes)};
  for (int a = 0; a < kBakeAxes; ++a) {
    const AxisModel& model = kModels[a];
    cost.bytes *= Growth(model.bytes, steps[a]);
    cost.seconds *= Growth(model.seconds, steps[a]);
  }
  return cost;
}

/// Largest part of the error that is a layer's own.
double LargestCause(const TargetRound& round) {
  double largest = 0;
  for (int c = 0; c < kErrorCauses; ++c)
    if (static_cast<ErrorCause>(c) != ErrorCause::kBelow) largest = std::max(largest, round.cause[c]);
  return largest;
}

/// What no axis can mend: causes of axes that are fixed or at their end.
double Floor(const TargetRound& round, const BakeTarget& target) {
  double squares = 0;
  for (int a = 0; a < kBakeAxes; ++a) {
    BakeSettings scratch = round.settings;
    if (target.fixed[a] || !Refine(a, &scratch)) squares += Cause(round, a) * Cause(round, a);
  }
  return std::sqrt(squares);
}

/// Part of their causes that axes may leave if together they are to take out what the error is above the
/// tolerance; 0 if even without them it is above.
double PartToLeave(const TargetRound& best, const AxisSteps& steps, double tolerance) {
  double squares = 0;
  for (int a = 0; a < kBakeAxes; ++a)
    if (steps[a] > 0) squares += Cause(best, a) * Cause(best, a);
  const double excess = best.error * best.error - tolerance * tolerance;
  return squares > excess ? std::sqrt(1 - excess / squares) : 0;
}

/// Steps that are expected to bring the axis' cause nearest to this: one at least, as far as there are any.
int StepsTo(const TargetRound& best, int axis, double aim) {
  BakeSettings settings = best.settings;
  double left = Cause(best, axis);
  int steps = 0;
  while ((steps == 0 || left * std::sqrt(kModels[axis].gain) > aim) && steps < kMostSteps &&
         Refine(axis, &settings)) {
    left *= kModels[axis].gain;
    ++steps;
  }
  return steps;
}

/// Steps along the axes that can be refined and whose causes stand out: as many at once as the tolerance is
/// away, but none for what would be little beside the floor.
AxisSteps NotableSteps(const TargetRound& best, const BakeTarget& target) {
  const double tolerance = static_cast<double>(target.tolerance);
  const double least = std::max(kNotable * LargestCause(best), kNotableOfTolerance * tolerance);
  AxisSteps steps{};
  for (int a = 0; a < kBakeAxes; ++a)
    if (!target.fixed[a] && Cause(best, a) > least) steps[a] = StepsTo(best, a, INFINITY);
  if (tolerance <= 0) return steps;
  const double part = PartToLeave(best, steps, tolerance);
  const double enough = std::max(kShareOfTolerance * tolerance, kNotable * Floor(best, target));
  for (int a = 0; a < kBakeAxes; ++a)
    if (steps[a] > 0) steps[a] = StepsTo(best, a, std::max(part * Cause(best, a), enough));
  return steps;
}

/// Square of the error that a step takes out, for what it adds in time and bytes.
double Worth(const TargetRound& best, int axis) {
  const AxisModel& model = kModels[axis];
  const double cause = Cause(best, axis);
  return cause * cause * (1 - model.gain * model.gain) / (model.seconds * model.bytes - 1);
}

/// Axes that are refined, of most worth first.
std::vector<int> ByWorth(const TargetRound& best, const AxisSteps& steps) {
  std::vector<int> order;
  for (int a = 0; a < kBakeAxes; ++a)
    if (steps[a] > 0) order.push_back(a);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return Worth(best, a) > Worth(best, b); });
  return order;
}

bool ExpectedToReach(const TargetRound& best, const AxisSteps& steps, float tolerance) {
  double square = best.error * best.error;
  for (int a = 0; a < kBakeAxes; ++a) {
    const double cause = Cause(best, a), left = cause * Growth(kModels[a].gain, steps[a]);
    square -= cause * cause - left * left;
  }
  return square <= static_cast<double>(tolerance) * static_cast<double>(tolerance);
}

/// Steps are whole, so that some axes do more than their part. Takes back those, of least worth first,
/// without which the tolerance is expected to be reached.
AxisSteps Needed(const TargetRound& best, AxisSteps steps, float tolerance) {
  std::vector<int> order = ByWorth(best, steps);
  for (; !order.empty(); order.pop_back()) {
    AxisSteps without = steps;
    without[order.back()] = 0;
    if (ExpectedToReach(best, without, tolerance)) steps = without;
  }
  return steps;
}

/// Candidates for the next round, the one wanted most first: what the tolerance needs if it is in reach, as
/// cheaper axes would only cost more before a dear one without which it is not; axes of about the same worth,
/// by all steps wanted, then by one; then without the axis of least worth, and so on; then each notable axis
/// alone; last, as one step may be too few to show, by more.
std::vector<AxisSteps> Candidates(const TargetRound& best, AxisSteps steps, float tolerance) {
  const std::vector<int> order = ByWorth(best, steps);
  std::vector<AxisSteps> candidates;
  if (!order.empty() && ExpectedToReach(best, steps, tolerance))
    candidates.push_back(Needed(best, steps, tolerance));
  for (size_t n = order.size(); n > 0; --n) {
    if (Worth(best, order[n - 1]) >= kLikeWorth * Worth(best, order[0])) {
      candidates.push_back(steps);
      candidates.emplace_back();
      for (size_t i = 0; i < n; ++i) candidates.back()[order[i]] = 1;
    }
    steps[order[n - 1]] = 0;
  }
  for (int times = 1; times <= (tolerance > 0 ? kMostSteps : 1); ++times)
    for (const int axis : order) {
      candidates.emplace_back();
      candidates.back()[axis] = times;
    }
  return candidates;
}

bool Same(const BakeSettings& a, const BakeSettings& b) { return SettingsToJson(a) == SettingsToJson(b); }

bool Tried(std::span<const TargetRound> rounds, const BakeSettings& settings) {
  return std::any_of(rounds.begin(), rounds.end(),
                     [&](const TargetRound& round) { return Same(round.settings, settings); });
}

std::string Text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

/// "spatial 0.04, angular 0.03": causes from the largest on, those that stand out.
std::string DescribeCauses(const TargetRound& round) {
  std::vector<std::pair<double, int>> causes;
  for (int c = 0; c < kErrorCauses; ++c)
    if (round.cause[c] > kNotable * LargestCause(round)) causes.emplace_back(-round.cause[c], c);
  std::sort(causes.begin(), causes.end());
  std::string text;
  for (const auto& [part, cause] : causes)
    text += (text.empty() ? "" : ", ") + std::string(kErrorCauseNames[cause]) + " " + Text(-part);
  return text;
}

/// The last round that was kept, which is the best; null if there is none.
const TargetRound* BestOf(std::span<const TargetRound> rounds) {
  for (size_t i = rounds.size(); i > 0; --i)
    if (rounds[i - 1].kept) return &rounds[i - 1];
  return nullptr;
}

// ---- Rounds of earlier runs ----

fs::path RoundsPath(const fs::path& out_path) { return out_path.string() + ".rounds.json"; }
/// Where a round's archive is written before it is known to be better.
fs::path NextPath(const fs::path& out_path) { return out_path.string() + ".next"; }
fs::path ReportPath(const fs::path& archive) { return archive.string() + ".json"; }
constexpr uint64_t kMaxReportBytes = uint64_t{1} << 26;

Json ToJson(const TargetRound& round) {
  return {{"settings", SettingsToJson(round.settings)},
          {"error", round.error},
          {"cause", round.cause},
          {"seconds", round.seconds},
          {"bytes", round.bytes},
          {"archive_key", round.archive_key},
          {"kept", round.kept}};
}

std::optional<TargetRound> RoundFromJson(const Json& json) {
  TargetRound round;
  try {
    Result<BakeSettings> settings = SettingsFromJson(json.at("settings"));
    if (!settings.ok()) return std::nullopt;
    round.settings = *settings;
    json.at("error").get_to(round.error);
    json.at("cause").get_to(round.cause);
    json.at("seconds").get_to(round.seconds);
    json.at("bytes").get_to(round.bytes);
    json.at("archive_key").get_to(round.archive_key);
    json.at("kept").get_to(round.kept);
  } catch (const Json::exception&) {
    return std::nullopt;
  }
  return round;
}

std::string RoundsJson(const Digest& start_key, std::span<const TargetRound> rounds) {
  Json json = {{"key", start_key.Hex()}, {"rounds", Json::array()}};
  for (const TargetRound& round : rounds) json["rounds"].push_back(ToJson(round));
  return json.dump(1, '\t');
}

Json ReadJson(const fs::path& path) {
  const Result<std::vector<std::byte>> bytes = ReadFile(path, kMaxReportBytes);
  if (!bytes.ok()) return {};
  const auto* text = reinterpret_cast<const char*>(bytes->data());
  return Json::parse(text, text + bytes->size(), nullptr, /*allow_exceptions=*/false);
}

bool HasKey(const fs::path& report, const std::string& archive_key) {
  const Json json = ReadJson(report);
  return json.is_object() && json.value("archive_key", Json()) == archive_key;
}

/// By header and footer alone: a large archive is not read for its name.
bool IsArchive(const fs::path& path, const std::string& archive_key) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;
  const Result<MappedFile> file = MappedFile::Open(path);
  if (!file.ok()) return false;
  const Result<archive_format::Header> header = archive_format::DecodeHeader(file->bytes());
  return header.ok() && header->archive_key.Hex() == archive_key &&
         archive_format::DecodeFooter(file->bytes()).ok();
}

/// Moves a round's archive and report to where they belong, or what of it a kill has left to do. False: they
/// are nowhere.
Result<bool> PutInPlace(const fs::path& out_path, const std::string& archive_key) {
  const fs::path next = NextPath(out_path);
  const auto put = [&](const fs::path& from, const fs::path& to, auto is_it) -> Result<bool> {
    if (is_it(to, archive_key)) return true;
    if (!is_it(from, archive_key)) return false;
    std::error_code error;
    fs::rename(from, to, error);
    if (error) return IoError(to.string() + ": cannot put the file in place: " + error.message());
    return true;
  };
  GLINT_ASSIGN_OR_RETURN(const bool archive, put(next, out_path, IsArchive));
  GLINT_ASSIGN_OR_RETURN(const bool report, put(ReportPath(next), ReportPath(out_path), HasKey));
  return archive && report;
}

/// Finished rounds of the same bake, the best of them in place; none if it is lost.
Result<std::vector<TargetRound>> LoadRounds(const Digest& start_key, const fs::path& out_path) {
  const std::vector<TargetRound> none;
  const Json json = ReadJson(RoundsPath(out_path));
  if (!json.is_object() || json.value("key", Json()) != start_key.Hex() || !json.contains("rounds"))
    return none;
  std::vector<TargetRound> rounds;
  for (const Json& entry : json["rounds"]) {
    std::optional<TargetRound> round = RoundFromJson(entry);
    if (!round) return none;
    rounds.push_back(std::move(*round));
  }
  const TargetRound* best = BestOf(rounds);
  if (!best) return rounds;
  GLINT_ASSIGN_OR_RETURN(const bool there, PutInPlace(out_path, best->archive_key));
  return there ? rounds : none;
}

// ---- Running rounds ----

class TargetBake {
 public:
  TargetBake(const Digest& start_key, const fs::path& out_path, const BakeOptions& options,
             const RoundBake& bake)
      : key_(start_key), out_(out_path), options_(options), bake_(bake), begin_(SteadySeconds()) {}

  Result<BakeReport> Run() {
    GLINT_ASSIGN_OR_RETURN(rounds_, LoadRounds(key_, out_));
    found_ = rounds_.size();
    TargetStep step;
    for (;;) {
      step = Next();
      if (!step.settings) break;
      GLINT_ASSIGN_OR_RETURN(const bool in_time, RunRound(*step.settings));
      if (in_time) continue;
      step.reason = "the time is over";
      break;
    }
    RemoveNext();
    const TargetRound* best = BestOf(rounds_);
    if (best) return Finish(*best, step);
    std::error_code ignored;
    fs::remove(RoundsPath(out_), ignored);
    return NothingFits();
  }

 private:
  bool timed() const { return options_.target.max_seconds > 0; }
  double SecondsUsed() const {
    double seconds = SteadySeconds() - begin_;
    for (size_t i = 0; i < found_; ++i) seconds += rounds_[i].seconds;
    return seconds;
  }
  double SecondsLeft() const { return options_.target.max_seconds - SecondsUsed(); }

  TargetStep Next() {
    if (rounds_.empty()) return {FirstSettings(options_.settings, options_.target), false, ""};
    return NextStep(rounds_, options_.target, SecondsLeft());
  }

  /// False: its time was over before it was done.
  Result<bool> RunRound(const BakeSettings& settings) {
    BakeOptions options = options_;
    options.target = {};
    options.settings = settings;
    // What layers left out carry is no part of the estimate.
    if (options_.target.tolerance > 0)
      options.layer_tolerance = std::min(options.layer_tolerance, options_.target.tolerance / 4);
    std::optional<Digest> key;
    options.begins = [&](const Digest& bake_key) {
      key = bake_key;
      if (options_.begins) options_.begins(bake_key);
    };
    std::atomic<bool> late = false;  // threads ask
    options.stop = [&] {
      if (options_.stop && options_.stop()) return true;
      if (timed() && SecondsLeft() <= 0) late = true;
      return late.load();
    };
    const Stopwatch watch;
    const Result<BakeReport> report = bake_(options, NextPath(out_));
    if (!report.ok() && late) {
      Discard(key);
      return false;
    }
    if (!report.ok()) return report.status();
    GLINT_RETURN_IF_ERROR(Judge(settings, *report, watch.Seconds()));
    return true;
  }

  /// Puts the round into place if it is better, and notes it either way.
  Status Judge(const BakeSettings& settings, const BakeReport& report, double seconds) {
    TargetRound round;
    round.settings = settings;
    round.error = report.error->all.rms;
    round.cause = report.error->all.cause;
    round.seconds = seconds;
    round.bytes = report.archive_bytes;
    round.archive_key = report.archive_key.Hex();
    const TargetRound* best = BestOf(rounds_);
    const uint64_t most = options_.target.max_bytes;
    round.kept = (most == 0 || round.bytes <= most) && (!best || round.error < best->error);
    rounds_.push_back(std::move(round));
    Log(LogLevel::kNote, "round " + std::to_string(rounds_.size()) + ": error " + Text(rounds_.back().error) +
                             " (" + DescribeCauses(rounds_.back()) + "), " +
                             Text(1e-6 * static_cast<double>(rounds_.back().bytes)) + " MB, " +
                             Text(rounds_.back().seconds) + " s");
    const std::string notes = RoundsJson(key_, rounds_);
    GLINT_RETURN_IF_ERROR(PublishFile(RoundsPath(out_), std::as_bytes(std::span(notes))));
    if (rounds_.back().kept) return PutInPlace(out_, rounds_.back().archive_key).status();
    RemoveNext();
    return {};
  }

  void RemoveNext() const {
    std::error_code ignored;
    fs::remove(NextPath(out_), ignored);
    fs::remove(ReportPath(NextPath(out_)), ignored);
  }

  /// Finished tasks of a round that nobody will take up.
  void Discard(const std::optional<Digest>& key) const {
    if (!key || options_.keep_work) return;
    const fs::path root =
        options_.work_dir.empty() ? fs::path(NextPath(out_).string() + ".work") : options_.work_dir;
    const Result<bool> removed = WorkFolder::RemoveUnused(root, *key);
    if (!removed.ok()) Log(LogLevel::kWarning, removed.status().message());
    std::error_code ignored;
    if (options_.work_dir.empty()) fs::remove(root, ignored);  // only if it is empty
  }

  Status NothingFits() const {
    std::string text = out_.string() + ": no bake of the scene is within the budget:";
    if (rounds_.empty())
      return LimitExceeded(text + " the coarsest takes more than " + Text(options_.target.max_seconds) +
                           " s; give more, or fewer vertices");
    return LimitExceeded(text + " the coarsest has " + std::to_string(rounds_.front().bytes) +
                         " bytes; allow that, or give fewer vertices");
  }

  /// The best round's report with what was reached.
  Result<BakeReport> Finish(const TargetRound& best, const TargetStep& step) {
    Json json = ReadJson(ReportPath(out_));
    const BakeTarget& target = options_.target;
    Json& told = json["target"] = {{"tolerance", target.tolerance}, {"max_seconds", target.max_seconds},
                                   {"max_bytes", target.max_bytes}, {"reached", step.reached},
                                   {"error", best.error},           {"ended", step.reason},
                                   {"seconds", SecondsUsed()},      {"rounds", Json::array()}};
    for (const TargetRound& round : rounds_) told["rounds"].push_back(ToJson(round));
    BakeReport report;
    report.json = json.dump(1, '\t', false, Json::error_handler_t::replace) + "\n";
    report.archive_bytes = best.bytes;
    report.archive_key = *Digest::FromHex(best.archive_key);
    report.seconds = SecondsUsed();
    GLINT_RETURN_IF_ERROR(PublishFile(ReportPath(out_), std::as_bytes(std::span(report.json))));
    std::error_code ignored;
    fs::remove(RoundsPath(out_), ignored);
    return report;
  }

  const Digest key_;
  const fs::path out_;
  const BakeOptions& options_;
  const RoundBake& bake_;
  const double begin_;
  std::vector<TargetRound> rounds_;
  size_t found_ = 0;  ///< rounds of earlier runs
};

}  // namespace

BakeSettings FirstSettings(const BakeSettings& settings, const BakeTarget& target) {
  const auto is_free = [&](BakeAxis axis) { return !target.fixed[static_cast<size_t>(axis)]; };
  // Within a budget a coarse bake comes first, so that there is one at all.
  const bool budget = target.max_seconds > 0 || target.max_bytes > 0;
  const float tolerance = target.tolerance > 0 && !budget ? target.tolerance : 1;
  BakeSettings first = settings;
  if (is_free(BakeAxis::kVertices))
    first.spatial_tolerance = std::clamp(kFirstSpatial * tolerance, kFinestFirst, kCoarsestFirst);
  if (is_free(BakeAxis::kDirections)) {
    first.grid_level = std::min(settings.grid_level, kCoarsestLevel);
    first.angular_tolerance = std::clamp(tolerance, 0.05f, 0.2f);
  }
  if (is_free(BakeAxis::kRays)) {
    const float part = std::clamp(0.04f / tolerance, 0.25f, 1.0f);
    const auto rays = [part](int all) {
      return std::max(static_cast<int>(std::lround(part * static_cast<float>(all))), 1);
    };
    first.rays_per_kappa *= part;
    first.min_rays = rays(settings.min_rays);
    first.max_rays = std::max(rays(settings.max_rays), first.min_rays);
    first.paper_rays = rays(settings.paper_rays);
  }
  if (is_free(BakeAxis::kLobes)) first.slice_lobes = 1;
  if (is_free(BakeAxis::kBits)) {
    first.drop = std::max(settings.drop, target.tolerance / 8);
    first.bits_tolerance = std::max(settings.bits_tolerance, target.tolerance / 3);
  }
  return first;
}

std::vector<fs::path> ResultFiles(const fs::path& out_path) {
  const fs::path next = NextPath(out_path);
  return {out_path, ReportPath(out_path), next, ReportPath(next), RoundsPath(out_path)};
}

TargetStep NextStep(std::span<const TargetRound> rounds, const BakeTarget& target, double seconds_left) {
  const TargetRound* best = BestOf(rounds);
  if (!best) return {{}, false, "the coarsest bake has more bytes than it may"};
  if (target.tolerance > 0 && best->error <= static_cast<double>(target.tolerance))
    return {{}, true, "the tolerance is reached"};
  bool budget = false, tried = false;
  for (const AxisSteps& steps : Candidates(*best, NotableSteps(*best, target), target.tolerance)) {
    const BakeSettings next = Refined(*best, steps);
    if (Tried(rounds, next)) {
      tried = true;
      continue;
    }
    const RoundCost cost = Expected(*best, steps);
    const bool fits = (target.max_seconds <= 0 || cost.seconds <= seconds_left) &&
                      (target.max_bytes == 0 || cost.bytes <= static_cast<double>(target.max_bytes));
    if (fits) return {next, false, ""};
    budget = true;
  }
  const std::string left = "what is left is " + DescribeCauses(*best);
  if (budget) return {{}, false, "no finer bake is expected to be within the budget; " + left};
  const bool any = target.tolerance <= 0;  // without a tolerance the best there is was asked for
  return {
      {}, any, (tried ? "finer bakes were no better; " : "nothing that can be refined stands out; ") + left};
}

Result<BakeReport> RefineToTarget(const Digest& start_key, const fs::path& out_path,
                                  const BakeOptions& options, const RoundBake& bake) {
  if (options.estimate_slices == 0u)
    return UsageError(
        "a tolerance or a budget needs the estimate of the error to go by; leave out --estimate 0");
  return TargetBake(start_key, out_path, options, bake).Run();
}

}  // namespace glint
