#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/hash.h"
#include "common/base/status.h"

namespace glint {

/// What a client may do; each includes those before it.
enum class Right {
  kRead = 1,  ///< see bakes and fetch their archives
  kSubmit,    ///< upload scenes; submit, cancel and resume bakes
  kAdmin      ///< delete bakes
};

/// "read", "submit", "admin".
const char* RightName(Right right);

/// The clients that a service knows by their tokens, of which it has only the digests: whoever reads its file
/// can not call it. One client a line, "NAME RIGHT SHA256", the digest of the token's characters in
/// hexadecimal; what follows a '#' is a comment. Tokens are random (MakeToken), so that one digest without
/// salt keeps them.
class TokenList {
 public:
  struct Client {
    std::string name;
    Right right = Right::kRead;
    Digest token;
  };

  /// kBadInput, naming the line.
  static Result<TokenList> Parse(std::string_view text);
  /// Errors: those of ReadFile, and of Parse with the file's name.
  static Result<TokenList> Read(const std::filesystem::path& path);

  /// Whose token this is; null: nobody's. Takes as long for any token of a length.
  const Client* Find(std::string_view token) const;

 private:
  std::vector<Client> clients_;
};

/// A new token: 32 random bytes in hexadecimal. kIo: the system has no random numbers.
Result<std::string> MakeToken();
/// The line of a token file for it.
std::string TokenLine(const std::string& name, Right right, std::string_view token);

/// The token in a client's file: its one word. kBadInput: there is none, or more than one.
Result<std::string> ReadToken(const std::filesystem::path& path);

}  // namespace glint
