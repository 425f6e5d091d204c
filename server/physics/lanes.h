// Single lanes of the solver's data, as vectors of Eigen's. Not for the kernels.
#pragma once

#include "common/math.h"
#include "server/physics/solver_kernel.h"

namespace soda::physics {

inline Vec3 get(const Lanes3& from, int lane) { return Vec3(from.x[lane], from.y[lane], from.z[lane]); }

}  // namespace soda::physics
