// The collision shapes of a scene: every body's children, flattened, with their Bullet shapes. Immutable after
// construction.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/scene/scene.h"

class btCollisionShape;

namespace soda::physics {

enum class ShapeKind : std::uint8_t {
  kSphere,
  kBox,
  kHull,      // polyhedral, with faces for clipping
  kRound,     // capsule, cylinder: convex, neither a sphere nor polyhedral
  kConcave,   // triangle mesh or height field; static only
};

// One convex (or static concave) shape of a body. A body with several is a compound; each pair of children has contact
// records of its own.
struct Child {
  ShapeKind kind = ShapeKind::kSphere;
  bool centred = false;              // pose is the identity
  Pose pose;                         // in the body's frame (origin at the centre of mass)
  Mat3 rotation = Mat3::Identity();  // of pose
  Vec3 box_centre = Vec3::Zero(), box_half = Vec3::Zero();  // m, bounding box in the child's own frame
  double radius = 0;                 // m; of a sphere
  double inner_extent = 0;           // m, smallest half extent
  const btCollisionShape* shape = nullptr;
};

class ShapeStore {
 public:
  ShapeStore();
  ~ShapeStore();
  ShapeStore(const ShapeStore&) = delete;
  ShapeStore& operator=(const ShapeStore&) = delete;

  // Adds a body's shapes as children, with poses relative to its centre of mass; returns the index of the first. A plane
  // becomes a box of half edge `plane_extent`, whose upper face is the plane, so that boxes rest on it with four points.
  std::uint32_t add(const Scene& scene, const Body& body, double plane_extent);
  std::span<const Child> children() const { return children_; }
  std::span<const Child> children(std::uint32_t first, std::uint32_t count) const {
    return std::span(children_).subspan(first, count);
  }

 private:
  struct Owned;
  const btCollisionShape* geometry_shape(const Scene& scene, std::uint32_t index, double plane_extent);
  std::vector<Child> children_;
  std::unique_ptr<Owned> owned_;
};

// The bounding box of children at a pose (rotation given as a matrix); exact for boxes and spheres, else that of each
// child's own bounding box, turned.
Aabb bounding_box(std::span<const Child> children, const Vec3& position, const Mat3& rotation);

}  // namespace soda::physics
