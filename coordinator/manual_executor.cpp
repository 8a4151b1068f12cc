#include "coordinator/manual_executor.h"

#include <string>
#include <vector>

#include "common/round/round_files.h"
#include "coordinator/publish_round.h"

namespace glint {
namespace {

/// "3,5-8": indices in ascending order, as job arrays take them.
std::string Ranges(const std::vector<size_t>& indices) {
  std::string text;
  for (size_t i = 0; i < indices.size();) {
    size_t last = i;
    while (last + 1 < indices.size() && indices[last + 1] == indices[last] + 1) ++last;
    text += (text.empty() ? "" : ",") + std::to_string(indices[i]);
    if (last > i) text += "-" + std::to_string(indices[last]);
    i = last + 1;
  }
  return text;
}

class ManualExecutor : public Executor {
 public:
  explicit ManualExecutor(const ExecutorInput& input) : bake_(input) {}

  Status Run(const Round& round, const std::function<void(size_t, bool)>& on_done) override {
    const std::vector<size_t> missing = FindMissing(bake_.store, round);
    if (missing.empty()) {
      for (size_t i = 0; i < round.tasks.size(); ++i) on_done(i, true);
      return {};
    }
    GLINT_ASSIGN_OR_RETURN(const Digest manifest, PublishRound(bake_, round));
    return Interrupted("layer " + std::to_string(round.tasks.front().layer) + " waits for " +
                       std::to_string(missing.size()) + " of " + std::to_string(round.tasks.size()) +
                       " tasks; run 'glint run-task --manifest " +
                       ManifestPath(bake_.store.root(), manifest).string() + " --store " +
                       bake_.store.root().string() + " --index I' for I = " + Ranges(missing));
  }

 private:
  const ExecutorInput bake_;
};

}  // namespace

Result<std::unique_ptr<Executor>> MakeManualExecutor(const ExecutorInput& input) {
  return std::unique_ptr<Executor>(std::make_unique<ManualExecutor>(input));
}

}  // namespace glint
