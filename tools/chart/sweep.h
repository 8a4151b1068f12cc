#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/base/hash.h"
#include "common/base/status.h"
#include "coordinator/bake.h"

// What a chart sweeps: methods (ways to get a picture from a scene) and axes (settings with several values).
// Both are tables; a new axis is a row of Axes(), a new method a row of Methods() in method.h.

namespace glint::chart {

/// Everything that a point's values can change. Methods with settings of their own add a member.
struct Settings {
  BakeOptions bake;
};

/// One setting that a sweep varies.
struct Axis {
  std::string word;      ///< of the command line without dashes, and the column in CSV and JSON: "directions"
  std::string letter;    ///< before its value in a point's name: "d" as in "d642"
  std::string type;      ///< what help calls a value: "N"
  std::string defaults;  ///< values separated by commas
  std::string help;
  std::vector<std::string> methods;  ///< those that it matters to; empty: all
  /// Puts the value into the settings and returns its canonical text ("4.0" becomes "4"). kUsage saying what
  /// is allowed, without the word.
  Result<std::string> (*take)(const std::string& text, Settings* settings);

  bool MattersTo(const std::string& method) const;
};

/// All axes, in the order of names and columns.
const std::vector<Axis>& Axes();

/// One thing to bake and to measure.
struct Point {
  std::string method;
  std::vector<std::pair<std::string, std::string>> values;  ///< (axis word, canonical text), in Axes() order
  std::string name;  ///< method, and the values of the axes that vary in this sweep: "shared d642 r4 l3"
  Settings settings;
};

/// Method names, and the values of axes by word; an axis that is absent has its defaults.
struct Sweep {
  std::string methods;
  std::map<std::string, std::string> values;
};

inline constexpr size_t kMaxPoints = 1000;

/// Every combination that makes a difference, methods first, each once. `base` holds what is not swept.
/// kUsage naming the word and the value.
Result<std::vector<Point>> ExpandSweep(const Sweep& sweep, std::span<const std::string> known_methods,
                                       const Settings& base);

/// "a,b,c" without empty parts; kUsage for an empty list or part.
Result<std::vector<std::string>> SplitList(const std::string& word, const std::string& text);

}  // namespace glint::chart
