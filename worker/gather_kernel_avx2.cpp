#define GLINT_KERNELS kGatherKernelsAvx2
#define GLINT_KERNEL_LEVEL "avx2"
#include "worker/gather_kernel.inl"
