#include "tools/chart/plot.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <span>
#include <system_error>

#include "common/base/files.h"
#include "tools/chart/label_layout.h"
#include "tools/chart/tables.h"

extern char** environ;

namespace glint::chart {
namespace {

namespace fs = std::filesystem;

// The picture, in pixels, and the frame of the axes in it.
constexpr double kWidth = 1000, kHeight = 680;
constexpr LabelFrame kFrame{.left = 90, .bottom = 64, .right = 980, .top = 596, .text_height = 14};
constexpr double kCharWidth = 6.6;  ///< of a name's font, a little more than the mean

// Colours that colour-blind people can tell apart (Okabe and Ito), and gnuplot's filled marks.
struct Style {
  const char* color;
  int mark;
};
constexpr Style kStyles[] = {{"#0072B2", 7},  {"#D55E00", 5},  {"#009E73", 9},
                             {"#CC79A7", 13}, {"#E69F00", 11}, {"#56B4E9", 15}};

std::string Num(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

bool HasPlace(const PlotPoint& p) {
  return std::isfinite(p.cost) && std::isfinite(p.error) && p.cost > 0 && p.error > 0;
}

/// A logarithmic axis.
struct LogAxis {
  double low = 1, high = 10;

  /// From 0 at the low end to 1.
  double Place(double value) const { return std::log(value / low) / std::log(high / low); }
  void Pad(double part) {
    const double factor = std::max(std::pow(high / low, part), 1.05);
    low /= factor;
    high *= factor;
  }
};

LogAxis Span(const std::vector<PlotPoint>& points, double PlotPoint::*value) {
  LogAxis axis;
  for (size_t i = 0; i < points.size(); ++i) {
    const double v = points[i].*value;
    axis.low = i == 0 ? v : std::min(axis.low, v);
    axis.high = i == 0 ? v : std::max(axis.high, v);
  }
  return axis;
}

std::string Tick(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return GnuplotQuote(text) + " " + Num(value);
}

/// Where an axis has marks: at round steps if it is short, at chosen digits times powers of ten if not.
std::vector<double> TickValues(const LogAxis& axis) {
  std::vector<double> values;
  const double ratio = axis.high / axis.low;
  if (ratio < 3) {
    const double rough = (axis.high - axis.low) / 6, power = std::pow(10.0, std::floor(std::log10(rough)));
    const double step = power * (rough > 5 * power ? 10 : rough > 2 * power ? 5 : rough > power ? 2 : 1);
    for (double k = std::ceil(axis.low / step); k * step <= axis.high; ++k) values.push_back(k * step);
    return values;
  }
  const std::vector<double> digits = ratio < 12     ? std::vector<double>{1, 1.5, 2, 3, 4, 5, 6, 8}
                                     : ratio < 1000 ? std::vector<double>{1, 2, 5}
                                                    : std::vector<double>{1};
  for (double power = std::pow(10.0, std::floor(std::log10(axis.low))); power <= axis.high; power *= 10) {
    for (const double digit : digits) {
      const double value = digit * power;
      if (value >= axis.low && value <= axis.high) values.push_back(value);
    }
  }
  return values;
}

std::string Ticks(const LogAxis& axis) {
  std::string list;
  for (const double value : TickValues(axis)) list += (list.empty() ? "" : ", ") + Tick(value);
  return "(" + list + ")";
}

/// Distinct methods in order of first appearance.
std::vector<std::string> MethodsOf(const std::vector<PlotPoint>& points) {
  std::vector<std::string> methods;
  for (const PlotPoint& p : points) {
    if (std::find(methods.begin(), methods.end(), p.method) == methods.end()) methods.push_back(p.method);
  }
  return methods;
}

/// One labelled block of numbers that `plot` can use as a file.
std::string DataBlock(const std::string& name, std::vector<const PlotPoint*> points) {
  std::string text = "$" + name + " << END_OF_DATA\n";
  for (const PlotPoint* p : points) text += Num(p->cost) + " " + Num(p->error) + "\n";
  return text + "END_OF_DATA\n";
}

std::string Labels(const std::vector<PlotPoint>& points, const LogAxis& x, const LogAxis& y) {
  std::vector<LabelledPoint> labelled;
  for (const PlotPoint& p : points) {
    labelled.push_back({kFrame.left + x.Place(p.cost) * (kFrame.right - kFrame.left),
                        kFrame.bottom + y.Place(p.error) * (kFrame.top - kFrame.bottom),
                        kCharWidth * static_cast<double>(p.name.size()), p.on_front});
  }
  const std::vector<LabelPlace> places = PlaceLabels(labelled, kFrame);
  std::string text;
  for (size_t i = 0; i < points.size(); ++i) {
    const LabelPlace& at = places[i];
    const std::string screen = Num(at.x / kWidth) + "," + Num(at.y / kHeight);
    text += "set label " + GnuplotQuote(points[i].name) + " at screen " + screen +
            " left front noenhanced font 'DejaVu Sans,10' tc rgb '" +
            (points[i].on_front ? "#111111" : "#777777") + "'\n";
    if (!at.away) continue;
    const double nearest = std::clamp(labelled[i].x, at.x, at.x + labelled[i].width);
    const double edge = labelled[i].y > at.y ? at.y + 6 : at.y - 6;
    text += "set arrow from screen " + Num(labelled[i].x / kWidth) + "," + Num(labelled[i].y / kHeight) +
            " to screen " + Num(nearest / kWidth) + "," + Num(edge / kHeight) +
            " nohead back lw 0.7 lc rgb '#aaaaaa'\n";
  }
  return text;
}

std::string Frame(const PlotInput& plot, const LogAxis& x, const LogAxis& y) {
  return "set encoding utf8\n"
         "set lmargin at screen " +
         Num(kFrame.left / kWidth) + "\nset rmargin at screen " + Num(kFrame.right / kWidth) +
         "\nset bmargin at screen " + Num(kFrame.bottom / kHeight) + "\nset tmargin at screen " +
         Num(kFrame.top / kHeight) + "\nset label " + GnuplotQuote(plot.title) + " at screen " +
         Num(kFrame.left / kWidth) +
         ",0.965 left noenhanced font 'DejaVu Sans,14'\n"
         "set key at screen " +
         Num(kFrame.right / kWidth) +
         ",0.925 right top horizontal Left reverse samplen 1 noenhanced\n"
         "set logscale xy\nset border 3 lc rgb '#444444'\n"
         "set grid xtics ytics back lc rgb '#cccccc' lw 0.8 dt 1\n"
         "set xrange [" +
         Num(x.low) + ":" + Num(x.high) + "]\nset yrange [" + Num(y.low) + ":" + Num(y.high) +
         "]\nset xtics nomirror " + Ticks(x) + "\nset ytics nomirror " + Ticks(y) + "\nset xlabel " +
         GnuplotQuote(plot.cost_label) + " noenhanced\nset ylabel " + GnuplotQuote(plot.error_label) +
         " noenhanced offset 1,0\n";
}

/// The data and what to draw of it: "A, B, ...".
std::string Curves(const std::vector<PlotPoint>& points, double noise, std::string* data) {
  std::vector<const PlotPoint*> front;
  for (const PlotPoint& p : points) {
    if (p.on_front) front.push_back(&p);
  }
  std::sort(front.begin(), front.end(), [](const PlotPoint* a, const PlotPoint* b) {
    return a->cost != b->cost ? a->cost < b->cost : a->error > b->error;
  });
  std::string curves;
  if (!front.empty()) {
    *data += DataBlock("front", front);
    curves +=
        "$front using 1:2 with steps lw 1.5 lc rgb '#bbbbbb' notitle, "
        "$front using 1:2 with points pt 6 ps 2.4 lw 1.5 lc rgb '#111111' title 'Pareto front', ";
  }
  const std::vector<std::string> methods = MethodsOf(points);
  for (size_t m = 0; m < methods.size(); ++m) {
    std::vector<const PlotPoint*> own;
    for (const PlotPoint& p : points) {
      if (p.method == methods[m]) own.push_back(&p);
    }
    const std::string name = "method" + std::to_string(m);
    *data += DataBlock(name, own);
    const Style& style = kStyles[m % std::size(kStyles)];
    curves += "$" + name + " using 1:2 with points pt " + std::to_string(style.mark) + " ps 1.2 lc rgb '" +
              style.color + "' title " + GnuplotQuote(methods[m]) + ", ";
  }
  if (noise > 0)
    curves += Num(noise) + " with lines dt 3 lw 1.2 lc rgb '#999999' title 'noise of the reference', ";
  return curves.substr(0, curves.size() - 2);
}

/// Starts `program` with arguments in `work`, without a shell; output and errors go to `log`. Returns its
/// exit code.
Result<int> RunProgram(const std::string& program, const std::vector<std::string>& arguments,
                       const fs::path& work, const fs::path& log) {
  std::vector<char*> argv{const_cast<char*>(program.c_str())};  // posix_spawn does not write to them
  for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, fs::absolute(log).c_str(), O_WRONLY | O_CREAT | O_TRUNC,
                                   0666);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  posix_spawn_file_actions_addchdir_np(&actions, work.c_str());
  pid_t child = 0;
  const int error = posix_spawnp(&child, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT || error == EACCES || error == ENOTDIR) {
    return IoError("'" + program +
                   "' is not there: the plots were not drawn; install the package gnuplot-nox "
                   "and give the same command again");
  }
  if (error != 0) return IoError(program + ": cannot start: " + std::generic_category().message(error));
  int state = 0;
  while (waitpid(child, &state, 0) < 0) {
    if (errno != EINTR) return IoError(program + ": cannot wait for its end");
  }
  return WIFEXITED(state) ? WEXITSTATUS(state) : 128 + WTERMSIG(state);
}

std::string TextOf(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Result<std::string> ReadText(const fs::path& path) {
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, uint64_t{64} << 20));
  return TextOf(bytes);
}

}  // namespace

std::string GnuplotQuote(const std::string& text) {
  std::string quoted = "'";
  for (const char c : CleanUtf8(text)) {
    const bool control = static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
    quoted += control ? std::string(" ") : c == '\'' ? std::string("''") : std::string(1, c);
  }
  return quoted + "'";
}

std::string PlotScript(const PlotInput& plot) {
  std::vector<PlotPoint> points;
  std::copy_if(plot.points.begin(), plot.points.end(), std::back_inserter(points), HasPlace);
  LogAxis x = Span(points, &PlotPoint::cost), y = Span(points, &PlotPoint::error);
  // The line of the noise may make the axis half as long again, not more.
  const bool shows_noise =
      plot.noise > 0 && plot.noise < y.high && plot.noise > y.low / std::max(4.0, std::sqrt(y.high / y.low));
  if (shows_noise) y.low = std::min(y.low, plot.noise);
  x.Pad(0.1);
  y.Pad(0.12);

  std::string data;
  const std::string curves = Curves(points, shows_noise ? plot.noise : 0, &data);
  const std::string size = Num(kWidth) + "," + Num(kHeight);
  std::string script = data + Frame(plot, x, y) + Labels(points, x, y);
  for (const char* kind : {"svg", "png"}) {
    const bool svg = std::string(kind) == "svg";
    script += (svg ? "set terminal svg size " : "set terminal pngcairo size ") + size +
              (svg ? " dynamic" : "") + " noenhanced font 'DejaVu Sans,12' background rgb 'white'\n" +
              "set output " + GnuplotQuote(plot.name + "." + kind) + "\n" +
              (curves.empty() ? "plot NaN notitle" : "plot " + curves) + "\nunset output\n";
  }
  return script;
}

Result<PlotFiles> DrawPlot(const PlotInput& plot, const fs::path& work, const std::string& gnuplot) {
  const std::string script = PlotScript(plot);
  const std::string script_name = plot.name + ".gp";
  GLINT_RETURN_IF_ERROR(PublishFile(work / script_name, std::as_bytes(std::span(script))));
  const fs::path log = work / (plot.name + ".log");
  // -d: without the user's own start-up files.
  GLINT_ASSIGN_OR_RETURN(const int code, RunProgram(gnuplot, {"-d", script_name}, work, log));
  const Result<std::string> svg = ReadText(work / (plot.name + ".svg"));
  const Result<std::string> png = ReadText(work / (plot.name + ".png"));
  if (code != 0 || !svg.ok() || !png.ok() || svg->empty() || png->empty()) {
    const Result<std::string> said = ReadText(log);
    return IoError(gnuplot + ": could not draw the plots (exit code " + std::to_string(code) +
                   "); is it the package gnuplot-nox? It says: " + (said.ok() ? *said : "nothing"));
  }
  return PlotFiles{*svg, *png};
}

}  // namespace glint::chart
