// What clients send to a service, and the file of those who may. The first byte chooses.
#include <cstdint>
#include <cstdlib>
#include <string>

#include "coordinator/service/access.h"
#include "coordinator/service/journal.h"

namespace {

void Check(bool holds) {
  if (!holds) std::abort();
}

void ParseRequestText(const std::string& text) {
  const auto request = glint::ParseRequest(text);
  if (!request.ok()) {
    Check(!request.status().message().empty());
    return;
  }
  Check(request->max_layers >= 0 && request->priority >= 1 && request->layer_tolerance >= 0);
  const std::string json = glint::ToJson(*request);
  const auto again = glint::ParseRequest(json);
  Check(again.ok() && glint::ToJson(*again) == json);
}

void ParseTokens(const std::string& text) {
  const auto list = glint::TokenList::Parse(text);
  Check(list.ok() || !list.status().message().empty());
  if (list.ok()) Check(!list->Find(text));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (data[0] % 2 == 0) {
    ParseRequestText(text);
  } else {
    ParseTokens(text);
  }
  return 0;
}
