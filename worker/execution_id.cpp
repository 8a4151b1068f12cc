#include "worker/execution_id.h"

#include <features.h>
#ifdef __GLIBC__
#include <gnu/libc-version.h>
#endif

#include "common/scene/ray_scene.h"
#include "worker/gather.h"

namespace glint {

std::string ExecutionId() {
  std::string id = "glint " GLINT_VERSION ", gathering " + std::to_string(kGatherRevision) + "; " +
                   RayScene::EngineId() + "; kernels " + GatherKernelLevel() + "; " GLINT_COMPILER;
#ifdef __GLIBC__
  id += std::string(", glibc ") + gnu_get_libc_version();  // its exp, pow, ... have other last bits
#endif
  const std::string flags = GLINT_COMPILER_FLAGS;
  return flags.empty() ? id : id + ", " + flags;
}

}  // namespace glint
