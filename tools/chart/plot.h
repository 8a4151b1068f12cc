#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/status.h"

namespace glint::chart {

struct PlotPoint {
  std::string name, method;
  double cost = 0, error = 0;
  bool on_front = false;
};

/// Error over cost, both axes logarithmic. Texts may hold anything.
struct PlotInput {
  std::string name;  ///< of the files, without extension: letters and _
  std::string title, cost_label, error_label;
  std::vector<PlotPoint> points;
  double noise = 0;  ///< of the reference, in the error's measure: a line, if it is near the points
};

/// The bytes of the two files.
struct PlotFiles {
  std::string svg, png;
};

/// `text` as a string of gnuplot's: in single quotes, where nothing is expanded, on one line.
std::string GnuplotQuote(const std::string& text);

/// The script that draws NAME.svg and NAME.png in the folder that gnuplot runs in. Points without place on a
/// logarithmic axis (0, negative, not finite) are left out.
std::string PlotScript(const PlotInput& plot);

/// Draws with `gnuplot` (a program's path, or a name that is looked for in PATH) in `work`, a folder that
/// exists. kIo if it is not there, naming the package, or fails, with its message.
Result<PlotFiles> DrawPlot(const PlotInput& plot, const std::filesystem::path& work,
                           const std::string& gnuplot);

}  // namespace glint::chart
