// The parts of `glint chart`: what is swept, what is kept, which points are best, what the outputs hold.

#include "tools/chart/chart.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <set>
#include <stdexcept>

#include "common/base/log.h"
#include "common/scene/generate.h"
#include "tests/base/temp_folder.h"
#include "tools/chart/label_layout.h"
#include "tools/chart/method.h"
#include "tools/chart/page.h"
#include "tools/chart/pareto.h"
#include "tools/chart/plot.h"
#include "tools/chart/tables.h"

namespace glint::chart {
namespace {

namespace fs = std::filesystem;

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

std::string ReadText(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

Result<std::vector<Point>> Expand(const std::string& methods,
                                  std::map<std::string, std::string> values = {}) {
  return ExpandSweep({methods, std::move(values)}, MethodNames(), {});
}

TEST(ChartParetoTest, FrontOfGivenPoints) {
  //           on    beaten  on      beaten: dearer at equal error
  const std::vector<CostError> points{{1, 10}, {2, 11}, {3, 5}, {4, 5}, {5, 1}};
  EXPECT_EQ(ParetoFront(points), (std::vector<bool>{true, false, true, false, true}));
}

TEST(ChartParetoTest, EqualPointsAreOnItTogetherAndOrderDoesNotMatter) {
  const std::vector<CostError> points{{3, 5}, {1, 10}, {3, 5}, {1, 12}, {3, 6}};
  EXPECT_EQ(ParetoFront(points), (std::vector<bool>{true, true, true, false, false}));
}

TEST(ChartParetoTest, ValuesThatAreNotFiniteNeitherWinNorBeat) {
  const std::vector<CostError> points{{NAN, 1}, {1, NAN}, {INFINITY, 0}, {2, 2}, {1, INFINITY}};
  EXPECT_EQ(ParetoFront(points), (std::vector<bool>{false, false, false, true, false}));
  EXPECT_TRUE(ParetoFront({}).empty());
}

TEST(ChartParetoTest, AgreesWithTheDefinition) {
  std::vector<CostError> points;
  for (uint32_t i = 0, state = 1; i < 200; ++i) {
    state = state * 1664525u + 1013904223u;
    points.push_back({static_cast<double>(state >> 28), static_cast<double>((state >> 20) & 15)});
  }
  const std::vector<bool> front = ParetoFront(points);
  for (size_t i = 0; i < points.size(); ++i) {
    const CostError& p = points[i];
    const bool beaten = std::any_of(points.begin(), points.end(), [&](const CostError& q) {
      return q.cost <= p.cost && q.error <= p.error && (q.cost < p.cost || q.error < p.error);
    });
    EXPECT_EQ(front[i], !beaten) << i;
  }
}

TEST(ChartSweepTest, EveryCombinationThatMattersOnce) {
  const auto points =
      Expand("shared,paper",
             {{"directions", "12,42"}, {"rays-per-kappa", "1,2,4"}, {"paper-rays", "8"}, {"lobes", "3,1,3"}});
  ASSERT_TRUE(points.ok()) << points.status().message();
  // paper knows nothing of rays per kappa.
  EXPECT_EQ(points->size(), 2u * 3 * 2 + 2 * 2);
  std::set<std::string> names;
  for (const Point& p : *points) names.insert(p.name);
  EXPECT_EQ(names.size(), points->size());
  EXPECT_EQ(points->front().name, "shared d12 r1 l3");
  EXPECT_EQ(points->back().name, "paper d42 l1");
  EXPECT_EQ(points->front().settings.bake.settings.grid_level, 0);
  EXPECT_EQ(points->back().settings.bake.settings.paper_rays, 8);
}

TEST(ChartSweepTest, DefaultsOfAllAxesCanBeUsed) {
  const auto points = Expand("shared,paper");
  ASSERT_TRUE(points.ok()) << points.status().message();
  EXPECT_GE(points->size(), 4u);
}

TEST(ChartSweepTest, ValuesHaveOneText) {
  const auto points =
      Expand("shared", {{"rays-per-kappa", "4,4.0,4e0"}, {"directions", "162"}, {"lobes", "1"}});
  ASSERT_TRUE(points.ok()) << points.status().message();
  EXPECT_EQ(points->size(), 1u);
  EXPECT_EQ(points->front().name, "shared");
}

TEST(ChartSweepTest, WrongValuesNameTheWord) {
  const std::vector<std::pair<std::string, std::string>> wrong{
      {"directions", "643"},    {"directions", ""},   {"directions", "162,"},  {"lobes", "0"},
      {"lobes", "5"},           {"lobes", "1.5"},     {"rays-per-kappa", "x"}, {"rays-per-kappa", "nan"},
      {"rays-per-kappa", "-1"}, {"tolerance", "inf"}, {"paper-rays", "8 "},    {"drop", "2"}};
  for (const auto& [word, value] : wrong) {
    const auto points = Expand("shared,paper", {{word, value}});
    ASSERT_FALSE(points.ok()) << word << " " << value;
    EXPECT_EQ(points.status().kind(), ErrorKind::kUsage);
    EXPECT_TRUE(Contains(points.status().message(), "--" + word)) << points.status().message();
  }
  EXPECT_TRUE(Contains(Expand("other").status().message(), "'other' is not one of shared, paper"));
  std::string many = "0";
  for (int i = 1; i <= 1000; ++i) many += "," + std::to_string(i / 1024.0);
  EXPECT_EQ(Expand("shared", {{"drop", many}}).status().kind(), ErrorKind::kUsage);
}

TEST(ChartTextTest, HtmlHoldsNoMarkupOfTheUsers) {
  EXPECT_EQ(EscapeHtml("<b a=\"1\" c='2'>&"), "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;");
  EXPECT_EQ(EscapeHtml("\xff"), "\xef\xbf\xbd") << "not UTF-8";
}

TEST(ChartTextTest, GnuplotStringsExpandNothingAndEndWhereTheyShould) {
  EXPECT_EQ(GnuplotQuote("it's `ls` @x \"$y\""), "'it''s `ls` @x \"$y\"'");
  EXPECT_EQ(GnuplotQuote("a\nsystem 'ls'"), "'a system ''ls'''");
}

TEST(ChartLabelTest, CrowdedNamesDoNotOverlap) {
  std::vector<LabelledPoint> points;
  for (int i = 0; i < 12; ++i) points.push_back({400.0 + i, 300.0 + (i % 3), 120, i % 2 == 0});
  const LabelFrame frame{.left = 0, .bottom = 0, .right = 1000, .top = 700, .text_height = 14};
  const std::vector<LabelPlace> places = PlaceLabels(points, frame);
  ASSERT_EQ(places.size(), points.size());
  for (size_t i = 0; i < places.size(); ++i) {
    EXPECT_GE(places[i].x, 0);
    EXPECT_LE(places[i].x + 120, 1000);
    for (size_t j = 0; j < i; ++j) {
      const bool apart =
          std::abs(places[i].x - places[j].x) > 119.9 || std::abs(places[i].y - places[j].y) > 13.9;
      EXPECT_TRUE(apart) << i << " " << j;
    }
  }
}

template <class T>
T Must(Result<T> result) {
  if (!result.ok()) throw std::runtime_error(result.status().message());
  return std::move(result).value();
}

/// A scene, light and two points that take a fraction of a second.
class ChartMeasureTest : public testing::Test {
 protected:
  ChartMeasureTest()
      : scene_(Must(GenerateScene("planes", {500, 32}))),
        environment_(Must(Environment::Procedural("sunset", 32))),
        points_(Must(
            Expand("shared,paper",
                   {{"directions", "12"}, {"rays-per-kappa", "1"}, {"paper-rays", "4"}, {"lobes", "1"}}))) {
    for (Point& point : points_) point.settings.bake.max_layers = 1;
  }
  ~ChartMeasureTest() override { ClearStop(); }

  Input MakeInput() const {
    Input input{.scene = scene_,
                .environment = environment_,
                .scene_name = "planes",
                .environment_name = "sunset",
                .view = {},
                .reference = {},
                .tone = {}};
    input.view.camera = scene_.cameras.at(0);
    input.view.width = 24;
    input.view.height = 20;
    input.reference.samples = 4;
    input.reference.bounces = 1;
    input.samples = 1;
    input.threads = 2;
    return input;
  }
  Measured MeasureOk(const Input& input) {
    Result<Measured> measured = Measure(input, points_, folder_.path());
    EXPECT_TRUE(measured.ok()) << measured.status().message();
    return measured.ok() ? std::move(measured).value() : Measured();
  }
  static size_t Kept(const Measured& measured) {
    return static_cast<size_t>(std::count_if(measured.points.begin(), measured.points.end(),
                                             [](const MeasuredPoint& p) { return p.kept; }));
  }

  const TempFolder folder_;
  Scene scene_;
  Environment environment_;
  std::vector<Point> points_;
};

TEST_F(ChartMeasureTest, TheSecondRunComputesNothingAndFindsTheSame) {
  const Measured first = MeasureOk(MakeInput());
  ASSERT_EQ(first.points.size(), 2u);
  EXPECT_EQ(Kept(first), 0u);
  EXPECT_FALSE(first.reference.kept);
  EXPECT_FALSE(fs::exists(folder_ / "work"));
  const Measured second = MeasureOk(MakeInput());
  EXPECT_EQ(Kept(second), 2u);
  EXPECT_TRUE(second.reference.kept);
  for (size_t i = 0; i < 2; ++i) {
    const MeasuredPoint &a = first.points[i], &b = second.points[i];
    EXPECT_GT(a.seconds, 0);
    EXPECT_GT(a.bytes, 0);
    EXPECT_GT(a.blocks.rel_mse, 0);
    EXPECT_EQ(a.seconds, b.seconds);
    EXPECT_EQ(a.bytes, b.bytes);
    EXPECT_EQ(a.measured_at, b.measured_at);
    EXPECT_EQ(a.blocks.rel_mse, b.blocks.rel_mse);
    EXPECT_EQ(a.pixels.flip, b.pixels.flip);
    EXPECT_TRUE(a.picture.pixels == b.picture.pixels);
  }
}

TEST_F(ChartMeasureTest, AFurtherPointIsTheOnlyOneComputed) {
  MeasureOk(MakeInput());
  points_.push_back(points_[0]);
  points_.back().settings.bake.settings.rays_per_kappa = 2;
  EXPECT_EQ(Kept(MeasureOk(MakeInput())), 2u);
  // Another reference costs no bake.
  Input input = MakeInput();
  input.reference.samples = 8;
  const Measured measured = MeasureOk(input);
  EXPECT_EQ(Kept(measured), 3u);
  EXPECT_FALSE(measured.reference.kept);
}

TEST_F(ChartMeasureTest, DamagedRecordsAreComputedAgain) {
  const Measured first = MeasureOk(MakeInput());
  const fs::path numbers = folder_ / "points" / (first.points[0].key.Hex() + ".json");
  const fs::path picture = folder_ / "points" / (first.points[1].key.Hex() + ".exr");
  const std::string good = ReadText(numbers);
  size_t seconds = good.find("\"seconds\": ");
  ASSERT_NE(seconds, std::string::npos);
  std::string other = good;
  other[seconds + 11] = other[seconds + 11] == '9' ? '8' : '9';
  for (const std::string& damaged : {other, good.substr(0, good.size() / 2), std::string("[]")}) {
    std::ofstream(numbers, std::ios::binary) << damaged;
    const Measured again = MeasureOk(MakeInput());
    EXPECT_EQ(Kept(again), 1u) << damaged;
    EXPECT_FALSE(again.points[0].kept);
  }
  fs::resize_file(picture, fs::file_size(picture) - 1);
  EXPECT_EQ(Kept(MeasureOk(MakeInput())), 1u);
  fs::remove(picture);
  EXPECT_EQ(Kept(MeasureOk(MakeInput())), 1u);
  EXPECT_EQ(Kept(MeasureOk(MakeInput())), 2u);
}

TEST_F(ChartMeasureTest, AStopKeepsWhatIsFinished) {
  const std::vector<Point> both = points_;
  points_.pop_back();
  MeasureOk(MakeInput());
  points_ = both;
  RequestStop();
  const Result<Measured> stopped = Measure(MakeInput(), points_, folder_.path());
  ASSERT_FALSE(stopped.ok());
  EXPECT_EQ(stopped.status().kind(), ErrorKind::kInterrupted);
  EXPECT_TRUE(Contains(stopped.status().message(), "1 of 2 points")) << stopped.status().message();
  ClearStop();
  EXPECT_EQ(Kept(MeasureOk(MakeInput())), 1u);
}

TEST_F(ChartMeasureTest, WorkOfAKilledRunIsNotUsed) {
  fs::create_directories(folder_ / "work/point.glint.work");
  std::ofstream(folder_ / "work/point.glint") << "half an archive";
  EXPECT_EQ(Kept(MeasureOk(MakeInput())), 0u);
  EXPECT_FALSE(fs::exists(folder_ / "work"));
}

TEST_F(ChartMeasureTest, KeysChangeWithEverythingThatMatters) {
  const Point& point = points_[0];
  const Digest key = PointKey(MakeInput(), point), reference = ReferenceKey(MakeInput());
  const std::vector<std::function<void(Settings&)>> settings{
      [](Settings& s) { s.bake.settings.grid_level = 1; },
      [](Settings& s) { s.bake.settings.rays_per_kappa = 3; },
      [](Settings& s) { s.bake.settings.max_rays = 999; },
      [](Settings& s) { s.bake.settings.drop = 0.5f; },
      [](Settings& s) { s.bake.settings.seed = 9; },
      [](Settings& s) { s.bake.settings.fit.max_lobes = 2; },
      [](Settings& s) { s.bake.settings.fit.tolerance = 0.5f; },
      [](Settings& s) { s.bake.max_layers = 2; },
      [](Settings& s) { s.bake.layer_tolerance = 0.5f; },
      [](Settings& s) { s.bake.target.tolerance = 0.5f; },
      [](Settings& s) { s.bake.table_form = TableForm::kClassic; }};
  std::set<Digest> keys{key, PointKey(MakeInput(), points_[1])};
  for (const auto& change : settings) {
    Point changed = point;
    change(changed.settings);
    keys.insert(PointKey(MakeInput(), changed));
  }
  EXPECT_EQ(keys.size(), settings.size() + 2);

  const std::vector<std::function<void(Input&)>> sights{
      [](Input& i) { i.view.camera.eye.x += 1; }, [](Input& i) { i.view.camera.vertical_fov = 0.1f; },
      [](Input& i) { i.view.width = 25; }, [](Input& i) { i.view.environment_rotation_deg = 1; },
      [](Input& i) { i.view.background = Background::kEnvironment; }};
  std::set<Digest> references{reference};
  for (const auto& change : sights) {
    Input input = MakeInput();
    change(input);
    keys.insert(PointKey(input, point));
    references.insert(ReferenceKey(input));
  }
  EXPECT_EQ(keys.size(), settings.size() + 2 + sights.size());
  EXPECT_EQ(references.size(), 1 + sights.size());

  // What only one of the two depends on; names and tone curves neither.
  const auto changed = [this](const std::function<void(Input&)>& change) {
    Input input = MakeInput();
    change(input);
    return input;
  };
  EXPECT_NE(PointKey(changed([](Input& i) { i.samples = 2; }), point), key);
  const Input one_thread = changed([](Input& i) { i.threads = 1; });
  EXPECT_NE(PointKey(one_thread, point), key) << "seconds depend on threads";
  EXPECT_EQ(ReferenceKey(one_thread), reference);
  for (const auto& change : std::vector<std::function<void(Input&)>>{
           [](Input& i) { i.reference.lobes = true; }, [](Input& i) { i.reference.samples = 6; },
           [](Input& i) { i.reference.seed = 2; }, [](Input& i) { i.reference.bounces = 0; }}) {
    EXPECT_EQ(PointKey(changed(change), point), key);
    EXPECT_NE(ReferenceKey(changed(change)), reference);
  }
  const Input renamed = changed([](Input& i) {
    i.scene_name = i.environment_name = i.view.camera.name = "other";
    i.tone.exposure = 2;
  });
  EXPECT_EQ(PointKey(renamed, point), key);
  EXPECT_EQ(ReferenceKey(renamed), reference);
  const Environment other = Must(Environment::Procedural("studio", 32));
  const Input elsewhere{.scene = scene_,
                        .environment = other,
                        .scene_name = "",
                        .environment_name = "",
                        .view = MakeInput().view,
                        .reference = MakeInput().reference,
                        .samples = 1,
                        .tone = {},
                        .threads = 2};
  EXPECT_NE(PointKey(elsewhere, point), key);
  EXPECT_NE(ReferenceKey(elsewhere), reference);
}

TEST_F(ChartMeasureTest, WithoutGnuplotTheRestIsWritten) {
  Input input = MakeInput();
  input.scene_name = "<script>alert('x')</script>.glb";
  const Measured measured = MeasureOk(input);
  std::ofstream(folder_ / "error_over_bytes.svg") << "of an earlier run";
  const Status status = Publish(input, measured, folder_.path(), (folder_ / "no-such-gnuplot").string());
  EXPECT_EQ(status.kind(), ErrorKind::kIo);
  EXPECT_TRUE(Contains(status.message(), "gnuplot-nox")) << status.message();
  EXPECT_FALSE(fs::exists(folder_ / "error_over_bytes.svg"));
  EXPECT_FALSE(fs::exists(folder_ / "plot-work"));

  const std::string page = ReadText(folder_ / "index.html");
  EXPECT_FALSE(Contains(page, "<script"));
  EXPECT_TRUE(Contains(page, "&lt;script&gt;"));
  EXPECT_TRUE(Contains(page, "was not drawn"));
  EXPECT_FALSE(Contains(page, "http")) << "the page needs nothing else";
  EXPECT_TRUE(Contains(page, "data:image/png;base64,"));
  const auto json = nlohmann::json::parse(ReadText(folder_ / "chart.json"));
  ASSERT_EQ(json["points"].size(), 2u);
  EXPECT_EQ(json["points"][0]["rel_mse_block4"], measured.points[0].blocks.rel_mse);
  const std::string csv = ReadText(folder_ / "chart.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  const std::string head = csv.substr(0, csv.find('\n')), line = csv.substr(csv.find('\n') + 1);
  EXPECT_EQ(std::count(head.begin(), head.end(), ','),
            std::count(line.begin(), line.begin() + static_cast<long>(line.find('\n')), ','));
}

TEST_F(ChartMeasureTest, AProgramThatFailsIsSaid) {
  const Measured measured = MeasureOk(MakeInput());
  const Status status = Publish(MakeInput(), measured, folder_.path(), "false");
  EXPECT_EQ(status.kind(), ErrorKind::kIo);
  EXPECT_TRUE(Contains(status.message(), "exit code 1")) << status.message();
  EXPECT_TRUE(fs::exists(folder_ / "index.html"));
}

// gnuplot is one of the packages that Glint's tests need.
TEST_F(ChartMeasureTest, GnuplotDrawsEvenHostileNames) {
  Input input = MakeInput();
  input.scene_name = "it's a \"test\" `touch x` $(touch x)\n@a _b ^c {d} \\ \xff.glb";
  const Measured measured = MeasureOk(input);
  const Status status = Publish(input, measured, folder_.path());
  ASSERT_TRUE(status.ok()) << status.message();
  for (const char* name : {"error_over_seconds", "error_over_bytes"}) {
    const std::string svg = ReadText(folder_ / (std::string(name) + ".svg"));
    EXPECT_TRUE(Contains(svg, "<svg") && Contains(svg, "</svg>"));
    EXPECT_TRUE(Contains(svg, "shared")) << "points are named";
    EXPECT_TRUE(Contains(svg, "`touch x`"));
    EXPECT_EQ(ReadText(folder_ / (std::string(name) + ".png")).rfind("\x89PNG", 0), 0u);
  }
  EXPECT_TRUE(Contains(ReadText(folder_ / "index.html"), "data:image/svg+xml;base64,"));
  EXPECT_FALSE(fs::exists(folder_ / "plot-work"));
}

TEST(ChartPlotTest, PointsWithoutAPlaceOnALogarithmicAxisAreLeftOut) {
  const TempFolder folder;
  PlotInput plot{
      "p", "t", "x", "y", {{"a", "m", 1, 0, true}, {"b", "m", -1, 1, false}, {"c", "m", NAN, 1, false}}};
  EXPECT_TRUE(DrawPlot(plot, folder.path(), "gnuplot").ok()) << "nothing to draw";
  plot.points.push_back({"d", "m", 2, 3, true});
  const Result<PlotFiles> one = DrawPlot(plot, folder.path(), "gnuplot");
  ASSERT_TRUE(one.ok()) << one.status().message();
  EXPECT_TRUE(Contains(one->svg, ">d<") || Contains(one->svg, "d</tspan>")) << one->svg;
}

}  // namespace
}  // namespace glint::chart
