#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/render/environment.h"
#include "common/render/metrics.h"
#include "common/render/reference.h"
#include "common/render/view.h"
#include "common/scene/scene.h"
#include "tools/chart/record.h"
#include "tools/chart/sweep.h"

namespace glint::chart {

/// What is charted, and how it is looked at. The same view, light and number of bounces for all pictures.
struct Input {
  const Scene& scene;
  const Environment& environment;
  std::string scene_name, environment_name;  ///< as the user wrote them
  View view;
  ReferenceOptions reference;
  int samples = 4;  ///< camera rays per pixel of a point's picture
  ToneMap tone;     ///< of pictures in the page, and of FLIP
  int threads = 0;
};

/// A point and how it did.
struct MeasuredPoint {
  Point point;
  Digest key;
  bool kept = false;        ///< from an earlier run: its seconds are those of that run
  std::string measured_at;  ///< UTC, "2026-01-31T12:00:00Z"
  double seconds = 0;       ///< of the bake alone
  double cpu_seconds = 0;   ///< of all its threads
  double bytes = 0;         ///< of the archive
  double render_seconds = 0;
  Comparison blocks;  ///< with the reference, blocks of kBlock pixels
  Comparison pixels;  ///< pixel by pixel
  bool on_seconds_front = false, on_bytes_front = false;
  Picture picture;
};

struct MeasuredReference {
  Digest key;
  bool kept = false;
  double seconds = 0, noise = 0, noise_blocks = 0;  ///< relMSE of its own noise
  Picture picture;
};

struct Measured {
  MeasuredReference reference;
  std::vector<MeasuredPoint> points;
  int threads = 1;  ///< resolved
};

inline constexpr int kBlock = 4;  ///< pixels; the side of the blocks in which errors are measured

/// Hash of all that a point's record depends on: program and machine's instruction set, threads (seconds do),
/// scene, settings, view and light. It does not depend on the reference, whose change costs no bake.
Digest PointKey(const Input& input, const Point& point);
/// The same of the reference's; threads do not matter to it.
Digest ReferenceKey(const Input& input);

/// Takes the reference and all points from `folder`, and computes and keeps there what is missing, one after
/// the other with all threads. kInterrupted: what is finished is kept; kIo if another chart runs in the
/// folder; errors of a bake name the point.
Result<Measured> Measure(const Input& input, const std::vector<Point>& points,
                         const std::filesystem::path& folder);

/// Writes chart.csv, chart.json, error_over_seconds and error_over_bytes (.svg and .png, drawn by `gnuplot`)
/// and index.html with all of it. If the plots cannot be drawn the rest is written, plots of an earlier run
/// are removed, and the status is kIo, naming the package.
Status Publish(const Input& input, const Measured& measured, const std::filesystem::path& folder,
               const std::string& gnuplot = "gnuplot");

}  // namespace glint::chart
