#include "server/physics/shape_store.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btTriangleIndexVertexArray.h>

#include <algorithm>
#include <limits>

namespace soda::physics {
namespace {

btVector3 to_bullet(const Vec3& v) { return btVector3(v.x(), v.y(), v.z()); }
Vec3 from_bullet(const btVector3& v) { return Vec3(v.x(), v.y(), v.z()); }

// What a mesh shape refers to but does not own.
struct MeshData {
  std::vector<int> indices;
  std::vector<double> vertices;
  std::unique_ptr<btTriangleIndexVertexArray> array;
};

ShapeKind kind_of(const Geometry& g) {
  struct Visitor {
    ShapeKind operator()(const Sphere&) const { return ShapeKind::kSphere; }
    ShapeKind operator()(const Box&) const { return ShapeKind::kBox; }
    ShapeKind operator()(const Plane&) const { return ShapeKind::kBox; }
    ShapeKind operator()(const ConvexHull&) const { return ShapeKind::kHull; }
    ShapeKind operator()(const Capsule&) const { return ShapeKind::kRound; }
    ShapeKind operator()(const Cylinder&) const { return ShapeKind::kRound; }
    ShapeKind operator()(const TriangleMesh&) const { return ShapeKind::kConcave; }
    ShapeKind operator()(const HeightField&) const { return ShapeKind::kConcave; }
  };
  return std::visit(Visitor{}, g);
}

}  // namespace

struct ShapeStore::Owned {
  std::vector<const btCollisionShape*> by_geometry;  // index as in Scene::geometries, null until first used
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<MeshData>> meshes;
  std::vector<std::unique_ptr<std::vector<double>>> heights;

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

// Margins are 0 wherever Bullet allows: the shapes are exactly what the scene says, not rounded and not blown up.
const btCollisionShape* ShapeStore::geometry_shape(const Scene& scene, std::uint32_t index, double plane_extent) {
  Owned& own = *owned_;
  own.by_geometry.resize(scene.geometries.size(), nullptr);
  if (own.by_geometry[index]) return own.by_geometry[index];
  struct Visitor {
    Owned& own;
    double plane_extent;
    const btCollisionShape* polyhedral(btPolyhedralConvexShape* s) const {
      s->setMargin(0);
      s->initializePolyhedralFeatures();
      return s;
    }
    const btCollisionShape* operator()(const Sphere& s) const { return own.make<btSphereShape>(s.radius); }
    const btCollisionShape* operator()(const Box& b) const {
      return polyhedral(own.make<btBoxShape>(to_bullet(0.5 * b.size)));
    }
    const btCollisionShape* operator()(const Plane&) const {
      return polyhedral(own.make<btBoxShape>(btVector3(plane_extent, plane_extent, plane_extent)));
    }
    const btCollisionShape* operator()(const Capsule& c) const {
      return own.make<btCapsuleShapeZ>(c.radius, c.length);
    }
    const btCollisionShape* operator()(const Cylinder& c) const {
      auto* s = own.make<btCylinderShapeZ>(btVector3(c.radius, c.radius, 0.5 * c.length));
      s->setMargin(0);
      return s;
    }
    const btCollisionShape* operator()(const ConvexHull& h) const {
      auto* s = own.make<btConvexHullShape>();
      for (const Vec3& p : h.points) s->addPoint(to_bullet(p), false);
      s->recalcLocalAabb();
      return polyhedral(s);
    }
    const btCollisionShape* operator()(const TriangleMesh& m) const {
      auto data = std::make_unique<MeshData>();
      for (const auto& t : m.triangles)
        for (std::uint32_t i : t) data->indices.push_back(static_cast<int>(i));
      for (const Vec3& v : m.vertices) data->vertices.insert(data->vertices.end(), {v.x(), v.y(), v.z()});
      data->array = std::make_unique<btTriangleIndexVertexArray>(
          static_cast<int>(m.triangles.size()), data->indices.data(), static_cast<int>(3 * sizeof(int)),
          static_cast<int>(m.vertices.size()), data->vertices.data(), static_cast<int>(3 * sizeof(double)));
      auto* s = own.make<btBvhTriangleMeshShape>(data->array.get(), true);
      own.meshes.push_back(std::move(data));
      return s;
    }
    const btCollisionShape* operator()(const HeightField& f) const {
      own.heights.push_back(std::make_unique<std::vector<double>>(f.heights));
      const auto [low, high] = std::minmax_element(f.heights.begin(), f.heights.end());
      auto* s = own.make<btHeightfieldTerrainShape>(static_cast<int>(f.columns), static_cast<int>(f.rows),
                                                    own.heights.back()->data(), *low, *high, 2, false);
      s->setLocalScaling(btVector3(f.spacing_x, f.spacing_y, 1));
      return s;
    }
  };
  return own.by_geometry[index] = std::visit(Visitor{own, plane_extent}, scene.geometries[index]);
}

std::uint32_t ShapeStore::add(const Scene& scene, const Body& body, double plane_extent) {
  const auto first = static_cast<std::uint32_t>(children_.size());
  for (const Shape& shape : body.shapes) {
    const Geometry& geometry = scene.geometries[shape.geometry];
    Child child;
    child.kind = kind_of(geometry);
    child.pose = shape.pose;
    if (const auto* plane = std::get_if<Plane>(&geometry)) {
      child.pose.orientation = shape.pose.orientation * Quat::FromTwoVectors(Vec3::UnitZ(), plane->normal);
      child.pose.position = shape.pose.position - child.pose.orientation * Vec3(0, 0, plane_extent);
    }
    if (const auto* field = std::get_if<HeightField>(&geometry)) {
      // Bullet centres the field's box on its origin.
      const auto [low, high] = std::minmax_element(field->heights.begin(), field->heights.end());
      child.pose.position = shape.pose.position + shape.pose.orientation * Vec3(0, 0, 0.5 * (*low + *high));
    }
    if (const auto* sphere = std::get_if<Sphere>(&geometry)) child.radius = sphere->radius;
    child.pose.position -= body.inertial.centre;
    child.rotation = child.pose.orientation.toRotationMatrix();
    child.centred = child.pose.position.isZero(0) && child.rotation == Mat3::Identity();
    child.shape = geometry_shape(scene, shape.geometry, plane_extent);
    btVector3 low, high;
    child.shape->getAabb(btTransform::getIdentity(), low, high);
    child.box_centre = 0.5 * from_bullet(low + high);
    child.box_half = 0.5 * from_bullet(high - low);
    child.inner_extent = child.box_half.minCoeff();
    children_.push_back(child);
  }
  return first;
}

Aabb bounding_box(std::span<const Child> children, const Vec3& position, const Mat3& rotation) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Aabb box{Vec3::Constant(kFar), Vec3::Constant(-kFar)};
  for (const Child& child : children) {
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
