#include "tools/chart/page.h"

#include <openssl/evp.h>

#include <cstdio>
#include <span>

#include "common/render/image_codecs.h"
#include "tools/chart/tables.h"

namespace glint::chart {
namespace {

constexpr char kStyle[] =
    "body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:1040px;padding:0 1em;color:#111;"
    "background:#fff}"
    "h1{font-size:1.5em;margin-bottom:.2em}h2{font-size:1.15em;margin-top:2em}"
    "table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:14px}"
    "th,td{padding:.2em .7em;text-align:right;border-bottom:1px solid #ddd;white-space:nowrap}"
    "th:first-child,td:first-child{text-align:left}tr.front td{font-weight:600}"
    ".plot{width:100%;height:auto;display:block}.scroll{overflow-x:auto}"
    ".row{display:flex;flex-wrap:wrap;gap:4px}.row>*{max-width:100%}"
    "figure{margin:1.2em 0}figcaption{margin-bottom:.3em}.quiet{color:#666}";

std::string Base64(std::span<const unsigned char> bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');
  const int length = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()), bytes.data(),
                                     static_cast<int>(bytes.size()));
  text.resize(static_cast<size_t>(length));
  return text;
}

std::string DataUri(const std::string& kind, std::span<const std::byte> bytes) {
  return "data:" + kind + ";base64," +
         Base64({reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()});
}

Result<std::string> PictureUri(const Picture& picture, const ToneMap& tone) {
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> png, codec::EncodePng(picture, "picture", tone));
  return DataUri("image/png", png);
}

/// The relative difference in false colours.
Result<std::string> DifferenceUri(const Picture& picture, const Picture& reference) {
  GLINT_ASSIGN_OR_RETURN(Picture difference, FalseColorDifference(picture, reference));
  // Its colours are meant for the display as they are; encoding a PNG expects linear light.
  for (glm::vec4& pixel : difference.pixels) {
    for (int c = 0; c < 3; ++c) pixel[c] = SrgbToLinear(pixel[c]);
  }
  return PictureUri(difference, {.exposure = 1, .reinhard = false});
}

template <class... Values>
std::string Format(const char* format, Values... values) {
  char text[1024];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

std::string Plot(const std::string& svg, const char* alt) {
  if (svg.empty()) {
    return "<p class=quiet>This plot was not drawn: gnuplot (package gnuplot-nox) was not there or "
           "failed.</p>\n";
  }
  return "<img class=plot alt=\"" + std::string(alt) + "\" src=\"" +
         DataUri("image/svg+xml", std::as_bytes(std::span(svg))) + "\">\n";
}

std::string About(const Input& input, const Measured& measured) {
  const std::string camera = EscapeHtml(input.view.camera.name);
  return "<p>Environment " + EscapeHtml(input.environment_name) +
         Format(", turned by %g degrees; camera ", static_cast<double>(input.view.environment_rotation_deg)) +
         camera +
         Format(
             "; %d x %d pixels; up to %d indirect bounces. Errors are relMSE of blocks of %d x %d pixels "
             "against one path-traced picture (%s BRDF, %d paths a pixel), whose own noise is %.3g in that "
             "measure. Seconds are of the bake alone, with %d thread%s, measured when the point was baked; "
             "bytes are of the archive.</p>\n",
             input.view.width, input.view.height, input.reference.bounces, kBlock, kBlock,
             input.reference.lobes ? "fitted" : "true", input.reference.samples,
             measured.reference.noise_blocks, measured.threads, measured.threads == 1 ? "" : "s");
}

std::string Table(const Measured& measured) {
  std::string html =
      "<div class=scroll><table>\n<tr><th>point<th>bake, s<th>cpu, s<th>archive, MB<th>relMSE "
      "4x4<th>relMSE<th>FLIP"
      "<th>picture, s<th>front<th>baked at (UTC)</tr>\n";
  for (const MeasuredPoint& p : measured.points) {
    const bool front = p.on_seconds_front || p.on_bytes_front;
    html += std::string(front ? "<tr class=front>" : "<tr>") + "<td>" + EscapeHtml(p.point.name) +
            Format("<td>%.2f<td>%.2f<td>%.3f<td>%.3g<td>%.3g<td>%.4f<td>%.2f<td>%s%s%s<td>", p.seconds,
                   p.cpu_seconds, 1e-6 * p.bytes, p.blocks.rel_mse, p.pixels.rel_mse, p.pixels.flip,
                   p.render_seconds, p.on_seconds_front ? "seconds" : "",
                   p.on_seconds_front && p.on_bytes_front ? ", " : "", p.on_bytes_front ? "bytes" : "") +
            EscapeHtml(p.measured_at) + "</tr>\n";
  }
  return html + "</table></div>\n";
}

/// What the letters of names mean.
std::string Legend() {
  std::string html = "<p class=quiet>In names: ";
  for (size_t i = 0; i < Axes().size(); ++i) {
    const Axis& axis = Axes()[i];
    html +=
        (i > 0 ? ", " : "") + std::string("<b>") + EscapeHtml(axis.letter) + "</b> " + EscapeHtml(axis.word);
  }
  return html + ". What does not vary is not named; all settings are in chart.csv and chart.json.</p>\n";
}

Result<std::string> Pictures(const Input& input, const Measured& measured) {
  const std::string size = Format("width=%d height=%d", input.view.width, input.view.height);
  std::string html;
  for (const MeasuredPoint& p : measured.points) {
    GLINT_ASSIGN_OR_RETURN(const std::string picture, PictureUri(p.picture, input.tone));
    GLINT_ASSIGN_OR_RETURN(const std::string difference,
                           DifferenceUri(p.picture, measured.reference.picture));
    const std::string name = EscapeHtml(p.point.name);
    html += "<figure><figcaption><b>" + name + "</b>" +
            Format(": relMSE %.3g, %.2f s, %.3f MB", p.blocks.rel_mse, p.seconds, 1e-6 * p.bytes) +
            "</figcaption><div class=row><img " + size + " alt=\"" + name + "\" src=\"" + picture +
            "\"><div class=reference role=img aria-label=\"reference\"></div><img " + size +
            " alt=\"difference of " + name + "\" src=\"" + difference + "\"></div></figure>\n";
  }
  return html;
}

}  // namespace

std::string EscapeHtml(const std::string& text) {
  std::string escaped;
  for (const char c : CleanUtf8(text)) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

Result<std::string> ChartPage(const Input& input, const Measured& measured, const PagePlots& plots) {
  // The reference appears beside every point; as a background of a class it is in the page once.
  GLINT_ASSIGN_OR_RETURN(const std::string reference, PictureUri(measured.reference.picture, input.tone));
  GLINT_ASSIGN_OR_RETURN(const std::string pictures, Pictures(input, measured));
  const std::string scene = EscapeHtml(input.scene_name);
  return "<!DOCTYPE html>\n<html lang=en>\n<head>\n<meta charset=utf-8>\n"
         "<meta name=viewport content=\"width=device-width,initial-scale=1\">\n<title>Chart of " +
         scene + "</title>\n<style>" + kStyle +
         Format(".reference{width:%dpx;height:%dpx;background-size:cover;background-image:url(",
                input.view.width, input.view.height) +
         reference + ")}</style>\n</head>\n<body>\n<h1>" + scene + "</h1>\n" + About(input, measured) +
         "<h2>Error over seconds</h2>\n" + Plot(plots.seconds_svg, "error over seconds") +
         "<h2>Error over bytes</h2>\n" + Plot(plots.bytes_svg, "error over bytes") + "<h2>Points</h2>\n" +
         Table(measured) + Legend() +
         "<h2>Pictures</h2>\n<p>Left to right: the point, the reference, the relative difference in false "
         "colours.</p>\n" +
         pictures + "</body>\n</html>\n";
}

}  // namespace glint::chart
