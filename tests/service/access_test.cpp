#include "coordinator/service/access.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/base/temp_folder.h"

namespace glint {
namespace {

TEST(TokenListTest, KnowsClientsByTheirTokens) {
  const Result<std::string> alice = MakeToken(), bob = MakeToken();
  ASSERT_TRUE(alice.ok() && bob.ok());
  EXPECT_EQ(alice->size(), 64u);
  EXPECT_NE(*alice, *bob);
  const std::string text = "# clients\n\n" + TokenLine("alice", Right::kSubmit, *alice) +
                           "  # since May\n  " + TokenLine("bob@example.org", Right::kAdmin, *bob) + "\n";
  EXPECT_EQ(text.find(*alice), std::string::npos) << "the file has no token in it";
  const Result<TokenList> list = TokenList::Parse(text);
  ASSERT_TRUE(list.ok()) << list.status().message();
  ASSERT_TRUE(list->Find(*alice));
  EXPECT_EQ(list->Find(*alice)->name, "alice");
  EXPECT_EQ(list->Find(*alice)->right, Right::kSubmit);
  ASSERT_TRUE(list->Find(*bob));
  EXPECT_EQ(list->Find(*bob)->right, Right::kAdmin);

  std::string near = *alice;
  near.back() = near.back() == '0' ? '1' : '0';
  const std::string digest = text.substr(text.find("submit ") + 7, 64);
  for (const std::string& wrong : {std::string(), near, alice->substr(0, 63), *alice + " ", digest})
    EXPECT_FALSE(list->Find(wrong)) << wrong;
}

TEST(TokenListTest, NamesTheLineThatIsWrong) {
  const std::string digest(64, 'a'), good = "alice read " + digest + "\n";
  for (const std::string& wrong :
       {"alice " + digest, "alice write " + digest, "alice read " + digest.substr(1),
        "alice read " + digest + " x", "al/ice read " + digest, std::string(65, 'n') + " read " + digest,
        "bob admin " + digest}) {
    const Result<TokenList> list = TokenList::Parse(good + "\n" + wrong);
    ASSERT_FALSE(list.ok()) << wrong;
    EXPECT_EQ(list.status().kind(), ErrorKind::kBadInput);
    EXPECT_NE(list.status().message().find("line 3"), std::string::npos) << list.status().message();
  }
  EXPECT_FALSE(TokenList::Parse("# nobody\n").ok()) << "a file that lets nobody in is a mistake";
}

TEST(TokenFileTest, HoldsOneToken) {
  const TempFolder folder;
  const auto read = [&](const std::string& text) {
    std::ofstream(folder / "token") << text;
    return ReadToken(folder / "token");
  };
  EXPECT_EQ(*read("abc\n"), "abc");
  EXPECT_EQ(read("").status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(read("abc\ndef\n").status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(ReadToken(folder / "absent").status().kind(), ErrorKind::kBadInput);
  const Result<TokenList> absent = TokenList::Read(folder / "absent");
  EXPECT_NE(absent.status().message().find("absent"), std::string::npos) << absent.status().message();
}

}  // namespace
}  // namespace glint
