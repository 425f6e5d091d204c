#include "server/physics/solver_kernel.h"

#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>

namespace soda::physics {

extern const Kernel kKernel_baseline;
#ifdef SODA_HAS_AVX2_KERNEL
extern const Kernel kKernel_avx2;
#endif

Kernels available_kernels() {
  Kernels kernels{{&kKernel_baseline, nullptr}, 1};
#ifdef SODA_HAS_AVX2_KERNEL
  if (__builtin_cpu_supports("avx2")) kernels.list[kernels.count++] = &kKernel_avx2;
#endif
  return kernels;
}

namespace {

const Kernel& choose() {
  const Kernels kernels = available_kernels();
  const char* const wanted = std::getenv("SODA_SIMD");
  if (wanted == nullptr || *wanted == '\0') return *kernels.list[kernels.count - 1];
  for (int i = 0; i < kernels.count; ++i)
    if (std::strcmp(kernels.list[i]->name, wanted) == 0) return *kernels.list[i];
  throw std::runtime_error(std::string("SODA_SIMD: '") + wanted + "' is not an instruction set that this machine has");
}

}  // namespace

const Kernel& chosen_kernel() {
  static const Kernel& kernel = choose();
  return kernel;
}

}  // namespace soda::physics
