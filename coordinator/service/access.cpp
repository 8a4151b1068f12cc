#include "coordinator/service/access.h"

#include <openssl/crypto.h>
#include <openssl/rand.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <set>
#include <span>
#include <sstream>

#include "common/base/files.h"

namespace glint {
namespace {

constexpr uint64_t kMaxFileBytes = 1 << 20;
constexpr size_t kMaxName = 64;
constexpr std::array<Right, 3> kRights = {Right::kRead, Right::kSubmit, Right::kAdmin};

Digest DigestOf(std::string_view token) { return Sha256(std::as_bytes(std::span(token))); }

/// Names appear in logs.
bool IsName(const std::string& name) {
  return name.size() <= kMaxName && std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return std::isalnum(c) || c == '-' || c == '_' || c == '.' || c == '@';
         });
}

std::optional<Right> ParseRight(const std::string& text) {
  for (const Right right : kRights)
    if (text == RightName(right)) return right;
  return std::nullopt;
}

/// The words of a line without its comment.
std::vector<std::string> Words(const std::string& line) {
  std::istringstream stream(line.substr(0, line.find('#')));
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

Result<TokenList::Client> ParseClient(const std::vector<std::string>& words) {
  if (words.size() != 3) return BadInput("is not NAME RIGHT SHA256");
  if (!IsName(words[0])) return BadInput("has a name with other characters than letters, digits and -_.@");
  const std::optional<Right> right = ParseRight(words[1]);
  if (!right) return BadInput("has '" + words[1] + "' in place of read, submit or admin");
  const std::optional<Digest> token = Digest::FromHex(words[2]);
  if (!token) return BadInput("has no SHA-256 in hexadecimal at its end");
  return TokenList::Client{words[0], *right, *token};
}

Result<std::string> ReadText(const std::filesystem::path& path) {
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, kMaxFileBytes));
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

}  // namespace

const char* RightName(Right right) {
  switch (right) {
    case Right::kRead:
      return "read";
    case Right::kSubmit:
      return "submit";
    case Right::kAdmin:
      return "admin";
  }
  return "";
}

Result<TokenList> TokenList::Parse(std::string_view text) {
  TokenList list;
  std::set<Digest> known;
  std::istringstream lines{std::string(text)};
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    const std::string where = "line " + std::to_string(++number);
    const std::vector<std::string> words = Words(line);
    if (words.empty()) continue;
    Result<Client> client = ParseClient(words);
    if (!client.ok()) return BadInput(where + " " + client.status().message());
    if (!known.insert(client->token).second) return BadInput(where + " has the token of a line before it");
    list.clients_.push_back(std::move(client).value());
  }
  if (list.clients_.empty()) return BadInput("has no client; 'glint token' makes one");
  return list;
}

Result<TokenList> TokenList::Read(const std::filesystem::path& path) {
  GLINT_ASSIGN_OR_RETURN(const std::string text, ReadText(path));
  Result<TokenList> list = Parse(text);
  return list.ok() ? std::move(list) : list.status().WithContext(path.string());
}

const TokenList::Client* TokenList::Find(std::string_view token) const {
  const Digest digest = DigestOf(token);
  const Client* found = nullptr;
  for (const Client& client : clients_) {
    const bool same = CRYPTO_memcmp(client.token.bytes.data(), digest.bytes.data(), digest.bytes.size()) == 0;
    found = same ? &client : found;
  }
  return found;
}

Result<std::string> MakeToken() {
  Digest random;
  if (RAND_bytes(random.bytes.data(), static_cast<int>(random.bytes.size())) != 1)
    return IoError("the system gives no random numbers for a token");
  return random.Hex();
}

std::string TokenLine(const std::string& name, Right right, std::string_view token) {
  return name + " " + RightName(right) + " " + DigestOf(token).Hex();
}

Result<std::string> ReadToken(const std::filesystem::path& path) {
  GLINT_ASSIGN_OR_RETURN(const std::string text, ReadText(path));
  std::istringstream stream(text);
  std::string token, more;
  if (stream >> token && !(stream >> more)) return token;
  return BadInput(path.string() + ": is not a file of one token, as 'glint token' writes it");
}

}  // namespace glint
