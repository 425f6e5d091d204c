// For every x86-64, and other machines.
#define SODA_KERNEL_NAME baseline
#include "server/physics/solver_kernel.inc"
