#include "server/physics/shape_store.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>

#include <algorithm>
#include <limits>
#include <unordered_map>
#include <utility>

#include "server/physics/polytope.h"
#include "server/physics/triangle_surface.h"

namespace soda::physics {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

btVector3 to_bullet(const Vec3& v) { return btVector3(v.x(), v.y(), v.z()); }

}  // namespace

// Bodies share what is made from one geometry.
struct ShapeStore::Owned {
  const Scene* scene = nullptr;                       // whose geometries they are
  std::unordered_map<std::uint32_t, Child> prepared;  // by index of the geometry; with neither pose
  std::vector<std::unique_ptr<btConvexShape>> shapes;
  std::vector<std::unique_ptr<Polytope>> polytopes;
  std::vector<std::unique_ptr<TriangleSurface>> surfaces;

  template <typename T, typename... Args>
  T* make(Args&&... args) {
    auto shape = std::make_unique<T>(std::forward<Args>(args)...);
    T* raw = shape.get();
    shapes.push_back(std::move(shape));
    return raw;
  }
};

ShapeStore::ShapeStore() : owned_(std::make_unique<Owned>()) {}
ShapeStore::~ShapeStore() = default;

void ShapeStore::prepare(const Geometry& geometry, Child& child) {
  struct Visitor {
    Owned& own;
    Child& child;
    void box(const Vec3& half) const { child.box_half = half; }
    void points(const std::vector<Vec3>& all) const {
      Vec3 low = all.front(), high = low;
      for (const Vec3& p : all) low = low.cwiseMin(p), high = high.cwiseMax(p);
      child.box_centre = 0.5 * (low + high);
      child.box_half = 0.5 * (high - low);
    }
    void surface(std::unique_ptr<TriangleSurface> made) const {
      child.kind = ShapeKind::kConcave;
      child.box_centre = 0.5 * (made->bounds().min + made->bounds().max);
      child.box_half = 0.5 * (made->bounds().max - made->bounds().min);
      child.surface = made.get();
      own.surfaces.push_back(std::move(made));
    }
    void polytope(Polytope made) const {
      own.polytopes.push_back(std::make_unique<Polytope>(std::move(made)));
      child.polytope = own.polytopes.back().get();
    }
    void operator()(const Sphere& s) const {
      child.kind = ShapeKind::kSphere;
      child.radius = s.radius;
      child.shape = own.make<btSphereShape>(s.radius);
      box(Vec3::Constant(s.radius));
    }
    void operator()(const Box& b) const {
      child.kind = ShapeKind::kBox;
      auto* s = own.make<btBoxShape>(to_bullet(0.5 * b.size));
      s->setMargin(0);
      child.shape = s;
      polytope(box_polytope(0.5 * b.size));
      box(0.5 * b.size);
    }
    void operator()(const Plane&) const {
      child.kind = ShapeKind::kPlane;
      box(Vec3::Constant(kFar));
    }
    void operator()(const Capsule& c) const {
      child.kind = ShapeKind::kCapsule;
      child.radius = c.radius;
      child.half_length = 0.5 * c.length;
      child.shape = own.make<btCapsuleShapeZ>(c.radius, c.length);
      box(Vec3(c.radius, c.radius, 0.5 * c.length + c.radius));
    }
    void operator()(const Cylinder& c) const {
      child.kind = ShapeKind::kCylinder;
      child.radius = c.radius;
      child.half_length = 0.5 * c.length;
      auto* s = own.make<btCylinderShapeZ>(btVector3(c.radius, c.radius, 0.5 * c.length));
      // GJK sees a cylinder with rounded rims: a thinner one and a distance round it, so that touching is not
      // overlapping. Contact points are on the true one (face_clipping.h).
      s->setMargin(0.1 * std::min(c.radius, 0.5 * c.length));
      child.shape = s;
      box(Vec3(c.radius, c.radius, 0.5 * c.length));
    }
    void operator()(const ConvexHull& h) const {
      child.kind = ShapeKind::kHull;
      auto* s = own.make<btConvexHullShape>();
      for (const Vec3& p : h.points) s->addPoint(to_bullet(p), false);
      s->setMargin(0);
      s->recalcLocalAabb();
      child.shape = s;
      polytope(hull_polytope(h.points));
      points(h.points);
    }
    void operator()(const TriangleMesh& m) const { surface(std::make_unique<TriangleSurface>(m)); }
    void operator()(const HeightField& f) const { surface(std::make_unique<TriangleSurface>(f)); }
  };
  std::visit(Visitor{*owned_, child}, geometry);
  // A sheet's own thickness says nothing: what rests on it sets the scale.
  child.inner_extent = child.surface ? kFar : child.box_half.minCoeff();
}

std::uint32_t ShapeStore::add(const Scene& scene, const Body& body) {
  const auto first = static_cast<std::uint32_t>(children_.size());
  if (std::exchange(owned_->scene, &scene) != &scene) owned_->prepared.clear();
  for (const Shape& shape : body.shapes) {
    const Geometry& geometry = scene.geometries[shape.geometry];
    const auto [prepared, is_new] = owned_->prepared.try_emplace(shape.geometry);
    if (is_new) prepare(geometry, prepared->second);
    Child child = prepared->second;
    child.pose = shape.pose;
    if (const auto* plane = std::get_if<Plane>(&geometry))
      child.pose.orientation = shape.pose.orientation * Quat::FromTwoVectors(Vec3::UnitZ(), plane->normal);
    child.pose.position -= body.inertial.centre;
    child.rotation = child.pose.orientation.toRotationMatrix();
    child.centred = child.pose.position.isZero(0) && child.rotation == Mat3::Identity();
    children_.push_back(child);
  }
  return first;
}

Aabb bounding_box(std::span<const Child> children, const Vec3& position, const Mat3& rotation) {
  Aabb box{Vec3::Constant(kFar), Vec3::Constant(-kFar)};
  for (const Child& child : children) {
    if (child.kind == ShapeKind::kPlane) return {Vec3::Constant(-kFar), Vec3::Constant(kFar)};
    if (child.kind == ShapeKind::kSphere) {
      const Vec3 centre = child.centred ? position : position + rotation * child.pose.position;
      const Vec3 half = Vec3::Constant(child.radius);
      box.min = box.min.cwiseMin(centre - half);
      box.max = box.max.cwiseMax(centre + half);
      continue;
    }
    const Mat3 turn = child.centred ? rotation : Mat3(rotation * child.rotation);
    const Vec3 centre = position + rotation * child.pose.position + turn * child.box_centre;
    const Vec3 half = turn.cwiseAbs() * child.box_half;
    box.min = box.min.cwiseMin(centre - half);
    box.max = box.max.cwiseMax(centre + half);
  }
  return box;
}

}  // namespace soda::physics
