// From a normal to contact points, for any pair of convex shapes: the face (or edge, or corner) of each that looks at
// the other is clipped against the other's.
#pragma once

#include <span>
#include <vector>

#include "server/physics/contact_points.h"
#include "server/physics/shape_store.h"

namespace soda::physics {

// A corner (1 point), an edge (2) or a face (3 and more, convex, in order) of a shape; world axes.
struct Feature {
  std::vector<Vec3> points;
  Vec3 normal = Vec3::Zero();  // unit, outwards; of faces only
};

// What of a convex shape looks along `direction` (unit): a sphere's point, a capsule's line, a box's or a hull's face,
// a cylinder's cap as an octagon or its side's line. Its points are on the true surface.
void feature_along(const Child& child, const Placement& at, const Vec3& direction, Feature& feature);

// How far a convex shape reaches along `direction` (unit), m from the origin.
double reach_along(const Child& child, const Placement& at, const Vec3& direction);

class FaceClipper {
 public:
  // Appends points of the two features closer than `max_distance` along `normal` (unit, from a to b).
  void clip(const Feature& a, const Feature& b, const Vec3& normal, double max_distance,
            std::vector<DetectedPoint>& out);

 private:
  void onto_face(const Feature& face, const Feature& other, const Vec3& normal, bool face_is_a, double max_distance,
                 std::vector<DetectedPoint>& out);
  std::vector<Vec3> ring_, clipped_;
};

}  // namespace soda::physics
