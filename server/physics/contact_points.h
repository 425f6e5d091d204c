// The words of the narrow phase.
#pragma once

#include <algorithm>

#include "common/math.h"
#include "server/physics/tuning.h"

namespace soda::physics {

// Where a child shape is: its own frame in the world.
struct Placement {
  Vec3 position;
  Mat3 rotation;
};

struct DetectedPoint {
  Vec3 on_a, on_b;  // m, on the two surfaces
  Vec3 normal;      // unit, from a to b
  double distance;  // m, along the normal; negative where they penetrate
};

// Points of one shape count as facing the other's face also when they lie this far (m) beside it: fast bodies may get
// there within the step.
inline double slack_beside(double max_distance) { return std::max(0.0, max_distance - kSpeculativeDistance); }

}  // namespace soda::physics
