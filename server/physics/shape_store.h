// The collision shapes of a scene: every body's children, flattened. Immutable after construction.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/scene/scene.h"

class btConvexShape;

namespace soda::physics {

class TriangleSurface;
struct Polytope;

enum class ShapeKind : std::uint8_t {
  kSphere,
  kBox,
  kHull,
  kCapsule,  // along its z axis, as is
  kCylinder,
  kPlane,    // static only: solid below z = 0 of its own frame
  kConcave,  // triangle mesh or height field; static only
};

// One shape of a body. A body with several is a compound; each pair of children has contact records of its own.
struct Child {
  ShapeKind kind = ShapeKind::kSphere;
  bool centred = false;                                     // pose is the identity
  Pose pose;                                                // in the body's frame (origin at the centre of mass)
  Mat3 rotation = Mat3::Identity();                         // of pose
  Vec3 box_centre = Vec3::Zero(), box_half = Vec3::Zero();  // m, bounding box in the child's own frame
  double radius = 0;                                        // m; of a sphere, capsule, cylinder
  double half_length = 0;                                   // m; of a capsule's or cylinder's cylindrical part
  double inner_extent = 0;                                  // m, smallest half extent
  const btConvexShape* shape = nullptr;                     // for GJK; null where not convex
  const Polytope* polytope = nullptr;                       // of boxes and hulls
  const TriangleSurface* surface = nullptr;                 // where concave
};

class ShapeStore {
 public:
  ShapeStore();
  ~ShapeStore();
  ShapeStore(const ShapeStore&) = delete;
  ShapeStore& operator=(const ShapeStore&) = delete;

  // Adds a body's shapes as children, with poses relative to its centre of mass; returns the index of the first.
  // Bodies of one scene that share a geometry share what is made of it, as long as no other scene's come in between.
  std::uint32_t add(const Scene& scene, const Body& body);
  std::span<const Child> children() const { return children_; }
  std::span<const Child> children(std::uint32_t first, std::uint32_t count) const {
    return std::span(children_).subspan(first, count);
  }

 private:
  struct Owned;
  void prepare(const Geometry& geometry, Child& child);
  std::vector<Child> children_;
  std::unique_ptr<Owned> owned_;
};

// The bounding box of children at a pose (rotation given as a matrix); exact for boxes and spheres, else that of each
// child's own bounding box, turned. A plane's is infinite.
Aabb bounding_box(std::span<const Child> children, const Vec3& position, const Mat3& rotation);

}  // namespace soda::physics
