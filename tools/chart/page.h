#pragma once

#include <string>

#include "common/base/status.h"
#include "tools/chart/chart.h"

namespace glint::chart {

/// The plots as SVG text; empty: not drawn, which the page says.
struct PagePlots {
  std::string seconds_svg, bytes_svg;
};

/// `text` for HTML, between tags or in quotes: no character of it is markup.
std::string EscapeHtml(const std::string& text);

/// One HTML page that needs nothing else: plots, table, and the picture of every point beside the reference.
Result<std::string> ChartPage(const Input& input, const Measured& measured, const PagePlots& plots);

}  // namespace glint::chart
