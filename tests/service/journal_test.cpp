#include "coordinator/service/journal.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/base/temp_folder.h"

namespace glint {
namespace {

JournalEntry Example(const std::string& id) {
  JournalEntry entry;
  entry.id = id;
  entry.request.key = "mine; DROP TABLE bakes";
  entry.request.scene = Sha256({});
  entry.request.name = "goblets \"1\".glb";
  entry.request.settings.drop = 1.0f / 3;
  entry.request.max_layers = 3;
  entry.request.layer_tolerance = 0.1f;
  entry.request.table_form = TableForm::kClassic;
  entry.request.vertices_per_task = 64;
  entry.request.priority = 7;
  entry.state = BakeState::kFailed;
  entry.error = LimitExceeded("too large: 'x'");
  entry.bake_key = std::string(64, 'a');
  entry.submitted_unix = 1'700'000'000;
  return entry;
}

TEST(JournalTest, KeepsEntriesOverProcesses) {
  const TempFolder folder;
  {
    Result<Journal> journal = Journal::Open(folder / "j.sqlite");
    ASSERT_TRUE(journal.ok()) << journal.status().message();
    for (const char* id : {"b", "a", "c"}) ASSERT_TRUE(journal->Put(Example(id)).ok());
    JournalEntry changed = Example("a");
    changed.state = BakeState::kDone;
    changed.error = {};
    ASSERT_TRUE(journal->Put(changed).ok());
    ASSERT_TRUE(journal->Remove("c").ok());
    ASSERT_TRUE(journal->Remove("c").ok()) << "may be repeated";
  }
  const Result<Journal> journal = Journal::Open(folder / "j.sqlite");
  ASSERT_TRUE(journal.ok()) << journal.status().message();
  const Result<std::vector<JournalEntry>> entries = journal->Load();
  ASSERT_TRUE(entries.ok()) << entries.status().message();
  ASSERT_EQ(entries->size(), 2u);
  const JournalEntry &first = (*entries)[0], &second = (*entries)[1], expected = Example("b");
  EXPECT_EQ(first.id, "b");
  EXPECT_EQ(ToJson(first.request), ToJson(expected.request));
  EXPECT_EQ(first.error.kind(), ErrorKind::kLimit);
  EXPECT_EQ(first.error.message(), expected.error.message());
  EXPECT_EQ(first.bake_key, expected.bake_key);
  EXPECT_EQ(first.submitted_unix, expected.submitted_unix);
  EXPECT_EQ(second.id, "a");
  EXPECT_EQ(second.state, BakeState::kDone);
  EXPECT_TRUE(second.error.ok());
}

TEST(JournalTest, RefusesOtherFiles) {
  const TempFolder folder;
  std::ofstream(folder / "j.sqlite") << std::string(10'000, 'x');
  const Result<Journal> journal = Journal::Open(folder / "j.sqlite");
  ASSERT_FALSE(journal.ok());
  EXPECT_EQ(journal.status().kind(), ErrorKind::kBadInput);
  EXPECT_NE(journal.status().message().find("j.sqlite"), std::string::npos) << journal.status().message();
}

TEST(BakeRequestTest, NamesTheFieldThatIsWrong) {
  const nlohmann::json sound = nlohmann::json::parse(ToJson(Example("a").request));
  ASSERT_TRUE(ParseRequest(sound.dump()).ok());
  for (const auto& [name, value] : sound.items()) {
    for (const nlohmann::json& wrong :
         {nlohmann::json(), nlohmann::json(-1), nlohmann::json(std::string(300, 'x'))}) {
      nlohmann::json changed = sound;
      changed[name] = wrong;
      const Result<BakeRequest> parsed = ParseRequest(changed.dump());
      ASSERT_FALSE(parsed.ok()) << name << " " << wrong;
      EXPECT_EQ(parsed.status().kind(), ErrorKind::kBadInput);
    }
    nlohmann::json without = sound;
    without.erase(name);
    EXPECT_FALSE(ParseRequest(without.dump()).ok()) << name;
  }
  EXPECT_FALSE(ParseRequest("").ok());
  EXPECT_FALSE(ParseRequest("[]").ok());
}

}  // namespace
}  // namespace glint
