#include "worker/gather_kernel.h"

namespace glint {

const GatherKernels& SelectGatherKernels() {
  static const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return avx2 ? kGatherKernelsAvx2 : kGatherKernelsBase;
}

}  // namespace glint
