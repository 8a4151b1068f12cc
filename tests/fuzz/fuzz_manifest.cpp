// Manifests from whoever can write to a store: what is taken for one must be one in every field.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "common/round/manifest.h"

namespace {

void Check(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto round = glint::ParseRoundManifest({reinterpret_cast<const std::byte*>(data), size});
  if (!round.ok()) {
    Check(!round.status().message().empty());
    return 0;
  }
  Check(round->blocks.size() <= glint::kMaxRoundTasks);
  for (size_t i = 0; i < std::min<size_t>(round->blocks.size(), 16); ++i) {
    const glint::TaskSpec task = round->Task(i);
    Check(task.layer == round->layer && task.block.vertices > 0);
  }
  const std::string text = glint::ToJson(*round);
  const auto again = glint::ParseRoundManifest(std::as_bytes(std::span(text)));
  Check(again.ok() && again->InputKey() == round->InputKey() && glint::ToJson(*again) == text);
  return 0;
}
