#include "tools/chart/sweep.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "common/domain/direction_grid.h"

namespace glint::chart {
namespace {

/// A number of type T in [low, high], whole text, into `value`; returns its shortest text.
template <class T>
Result<std::string> TakeNumber(const std::string& text, T low, T high, T* value) {
  T number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  // Written so that a value that is not a number fails.
  if (error != std::errc() || end != text.data() + text.size() || !(number >= low && number <= high)) {
    char range[96];
    std::snprintf(range, sizeof range, "%g to %g", static_cast<double>(low), static_cast<double>(high));
    return UsageError("'" + text + "' is not a number from " + range);
  }
  *value = number;
  char canonical[32];
  const auto written = std::to_chars(canonical, canonical + sizeof canonical, number);
  return std::string(canonical, written.ptr);
}

Result<std::string> TakeDirections(const std::string& text, Settings* settings) {
  uint32_t directions = 0;
  GLINT_ASSIGN_OR_RETURN(std::string canonical, TakeNumber(text, 1u, 1u << 30, &directions));
  const int level = DirectionGrid::LevelOf(directions);
  if (level < 0) {
    std::string sizes;
    for (int i = 0, size = 12; i <= DirectionGrid::kMaxLevel; ++i, size = 4 * size - 6) {
      sizes += (i > 0 ? ", " : "") + std::to_string(size);
    }
    return UsageError("'" + text + "' is not one of " + sizes);
  }
  settings->bake.settings.grid_level = level;
  return canonical;
}

std::vector<Axis> MakeAxes() {
  return {
      {"directions",
       "d",
       "N",
       "162,642",
       "View directions: any of 12, 42, 162, 642, 2562, 10242",
       {},
       TakeDirections},
      {"rays-per-kappa",
       "r",
       "X",
       "1,4",
       "shared: rays per vertex and unit of its sharpest lobe's kappa",
       {"shared"},
       [](const std::string& text, Settings* s) {
         return TakeNumber(text, 0.01f, 1e4f, &s->bake.settings.rays_per_kappa);
       }},
      {"own-rays",
       "o",
       "N",
       "32",
       "shared: rays of a slice's own where its lobe is too sharp for the vertex's; 0: none",
       {"shared"},
       [](const std::string& text, Settings* s) {
         return TakeNumber(text, 0, kMaxOwnRays, &s->bake.settings.own_rays);
       }},
      {"paper-rays",
       "p",
       "N",
       "8",
       "paper: rays per slice and layer",
       {"paper"},
       [](const std::string& text, Settings* s) {
         return TakeNumber(text, 1, 1 << 20, &s->bake.settings.paper_rays);
       }},
      {"lobes",
       "l",
       "N",
       "1,3",
       "At most this many lobes for a material's highlight",
       {},
       [](const std::string& text, Settings* s) {
         return TakeNumber(text, 1, kMaxBrdfLobes, &s->bake.settings.fit.max_lobes);
       }},
      {"drop",
       "c",
       "X",
       "0.0009765625",
       "Leave out slices that change the light by less than this",
       {},
       [](const std::string& text, Settings* s) {
         return TakeNumber(text, 0.0f, 1.0f, &s->bake.settings.drop);
       }},
      {"tolerance",
       "e",
       "X",
       "0",
       "Bake ever finer until the estimated error is at most this; 0: as the other axes say",
       {},
       [](const std::string& text, Settings* s) {
         return TakeNumber(text, 0.0f, 1.0f, &s->bake.target.tolerance);
       }},
      {"angular-tolerance",
       "a",
       "X",
       "0",
       "shared: leave out directions whose slices interpolation gives within this error",
       {"shared"},
       [](const std::string& text, Settings* s) {
         return TakeNumber(text, 0.0f, 1e3f, &s->bake.settings.angular_tolerance);
       }},
      {"layer-tolerance",
       "t",
       "X",
       "0.01",
       "No further layer once one carries less than this part of the light",
       {},
       [](const std::string& text, Settings* s) {
         return TakeNumber(text, 0.0f, 1.0f, &s->bake.layer_tolerance);
       }},
  };
}

/// The values of one axis, canonical, each once, in the order given.
Result<std::vector<std::string>> CanonicalValues(const Axis& axis, const std::string& text,
                                                 const Settings& base) {
  const std::string word = "--" + axis.word;
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::string> parts, SplitList(word, text));
  std::vector<std::string> values;
  for (const std::string& part : parts) {
    Settings scratch = base;
    Result<std::string> canonical = axis.take(part, &scratch);
    if (!canonical.ok()) return canonical.status().WithContext(word);
    if (std::find(values.begin(), values.end(), *canonical) == values.end()) values.push_back(*canonical);
  }
  return values;
}

/// Names and settings of points whose values are known.
Status FinishPoint(const std::set<std::string>& varying, const Settings& base, Point* point) {
  point->name = point->method;
  point->settings = base;
  for (const Axis& axis : Axes()) {
    for (const auto& [word, value] : point->values) {
      if (word != axis.word) continue;
      GLINT_RETURN_IF_ERROR(axis.take(value, &point->settings).status());
      if (varying.count(word)) point->name += " " + axis.letter + value;
    }
  }
  return {};
}

}  // namespace

bool Axis::MattersTo(const std::string& method) const {
  return methods.empty() || std::find(methods.begin(), methods.end(), method) != methods.end();
}

const std::vector<Axis>& Axes() {
  static const std::vector<Axis> axes = MakeAxes();
  return axes;
}

Result<std::vector<std::string>> SplitList(const std::string& word, const std::string& text) {
  std::vector<std::string> parts;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    if (parts.back().empty()) {
      return UsageError(word + ": '" + text + "' is not a list of values separated by commas");
    }
    begin = end + 1;
  }
  return parts;
}

Result<std::vector<Point>> ExpandSweep(const Sweep& sweep, std::span<const std::string> known_methods,
                                       const Settings& base) {
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::string> methods, SplitList("--gather", sweep.methods));
  std::vector<Point> points;
  std::set<std::string> varying;
  for (size_t m = 0; m < methods.size(); ++m) {
    const std::string& method = methods[m];
    if (std::find(known_methods.begin(), known_methods.end(), method) == known_methods.end()) {
      std::string names;
      for (const std::string& name : known_methods) names += (names.empty() ? "" : ", ") + name;
      return UsageError("--gather: '" + method + "' is not one of " + names);
    }
    if (std::find(methods.begin(), methods.begin() + m, method) != methods.begin() + m) continue;
    std::vector<Point> grown(1);
    grown[0].method = method;
    for (const Axis& axis : Axes()) {
      const auto given = sweep.values.find(axis.word);
      GLINT_ASSIGN_OR_RETURN(
          const std::vector<std::string> values,
          CanonicalValues(axis, given == sweep.values.end() ? axis.defaults : given->second, base));
      if (!axis.MattersTo(method)) continue;
      if (values.size() > 1) varying.insert(axis.word);
      if (grown.size() * values.size() + points.size() > kMaxPoints) {
        return UsageError("the sweep has more than " + std::to_string(kMaxPoints) +
                          " points; give fewer values");
      }
      std::vector<Point> next;
      for (const Point& point : grown) {
        for (const std::string& value : values) {
          next.push_back(point);
          next.back().values.emplace_back(axis.word, value);
        }
      }
      grown = std::move(next);
    }
    points.insert(points.end(), grown.begin(), grown.end());
  }
  for (Point& point : points) GLINT_RETURN_IF_ERROR(FinishPoint(varying, base, &point));
  return points;
}

}  // namespace glint::chart
