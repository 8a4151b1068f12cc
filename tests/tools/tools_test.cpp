// The program as a user or a script meets it: words, exit codes, what goes to which stream, the whole way.

#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tests/base/process.h"
#include "tests/base/temp_folder.h"

namespace glint {
namespace {

ProcessResult Glint(std::vector<std::string> words, const std::vector<std::string>& environment = {}) {
  words.insert(words.begin(), GLINT_PROGRAM);
  return RunProcess(words, environment);
}

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

std::string ReadText(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

const char* const kCommands[] = {"bake",    "render", "reference", "compare", "chart",
                                 "inspect", "verify", "estimate",  "scene",   "environment"};

TEST(ToolsHelpTest, HelpShowsCommandsExamplesAndExitCodes) {
  const ProcessResult result = Glint({"--help"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.err, "");
  for (const char* command : kCommands) EXPECT_TRUE(Contains(result.out, command)) << command;
  EXPECT_TRUE(Contains(result.out, "Examples:")) << result.out;
  EXPECT_TRUE(Contains(result.out, "Exit codes:")) << result.out;
}

TEST(ToolsHelpTest, EveryCommandHasHelpWithExamples) {
  for (const char* command : kCommands) {
    const ProcessResult result = Glint({command, "--help"});
    EXPECT_EQ(result.exit_code, 0) << command;
    EXPECT_TRUE(Contains(result.out, "Examples:\n  glint " + std::string(command))) << result.out;
    for (const char* word : {"--threads", "--quiet", "--json"})
      EXPECT_TRUE(Contains(result.out, word)) << command;
  }
}

TEST(ToolsHelpTest, VersionIsOneLine) {
  const ProcessResult result = Glint({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.out, "glint " GLINT_VERSION "\n");
}

TEST(ToolsExitCodeTest, WrongWordsAreUsage) {
  const TempFolder folder;
  const std::string out = (folder / "x.exr").string();
  std::filesystem::create_directories(folder / "folder.png");
  std::filesystem::create_directories(folder / "folder.glint");
  const std::vector<std::vector<std::string>> wrong{
      {},
      {"polish"},
      {"--no-such-word"},
      {"verify", "--no-such-word"},
      {"verify"},
      {"estimate"},
      {"estimate", "a.glint", "--slices", "0"},
      {"bake", "a.glb", "-o", (folder / "a.glint").string(), "--estimate", "-1"},
      {"render", "a.glint"},
      {"render", "a.glint", "-o", out, "--size", "10"},
      {"render", "a.glint", "-o", out, "--size", "0x10"},
      {"render", "a.glint", "-o", out, "--eye", "1,2"},
      {"render", "a.glint", "-o", out, "--eye", "1,2,nan"},
      {"render", "a.glint", "-o", out, "--eye", "1,2,1.1e15"},
      {"render", "a.glint", "-o", out, "--eye", "1,2,3", "--look-at", "-2e15,0,0"},
      {"render", "a.glint", "-o", out, "--look-at", "1,2,3"},
      {"render", "a.glint", "-o", out, "--camera", "a", "--eye", "1,2,3"},
      {"render", "a.glint", "-o", out, "--layer", "1", "--layers", "2"},
      {"render", "a.glint", "-o", out, "--background", "blue"},
      {"render", "a.glint", "-o", out, "--tone", "filmic"},
      {"render", "a.glint", "-o", (folder / "x.jpg").string()},
      {"render", "a.glint", "-o", (folder / "absent/x.png").string()},
      {"render", "a.glint", "-o", (folder / "folder.png").string()},
      {"render", "a.glint", "-o", out, "--samples", "4097"},
      {"bake", "a.glb", "-o", (folder / "folder.glint").string()},
      {"bake", "a.glb", "-o", (folder / "a.glint").string(), "--layers", "256"},
      {"reference", "a.glb", "-o", out, "--spp", "3"},
      {"reference", "a.glb", "-o", out, "--bounces", "-1"},
      {"reference", "a.glb", "-o", out, "--brdf", "other"},
      {"bake", "a.glb", "-o", (folder / "a.glint").string(), "--directions", "643"},
      {"bake", "a.glb", "-o", out},
      {"chart", "a.glb"},
      {"chart", "a.glb", "-o", out, "--directions", "162,643"},
      {"chart", "a.glb", "-o", out, "--gather", "shared,other"},
      {"chart", "a.glb", "-o", out, "--lobes", "1,,3"},
      {"chart", "a.glb", "-o", out, "--spp", "3"},
      {"chart", "a.glb", "-o", GLINT_PROGRAM},
      {"scene", "no-such-scene", "-o", (folder / "a.glb").string()},
      {"scene", "teapot"},
      {"scene"},
      {"environment", "no-such-sky", "-o", out},
  };
  for (const auto& words : wrong) {
    const ProcessResult result = Glint(words);
    std::string line = "glint";
    for (const std::string& word : words) line += " " + word;
    EXPECT_EQ(result.exit_code, 2) << line << "\n" << result.err;
    EXPECT_EQ(result.out, "") << line;
    EXPECT_EQ(result.err.rfind("error: ", 0), 0u) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  }
  EXPECT_EQ(folder.FileCount(), 0u);
}

TEST(ToolsExitCodeTest, WordsOfNumbersTakeFiniteNumbersInTheirRange) {
  const TempFolder folder;
  const std::string picture = (folder / "x.png").string();
  const std::vector<std::string> bake{"bake", "a.glb", "-o", (folder / "a.glint").string()};
  const std::vector<std::string> render{"render", "a.glint", "-o", picture};
  const std::vector<std::string> compare{"compare", "a.exr", "b.exr"};
  const std::vector<std::string> scene{"scene", "planes", "-o", (folder / "a.glb").string()};
  const std::vector<std::pair<std::vector<std::string>, std::string>> words{
      {bake, "--tolerance"},   {bake, "--rays-per-kappa"}, {bake, "--fit-tolerance"},
      {bake, "--drop"},        {render, "--fov"},          {render, "--env-rotate"},
      {render, "--exposure"},  {compare, "--max-rel-mse"}, {compare, "--max-flip"},
      {compare, "--exposure"}, {scene, "--exponent"},
  };
  for (const auto& [command, word] : words) {
    for (const char* value : {"nan", "NAN", "-nan", "inf", "-inf", "-1e30", "1e999", "", "1x"}) {
      std::vector<std::string> line = command;
      line.push_back(word + "=" + value);
      const ProcessResult result = Glint(line);
      EXPECT_EQ(result.exit_code, 2) << word << " " << value << "\n" << result.err;
      EXPECT_TRUE(Contains(result.err, word)) << result.err;
    }
  }
  EXPECT_EQ(folder.FileCount(), 0u);
}

TEST(ToolsExitCodeTest, AWrongCommandIsNamed) {
  for (const char* word : {"frobnicate", "help", "--no-such-word"})
    EXPECT_TRUE(Contains(Glint({word}).err, "'" + std::string(word) + "'")) << Glint({word}).err;
}

TEST(ToolsExitCodeTest, MissingAndDamagedFilesAreBadInput) {
  const TempFolder folder;
  const std::string absent = (folder / "absent").string(), bad = (folder / "bad").string();
  const std::string out = (folder / "x.exr").string(), archive = (folder / "x.glint").string();
  std::ofstream(bad) << "this is neither a scene nor an archive nor a picture";
  for (const std::string& file : {absent, bad}) {
    const std::vector<std::vector<std::string>> commands{{"verify", file},
                                                         {"inspect", file},
                                                         {"render", file, "-o", out},
                                                         {"reference", file, "-o", out},
                                                         {"compare", file, file},
                                                         {"chart", file, "-o", (folder / "chart").string()},
                                                         {"bake", file, "-o", archive}};
    for (const auto& words : commands) {
      const ProcessResult result = Glint(words);
      EXPECT_EQ(result.exit_code, 3) << words[0] << " " << file << "\n" << result.err;
      EXPECT_TRUE(Contains(result.err, file)) << result.err;
    }
  }
}

TEST(ToolsListTest, ScenesAndSkiesAreListed) {
  EXPECT_TRUE(Contains(Glint({"scene", "--list"}).out, "teapot "));
  const auto scenes = nlohmann::json::parse(Glint({"scene", "--list", "--json"}).out);
  EXPECT_GE(scenes["scenes"].size(), 7u);
  EXPECT_TRUE(Contains(Glint({"environment", "--list"}).out, "sunset"));
}

TEST(ToolsListTest, EveryListedSkyCanBeWritten) {
  const TempFolder folder;
  for (const auto& sky :
       nlohmann::json::parse(Glint({"environment", "--list", "--json"}).out)["environments"]) {
    const std::string out = (folder / (sky["name"].get<std::string>() + ".exr")).string();
    EXPECT_EQ(Glint({"environment", sky["name"], "--width", "32", "-o", out}).exit_code, 0) << sky;
    EXPECT_TRUE(std::filesystem::exists(out));
  }
}

// One small bake, looked at with every command.
TEST(ToolsWholeWayTest, SceneToArchiveToPicture) {
  const TempFolder folder;
  const std::string scene = (folder / "planes.glb").string(), archive = (folder / "planes.glint").string();
  const std::string picture = (folder / "planes.exr").string(), truth = (folder / "truth.exr").string();

  ASSERT_EQ(Glint({"scene", "planes", "--vertices", "500", "--exponent", "32", "-o", scene}).exit_code, 0);
  const ProcessResult bake =
      Glint({"bake", scene, "-o", archive, "--directions", "42", "--layers", "1", "--json"}, {"NO_COLOR=1"});
  ASSERT_EQ(bake.exit_code, 0) << bake.err;
  EXPECT_EQ(nlohmann::json::parse(bake.out)["directions"], 42);
  EXPECT_EQ(bake.err.find('\033'), std::string::npos) << "no animation off a terminal";
  EXPECT_FALSE(std::filesystem::exists(archive + ".work"));

  EXPECT_EQ(Glint({"verify", archive}).exit_code, 0);
  const auto inspected = nlohmann::json::parse(Glint({"inspect", archive, "--json"}).out);
  EXPECT_EQ(inspected["directions"], 42);
  EXPECT_EQ(inspected["layers"].size(), 2u);
  EXPECT_TRUE(inspected["report"].contains("seconds_by_stage"));
  EXPECT_TRUE(Contains(Glint({"inspect", archive}).out, "specular lobe 0"));
  EXPECT_TRUE(Contains(bake.err, "relative error of relit pictures: 0.")) << bake.err;

  const std::vector<std::string> view{"--camera", "main", "--size", "48x32"};
  const auto with_view = [&view](std::vector<std::string> words) {
    words.insert(words.end(), view.begin(), view.end());
    return words;
  };
  const ProcessResult render = Glint(with_view({"render", archive, "-o", picture, "--per-layer", "--quiet"}));
  ASSERT_EQ(render.exit_code, 0) << render.err;
  EXPECT_EQ(render.err, "");
  EXPECT_TRUE(std::filesystem::exists(folder / "planes.layer0.exr"));
  EXPECT_TRUE(std::filesystem::exists(folder / "planes.layer1.exr"));
  EXPECT_EQ(Glint(with_view({"render", archive, "-o", picture, "--layer", "7"})).exit_code, 2);
  EXPECT_EQ(Glint({"render", archive, "-o", picture, "--camera", "absent"}).exit_code, 2);
  EXPECT_EQ(Glint({"render", archive, "-o", picture, "--env", (folder / "no.exr").string()}).exit_code, 3);

  ASSERT_EQ(Glint(with_view({"reference", scene, "-o", truth, "--bounces", "1", "--spp", "16"})).exit_code,
            0);
  EXPECT_GT(nlohmann::json::parse(ReadText(truth + ".json"))["noise_rel_mse"], 0.0);

  const std::string difference = (folder / "difference.png").string();
  const ProcessResult compare = Glint({"compare", picture, truth, "--diff", difference, "--json"});
  EXPECT_EQ(compare.exit_code, 0) << compare.err;
  EXPECT_GT(nlohmann::json::parse(compare.out)["rel_mse"], 0.0);
  EXPECT_TRUE(std::filesystem::exists(difference));
  EXPECT_EQ(Glint({"compare", picture, truth, "--max-rel-mse", "0"}).exit_code, 7);
  EXPECT_EQ(Glint({"compare", truth, truth, "--max-rel-mse", "0"}).exit_code, 0);
}

/// A small archive that the tests below look at.
class ToolsArchiveTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(Glint({"scene", "planes", "--vertices", "500", "-o", scene_}).exit_code, 0);
    ASSERT_EQ(Bake({}).exit_code, 0);
  }
  ProcessResult Bake(std::vector<std::string> words) const {
    const std::vector<std::string> bake{"bake", scene_,       "-o",  archive_,  "--directions",
                                        "42",   "--max-rays", "256", "--layers"};
    words.insert(words.begin(), bake.begin(), bake.end());
    if (words.size() == bake.size()) words.push_back("0");
    return Glint(words);
  }

  const TempFolder folder_;
  const std::string scene_ = (folder_ / "planes.glb").string();
  const std::string archive_ = (folder_ / "planes.glint").string();
};

TEST_F(ToolsArchiveTest, VerifyTellsDamageFromOtherFiles) {
  ASSERT_EQ(Glint({"verify", archive_, "--threads", "2"}).exit_code, 0);
  std::fstream file(archive_, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(500);
  file << "damage";
  file.close();
  const ProcessResult damaged = Glint({"verify", archive_});
  EXPECT_EQ(damaged.exit_code, 7) << damaged.err;
  EXPECT_EQ(Glint({"inspect", archive_}).exit_code, 3);
  EXPECT_EQ(Glint({"verify", scene_}).exit_code, 3);
}

TEST_F(ToolsArchiveTest, InspectShowsNoForeignReport) {
  const std::string report = archive_ + ".json";
  const auto Inspected = [&] {
    const ProcessResult text = Glint({"inspect", archive_});
    EXPECT_EQ(text.exit_code, 0) << text.err;
    const ProcessResult result = Glint({"inspect", archive_, "--json"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return std::pair(nlohmann::json::parse(result.out)["report"], result.err);
  };
  const std::string own = ReadText(report);
  EXPECT_TRUE(Inspected().first.contains("seconds"));
  EXPECT_EQ(Inspected().second, "");
  auto other = nlohmann::json::parse(own);
  other["archive_key"] = std::string(64, '0');
  const std::string deep = own.substr(0, own.rfind('}')) + ",\"deep\":" + std::string(2000000, '[') +
                           std::string(2000000, ']') + "}";
  for (const std::string& text :
       {std::string(), std::string("[]"), std::string("7"), other.dump(), std::string(1000000, '['), deep}) {
    std::ofstream(report, std::ios::binary) << text;
    const auto [shown, notes] = Inspected();
    EXPECT_TRUE(shown.is_null());
    EXPECT_TRUE(Contains(notes, report)) << notes;
  }
  // The right key among values of wrong types.
  auto strange = nlohmann::json::parse(own);
  strange["layers"] = {{{"slices", "many"}}, 7, nullptr};
  strange["seconds"] = nlohmann::json::array({"x"});
  std::ofstream(report, std::ios::binary) << strange.dump();
  EXPECT_EQ(Inspected().first["seconds"][0], "x");
}

TEST_F(ToolsArchiveTest, LayersThatWouldCarryNothingAreNone) {
  const std::string picture = (folder_ / "p.exr").string(), all = (folder_ / "all.exr").string();
  const auto Render = [&](const std::string& out, std::vector<std::string> words) {
    words.insert(words.begin(), {"render", archive_, "-o", out, "--size", "24x24"});
    return Glint(words);
  };
  // Ended by --layers: what is above is not known.
  EXPECT_EQ(Render(picture, {"--layers", "1"}).exit_code, 2);
  EXPECT_EQ(Render(picture, {"--layer", "1"}).exit_code, 2);
  // Ended by the tolerance.
  ASSERT_EQ(Bake({"9", "--layer-tolerance", "1"}).exit_code, 0);
  ASSERT_EQ(Render(all, {}).exit_code, 0);
  const ProcessResult more = Render(picture, {"--layers", "7"});
  EXPECT_EQ(more.exit_code, 0) << more.err;
  EXPECT_TRUE(Contains(more.err, "layer 7 is not there")) << more.err;
  EXPECT_EQ(ReadText(picture), ReadText(all));
  EXPECT_EQ(Render(picture, {"--layer", "7"}).exit_code, 0);
  EXPECT_NE(ReadText(picture), ReadText(all));
}

TEST_F(ToolsArchiveTest, AnEstimateOfAsManySlicesIsTheReports) {
  ASSERT_EQ(Bake({"1", "--estimate", "40", "--seed", "7"}).exit_code, 0);
  const ProcessResult result = Glint({"estimate", archive_, "--slices", "40", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto estimate = nlohmann::json::parse(result.out);
  EXPECT_EQ(estimate["slices"], 40);
  EXPECT_EQ(estimate, nlohmann::json::parse(Glint({"inspect", archive_, "--json"}).out)["bake"]["error"]);
  const std::string shown = Glint({"inspect", archive_}).out;
  EXPECT_TRUE(Contains(shown, Glint({"estimate", archive_, "--slices", "40"}).out)) << shown;
  EXPECT_EQ(Glint({"estimate", scene_}).exit_code, 3);

  ASSERT_EQ(Bake({"1", "--estimate", "0"}).exit_code, 0);
  EXPECT_FALSE(nlohmann::json::parse(Glint({"inspect", archive_, "--json"}).out)["bake"].contains("error"));
}

TEST_F(ToolsArchiveTest, ExtensionsMayBeInCapitals) {
  const std::string picture = (folder_ / "P.PNG").string();
  EXPECT_EQ(Glint({"render", archive_, "-o", picture, "--size", "24x24"}).exit_code, 0);
  EXPECT_EQ(ReadText(picture).substr(1, 3), "PNG");
}

TEST_F(ToolsArchiveTest, ASceneNamedInAnotherEncodingIsBaked) {
  const std::string scene = (folder_ / "caf\xe9.glb").string(), out = (folder_ / "caf\xe9.glint").string();
  std::filesystem::rename(scene_, scene);
  EXPECT_EQ(Glint({"bake", scene, "-o", out, "--directions", "42", "--layers", "0", "--json"}).exit_code, 0);
  EXPECT_EQ(Glint({"inspect", out}).exit_code, 0);
}

// Interrupted, without gnuplot, with it: what is finished stays, and the exit code says what happened.
TEST(ToolsChartTest, GoesOnWhereItWas) {
  const TempFolder folder;
  const std::string scene = (folder / "planes.glb").string();
  const std::filesystem::path chart = folder / "new/chart";
  ASSERT_EQ(Glint({"scene", "planes", "--vertices", "500", "--exponent", "32", "-o", scene}).exit_code, 0);
  const std::vector<std::string> command{GLINT_PROGRAM,
                                         "chart",
                                         scene,
                                         "-o",
                                         chart.string(),
                                         "--size",
                                         "24x24",
                                         "--spp",
                                         "4",
                                         "--bounces",
                                         "1",
                                         "--gather",
                                         "shared,paper",
                                         "--directions",
                                         "12,42",
                                         "--lobes",
                                         "1",
                                         "--rays-per-kappa",
                                         "1",
                                         "--paper-rays",
                                         "4"};
  const auto records = [&chart] {
    size_t count = 0;
    std::error_code error;
    for (std::filesystem::directory_iterator i(chart / "points", error), end; !error && i != end;
         i.increment(error)) {
      count += i->path().extension() == ".json" && i->path().filename().string()[0] != '.';
    }
    return count;
  };
  const ProcessResult stopped = RunProcess(command, {}, {SIGINT, [&records] { return records() >= 2; }});
  EXPECT_EQ(stopped.exit_code, 5) << stopped.err;
  EXPECT_TRUE(Contains(stopped.err, "of 4 points are kept")) << stopped.err;
  EXPECT_FALSE(std::filesystem::exists(chart / "work"));
  const size_t before = records();
  EXPECT_GE(before, 2u);
  EXPECT_LT(before, 5u);

  const ProcessResult bare = RunProcess(command, {"PATH=" + folder.path().string()});
  EXPECT_EQ(bare.exit_code, 6) << bare.err;
  EXPECT_TRUE(Contains(bare.err, "gnuplot-nox")) << bare.err;
  EXPECT_TRUE(Contains(bare.out, "paper d42")) << bare.out;
  for (const char* name : {"chart.csv", "chart.json", "index.html"})
    EXPECT_TRUE(std::filesystem::exists(chart / name));
  EXPECT_FALSE(std::filesystem::exists(chart / "error_over_bytes.svg"));
  EXPECT_EQ(records(), 5u) << "the reference and four points";

  std::vector<std::string> as_json = command;
  as_json.insert(as_json.end(), {"--json", "--quiet"});
  const ProcessResult whole = RunProcess(as_json);
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  EXPECT_EQ(whole.err, "");
  const auto json = nlohmann::json::parse(whole.out);
  ASSERT_EQ(json["points"].size(), 4u);
  for (const auto& point : json["points"]) EXPECT_TRUE(point["kept"]) << point;
  for (const char* name : {"error_over_seconds", "error_over_bytes"}) {
    for (const char* extension : {".svg", ".png"}) {
      EXPECT_TRUE(std::filesystem::exists(chart / (std::string(name) + extension)));
    }
  }
}

}  // namespace
}  // namespace glint
