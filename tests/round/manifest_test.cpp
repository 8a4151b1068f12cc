#include "common/round/manifest.h"

#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/round/round_files.h"
#include "tests/base/temp_folder.h"

namespace glint {
namespace {

using Json = nlohmann::ordered_json;

std::span<const std::byte> Bytes(const std::string& text) { return std::as_bytes(std::span(text)); }

RoundManifest Example() {
  RoundManifest manifest;
  manifest.execution = "glint 0.1.0; \"quoted\"";
  manifest.scene = Sha256({});
  manifest.settings.method = GatherMethod::kPaper;
  manifest.settings.grid_level = 1;
  manifest.settings.rays_per_kappa = 0.1f;  // not a short binary fraction: digits have to suffice
  manifest.settings.drop = 1.0f / 3;
  manifest.settings.slice_lobes = 3;
  manifest.settings.lobe_tolerance = 0.3f;
  manifest.settings.seed = ~uint64_t{0};
  manifest.layer = 2;
  manifest.previous = Sha256(Bytes("layer 1"));
  manifest.blocks = {{0, 100, 0, 42}, {100, 7, 0, 20}, {100, 7, 20, 22}};
  return manifest;
}

TEST(RoundManifestTest, SurvivesItsJson) {
  const RoundManifest written = Example();
  const Result<RoundManifest> read = ParseRoundManifest(Bytes(ToJson(written)));
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_EQ(ToJson(*read), ToJson(written));
  EXPECT_EQ(read->Bake(), written.Bake());  // hashes every field of the settings
  EXPECT_EQ(read->InputKey(), written.InputKey());
  ASSERT_EQ(read->blocks.size(), 3u);
  EXPECT_EQ(read->Task(2).key, written.Task(2).key);
  EXPECT_EQ(read->Task(2).layer, 2);
  EXPECT_EQ(read->Task(2).block.first_column, 20u);
}

TEST(RoundManifestTest, KeysDependOnWhatTheTasksDependOn) {
  const RoundManifest base = Example();
  const auto changed = [&](const std::function<void(RoundManifest&)>& change) {
    RoundManifest other = base;
    change(other);
    return other.Task(0).key != base.Task(0).key;
  };
  EXPECT_FALSE(changed([](RoundManifest& m) { m.blocks.pop_back(); }));
  EXPECT_TRUE(changed([](RoundManifest& m) { m.execution += "x"; }));
  EXPECT_TRUE(changed([](RoundManifest& m) { m.scene.bytes[0] ^= 1; }));
  EXPECT_TRUE(changed([](RoundManifest& m) { m.settings.seed = 2; }));
  EXPECT_TRUE(changed([](RoundManifest& m) { m.layer = 1; }));
  EXPECT_TRUE(changed([](RoundManifest& m) { m.previous.bytes[31] ^= 1; }));
  EXPECT_TRUE(changed([](RoundManifest& m) { m.blocks[0].vertices = 99; }));
}

TEST(RoundManifestTest, NamesTheFieldThatIsWrong) {
  const auto message = [](const std::function<void(Json&)>& change) {
    Json json = Json::parse(ToJson(Example()));
    change(json);
    const Result<RoundManifest> read = ParseRoundManifest(Bytes(json.dump()));
    EXPECT_FALSE(read.ok());
    EXPECT_EQ(read.status().kind(), ErrorKind::kBadInput);
    return read.status().message();
  };
  for (const char* name : {"version", "execution", "scene", "settings", "layer", "previous", "tasks"}) {
    const auto has_name = [&](const std::string& text) { return text.find(name) != std::string::npos; };
    EXPECT_PRED1(has_name, message([&](Json& json) { json.erase(name); }));
    EXPECT_FALSE(message([&](Json& json) { json[name] = true; }).empty());
  }
  EXPECT_NE(message([](Json& j) { j["version"] = 2; }).find("version"), std::string::npos);
  EXPECT_NE(message([](Json& j) { j["layer"] = 256; }).find("layer"), std::string::npos);
  EXPECT_NE(message([](Json& j) { j["scene"] = "../../etc/passwd"; }).find("scene"), std::string::npos);
  EXPECT_NE(message([](Json& j) { j["settings"]["drop"] = -0.5; }).find("drop"), std::string::npos);
  EXPECT_NE(message([](Json& j) { j["settings"]["grid_level"] = 1e300; }).find("grid_level"),
            std::string::npos);
  EXPECT_NE(message([](Json& j) { j["settings"]["max_rays"] = uint64_t{1} << 40; }).find("max_rays"),
            std::string::npos);
  EXPECT_NE(message([](Json& j) { j["settings"]["seed"] = -1; }).find("seed"), std::string::npos);
  for (const Json& block : {Json{0, 100, 0, 43}, Json{0, 0, 0, 42}, Json{0, 1, 42, 1}, Json{0, 1, 0},
                            Json{4294967295u, 1, 0, 1}, Json{1, 4294967295u, 0, 1}, Json{-1, 1, 0, 1}})
    EXPECT_NE(message([&](Json& j) { j["tasks"][1] = block; }).find("task 1"), std::string::npos) << block;
}

TEST(RoundManifestTest, RefusesWhatIsNoManifest) {
  const std::string whole = ToJson(Example());
  for (size_t length = 0; length < whole.size() - 2; length += 7)
    EXPECT_FALSE(ParseRoundManifest(Bytes(whole.substr(0, length))).ok()) << length;
  EXPECT_FALSE(ParseRoundManifest(Bytes(std::string(100'000, '['))).ok());
}

TEST(RoundFilesTest, FindsManifestsByContent) {
  const TempFolder folder;
  const Result<Digest> name = WriteManifest(folder.path(), Example());
  ASSERT_TRUE(name.ok()) << name.status().message();
  EXPECT_TRUE(ReadManifest(folder.path(), *name).ok());

  const std::string other = ToJson(RoundManifest{Example()}) + " ";
  ASSERT_TRUE(PublishFile(ManifestPath(folder.path(), *name), Bytes(other)).ok());
  const Result<RoundManifest> read = ReadManifest(folder.path(), *name);
  ASSERT_FALSE(read.ok());
  EXPECT_NE(read.status().message().find(name->Hex()), std::string::npos);
}

}  // namespace
}  // namespace glint
