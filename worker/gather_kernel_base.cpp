#define GLINT_KERNELS kGatherKernelsBase
#define GLINT_KERNEL_LEVEL "base"
#include "worker/gather_kernel.inl"
