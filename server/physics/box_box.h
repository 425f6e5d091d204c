// Contact points of two boxes: by far the commonest pair, so it has a routine of its own, faster than the general one
// (and than Bullet's, whose choice among many points goes through atan2 and so through the host's libm).
#pragma once

#include <vector>

#include "server/physics/contact_points.h"

namespace soda::physics {

// Boxes of half extents `half_a`, `half_b` (m) at the places given. Appends the points closer than `max_distance`: up
// to 8 of a face contact, one where edges cross.
void box_box(const Vec3& half_a, const Placement& at_a, const Vec3& half_b, const Placement& at_b, double max_distance,
             std::vector<DetectedPoint>& out);

}  // namespace soda::physics
