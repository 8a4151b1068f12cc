#include "worker/line_chooser.h"

#include <algorithm>
#include <utility>

namespace glint {
namespace {

/// What waits in a line, counted in tasks, so that somebody who must trace them first helps.
constexpr uint64_t kWorthTracing = 4;
/// How long a line may stand still before anybody helps, in units of what a task takes.
constexpr double kPatience = 4;

}  // namespace

size_t ChooseBake(std::span<const QueuedBake> bakes, std::mt19937* random) {
  std::vector<double> weights;
  for (const QueuedBake& bake : bakes) weights.push_back(bake.priority);
  return std::discrete_distribution<size_t>(weights.begin(), weights.end())(*random);
}

LineChooser::LineChooser(uint32_t lines, uint32_t home, uint64_t seed)
    : home_(home), random_(seed), lines_(lines), next_(home) {}

LineChooser::Choice LineChooser::Choose(double now) {
  const std::lock_guard lock(mutex_);
  if (goes_on_) return {next_, true};
  if (!known_) return {home_, false};
  if (lines_[home_].Waiting() > 0) return {home_, true};
  std::optional<uint32_t> other = Pick([&](const Line& line) { return Help(line, now); });
  // What others have had for long may come again; but the next round is to find this worker at home.
  looks_around_ = !other && !looks_around_;
  if (looks_around_)
    other = Pick([&](const Line& line) { return line.messages > 0 && StandsStill(line, now) ? 1.0 : 0.0; });
  return {other.value_or(home_), other.has_value()};
}

/// A random line, in proportion to its weight: if all went to the best one, most would come too late.
std::optional<uint32_t> LineChooser::Pick(const std::function<double(const Line&)>& weight) {
  std::vector<double> weights;
  for (const Line& line : lines_) weights.push_back(weight(line));
  if (std::all_of(weights.begin(), weights.end(), [](double w) { return w == 0; })) return std::nullopt;
  return std::discrete_distribution<uint32_t>(weights.begin(), weights.end())(random_);
}

/// How much a line needs help. Whoever helps traces what another has traced: with the last few tasks, that
/// takes longer than to leave them to the other, unless nobody comes for them.
double LineChooser::Help(const Line& line, double now) const {
  const auto waiting = static_cast<double>(line.Waiting());
  const bool is_worth_it = first_layer_ || line.Waiting() >= kWorthTracing || StandsStill(line, now);
  return is_worth_it ? waiting * waiting : 0;
}

bool LineChooser::StandsStill(const Line& line, double now) const {
  return now - line.changed > kPatience * task_seconds_;
}

void LineChooser::Update(std::span<const uint64_t> messages, double now) {
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < lines_.size(); ++i) {
    Line& line = lines_[i];
    const uint64_t before = std::exchange(line.messages, i < messages.size() ? messages[i] : 0);
    if (before != line.messages) line.changed = now;
    line.taken = std::min(line.taken, line.messages);
  }
  known_ = true;
}

void LineChooser::Took(const TaskMessage& task, int layer) {
  const std::lock_guard lock(mutex_);
  if (round_ != task.manifest) {
    for (Line& line : lines_) line.taken = 0;
    home_is_empty_ = false;
  }
  round_ = task.manifest;
  first_layer_ = layer == 0;
  next_ = first_layer_ ? task.shard : home_;
  goes_on_ = first_layer_ || !home_is_empty_;
  known_ = false;
}

void LineChooser::Finished(double seconds) {
  const std::lock_guard lock(mutex_);
  task_seconds_ = seconds;
}

void LineChooser::FoundEmpty(uint32_t line) {
  const std::lock_guard lock(mutex_);
  if (line == next_) goes_on_ = false;
  home_is_empty_ = home_is_empty_ || line == home_;
  lines_[line].taken = lines_[line].messages;
  known_ = false;
}

}  // namespace glint
