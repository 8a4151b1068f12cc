// A process for tests of what happens to processes:
//   probe publish PATH TEXT   publishes TEXT at PATH (where GLINT_CRASH_AT may end it); 0 on success
//   probe stop N              installs the stop handler and sends itself N stop signals; 0 if it saw the
//   request

#include <signal.h>

#include <cstdlib>
#include <span>
#include <string>
#include <string_view>

#include "common/base/files.h"
#include "common/base/log.h"

int main(int argc, char** argv) {
  const std::span<char*> args(argv, static_cast<size_t>(argc));
  if (args.size() == 4 && std::string_view(args[1]) == "publish") {
    const std::string_view text(args[3]);
    return glint::PublishFile(args[2], std::as_bytes(std::span(text))).ok() ? 0 : 1;
  }
  if (args.size() == 3 && std::string_view(args[1]) == "stop") {
    glint::InstallStopHandler();
    for (int i = 0; i < std::atoi(args[2]); ++i) raise(i % 2 == 0 ? SIGINT : SIGTERM);
    return glint::StopRequested() ? 0 : 1;
  }
  return 2;
}
