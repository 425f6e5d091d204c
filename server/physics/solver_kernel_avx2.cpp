// Compiled with -mavx2 (CMakeLists.txt).
#define SODA_KERNEL_NAME avx2
#include "server/physics/solver_kernel.inc"
