// Narrow phase for one pair of child shapes. Its answer depends on the two shapes and their poses alone; nothing is
// kept between calls, and nothing in it goes through the host's libm.
#pragma once

#include <memory>
#include <vector>

#include "server/physics/contact_points.h"
#include "server/physics/shape_store.h"

namespace soda::physics {

class Detector {
 public:
  Detector();
  ~Detector();
  // Points of a and b closer than `max_distance`, relative to a's place: of a pair of convex shapes up to a few more
  // than kMaxContactPoints, on surfaces as many for each triangle. Call with the canonical order (lower id first,
  // dynamic before static), for the answer for (b, a) has other bits. Replaces `out`.
  void detect(const Child& a, const Placement& at_a, const Child& b, const Placement& at_b, double max_distance,
              std::vector<DetectedPoint>& out);

 private:
  class Pair;
  std::unique_ptr<Pair> pair_;
};

}  // namespace soda::physics
