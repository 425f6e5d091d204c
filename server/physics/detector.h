// Narrow phase for one pair of child shapes: Bullet as a one-shot detector. Its answer depends on the two shapes and
// their poses alone; nothing is kept between calls.
#pragma once

#include <memory>
#include <vector>

#include "common/math.h"
#include "server/physics/shape_store.h"

namespace soda::physics {

// Where a child is: its own frame in the world.
struct Placement {
  Vec3 position;
  Mat3 rotation;
};

struct DetectedPoint {
  Vec3 on_a, on_b;  // m, on the two surfaces, relative to a's place, world axes
  Vec3 normal;      // unit, from a to b
  double distance;  // m, along the normal; negative where they penetrate
};

class Detector {
 public:
  Detector();
  ~Detector();
  // Points of a and b closer than `max_distance`, at most a few more than kMaxContactPoints per direction; call with the
  // canonical order (lower id first, dynamic before static), for the answer for (b, a) has other bits. Replaces `out`.
  void detect(const Child& a, const Placement& at_a, const Child& b, const Placement& at_b, double max_distance,
              std::vector<DetectedPoint>& out);

 private:
  struct Bullet;
  std::unique_ptr<Bullet> bullet_;
};

}  // namespace soda::physics
