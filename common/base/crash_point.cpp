#include "common/base/crash_point.h"

#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

namespace glint {
namespace {

struct Plan {
  std::string point;
  std::atomic<int64_t> passes_left{0};

  Plan() {
    const char* text = std::getenv("GLINT_CRASH_AT");
    if (text == nullptr) return;
    const std::string_view plan(text);
    const size_t colon = plan.rfind(':');
    if (colon == std::string_view::npos) return;
    int64_t n = 0;
    std::from_chars(plan.data() + colon + 1, plan.data() + plan.size(), n);
    if (n < 1) return;
    point = plan.substr(0, colon);
    passes_left = n;
  }
};

}  // namespace

void CrashPoint(const char* point) {
  static Plan plan;
  if (plan.passes_left.load(std::memory_order_relaxed) <= 0 || plan.point != point) return;
  if (--plan.passes_left == 0) kill(getpid(), SIGKILL);
}

}  // namespace glint
