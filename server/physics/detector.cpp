#include "server/physics/detector.h"

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionDispatch/btBoxBoxDetector.h>
#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btConvexPolyhedron.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkEpaPenetrationDepthSolver.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPolyhedralContactClipping.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>

#include <algorithm>
#include <cmath>

namespace soda::physics {
namespace {

btVector3 to_bullet(const Vec3& v) { return btVector3(v.x(), v.y(), v.z()); }
Vec3 from_bullet(const btVector3& v) { return Vec3(v.x(), v.y(), v.z()); }
btTransform to_bullet(const Vec3& x, const Mat3& r) {
  return btTransform(btMatrix3x3(r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1), r(2, 2)),
                     to_bullet(x));
}

// Bullet reports the normal on b (from b to a), a point on b, and a signed distance.
struct Collector : btDiscreteCollisionDetectorInterface::Result {
  struct Raw {
    btVector3 normal_on_b, point_on_b;
    double depth;
  };
  Raw raw[64];
  int count = 0;
  void setShapeIdentifiersA(int, int) override {}
  void setShapeIdentifiersB(int, int) override {}
  void addContactPoint(const btVector3& normal_on_b, const btVector3& point, btScalar depth) override {
    if (count < 64) raw[count++] = {normal_on_b, point, depth};
  }
};

// Points on boxes that were blown up, back on the boxes as they are.
Vec3 clamp_to(const Vec3& local, const Vec3& half) { return local.cwiseMax(-half).cwiseMin(half); }

// The angle by which a round shape is rocked to find more than one point of a line or disc contact, and how much deeper
// a point may appear by it.
constexpr double kRockAngle = 0.02;  // rad

// Bullet's own pools hold thousands of manifolds and algorithms, megabytes to clear; one of each is in use at a time here
// (a few more inside compound and concave algorithms, which then come from the heap).
btDefaultCollisionConstructionInfo small_pools() {
  btDefaultCollisionConstructionInfo info;
  info.m_defaultMaxPersistentManifoldPoolSize = 4;
  info.m_defaultMaxCollisionAlgorithmPoolSize = 16;
  return info;
}

}  // namespace

struct Detector::Bullet {
  btDefaultCollisionConfiguration configuration{small_pools()};
  btCollisionDispatcher dispatcher{&configuration};
  btVoronoiSimplexSolver simplex;
  btGjkEpaPenetrationDepthSolver epa;
  btCollisionObject object_a, object_b;
  btVertexArray vertices_1, vertices_2;

  void boxes(const Child& a, const Vec3& xa, const Mat3& ra, const Child& b, const Vec3& xb, const Mat3& rb,
             double max_distance, std::vector<DetectedPoint>& out) {
    // Bullet's box-box routine finds overlapping boxes only: each is blown up by half of the distance asked for, and the
    // points are then brought back to the true surfaces.
    const Vec3 grow = Vec3::Constant(0.5 * max_distance);
    const btBoxShape box_a(to_bullet(a.box_half + grow)), box_b(to_bullet(b.box_half + grow));
    btBoxBoxDetector detector(&box_a, &box_b);
    btDiscreteCollisionDetectorInterface::ClosestPointInput input;
    input.m_transformA = to_bullet(xa, ra);
    input.m_transformB = to_bullet(xb, rb);
    Collector found;
    detector.getClosestPoints(input, found, nullptr);
    for (int i = 0; i < found.count; ++i) {
      DetectedPoint p;
      p.normal = -from_bullet(found.raw[i].normal_on_b);
      const Vec3 blown_b = from_bullet(found.raw[i].point_on_b);
      const Vec3 blown_a = blown_b - found.raw[i].depth * p.normal;
      p.on_b = xb + rb * clamp_to(rb.transpose() * (blown_b - xb), b.box_half);
      p.on_a = xa + ra * clamp_to(ra.transpose() * (blown_a - xa), a.box_half);
      p.distance = p.normal.dot(p.on_b - p.on_a);
      if (p.distance <= max_distance) out.push_back(p);
    }
  }

  void gjk(const btConvexShape* a, const btTransform& ta, const btConvexShape* b, const btTransform& tb, double reach,
           Collector& found) {
    simplex.reset();
    btGjkPairDetector detector(a, b, &simplex, &epa);
    btDiscreteCollisionDetectorInterface::ClosestPointInput input;
    input.m_transformA = ta;
    input.m_transformB = tb;
    const double limit = reach + a->getMargin() + b->getMargin();
    input.m_maximumDistanceSquared = limit * limit;
    detector.getClosestPoints(input, found, nullptr);
  }

  void convex(const Child& a, const Vec3& xa, const Mat3& ra, const Child& b, const Vec3& xb, const Mat3& rb,
              double max_distance, std::vector<DetectedPoint>& out) {
    const auto* sa = static_cast<const btConvexShape*>(a.shape);
    const auto* sb = static_cast<const btConvexShape*>(b.shape);
    const btTransform ta = to_bullet(xa, ra), tb = to_bullet(xb, rb);
    Collector first;
    gjk(sa, ta, sb, tb, max_distance, first);
    if (first.count == 0 || first.raw[0].depth > max_distance) return;
    Collector found;
    if (sa->isPolyhedral() && sb->isPolyhedral()) {
      const btConvexPolyhedron& pa = *static_cast<const btPolyhedralConvexShape*>(sa)->getConvexPolyhedron();
      const btConvexPolyhedron& pb = *static_cast<const btPolyhedralConvexShape*>(sb)->getConvexPolyhedron();
      vertices_1.resize(0);
      btPolyhedralContactClipping::clipHullAgainstHull(first.raw[0].normal_on_b, pa, pb, ta, tb,
                                                       first.raw[0].depth - max_distance, max_distance, vertices_1,
                                                       vertices_2, found);
    } else if (a.kind == ShapeKind::kRound || b.kind == ShapeKind::kRound) {
      rocked(a, xa, ra, b, xb, rb, max_distance, first.raw[0], found);
    }
    if (found.count == 0) found = first;
    for (int i = 0; i < found.count; ++i) {
      DetectedPoint p;
      p.normal = -from_bullet(found.raw[i].normal_on_b);
      p.on_b = from_bullet(found.raw[i].point_on_b);
      p.distance = found.raw[i].depth;
      p.on_a = p.on_b - p.distance * p.normal;
      if (p.distance <= max_distance) out.push_back(p);
    }
  }

  // Line and disc contacts of capsules and cylinders: the round shape is rocked about four axes across the normal; the
  // point found each time is carried back to the true pose.
  void rocked(const Child& a, const Vec3& xa, const Mat3& ra, const Child& b, const Vec3& xb, const Mat3& rb,
              double max_distance, const Collector::Raw& first, Collector& found) {
    const bool rock_a = a.kind == ShapeKind::kRound;
    const auto* sa = static_cast<const btConvexShape*>(a.shape);
    const auto* sb = static_cast<const btConvexShape*>(b.shape);
    const Vec3 n = from_bullet(first.normal_on_b);
    const Vec3 t1 = n.unitOrthogonal(), t2 = n.cross(t1);
    const Child& round = rock_a ? a : b;
    const double slack = kRockAngle * round.box_half.norm();
    found.addContactPoint(first.normal_on_b, first.point_on_b, first.depth);
    for (int k = 0; k < 4; ++k) {
      const Vec3 axis = (k & 1 ? t2 : t1) * (k & 2 ? -kRockAngle : kRockAngle);
      const Mat3 turn = rotation_of(axis).toRotationMatrix();
      const Mat3 ra2 = rock_a ? Mat3(turn * ra) : ra, rb2 = rock_a ? rb : Mat3(turn * rb);
      Collector once;
      gjk(sa, to_bullet(xa, ra2), sb, to_bullet(xb, rb2), max_distance + slack, once);
      if (once.count == 0) continue;
      const Vec3 normal = from_bullet(once.raw[0].normal_on_b);
      Vec3 on_b = from_bullet(once.raw[0].point_on_b);
      Vec3 on_a = on_b + once.raw[0].depth * normal;
      if (rock_a)
        on_a = xa + ra * (ra2.transpose() * (on_a - xa));
      else
        on_b = xb + rb * (rb2.transpose() * (on_b - xb));
      // All points of this contact are taken along the first normal; distance from b outwards to a.
      found.addContactPoint(first.normal_on_b, to_bullet(on_b), n.dot(on_a - on_b));
    }
  }

  void concave(const Child& a, const Vec3& xa, const Mat3& ra, const Child& b, const Vec3& xb, const Mat3& rb,
               double max_distance, std::vector<DetectedPoint>& out) {
    object_a.setCollisionShape(const_cast<btCollisionShape*>(a.shape));
    object_b.setCollisionShape(const_cast<btCollisionShape*>(b.shape));
    object_a.setWorldTransform(to_bullet(xa, ra));
    object_b.setWorldTransform(to_bullet(xb, rb));
    btPersistentManifold manifold(&object_a, &object_b, 0, max_distance, max_distance);
    const btCollisionObjectWrapper wrap_a(nullptr, a.shape, &object_a, object_a.getWorldTransform(), -1, -1);
    const btCollisionObjectWrapper wrap_b(nullptr, b.shape, &object_b, object_b.getWorldTransform(), -1, -1);
    btCollisionAlgorithm* algorithm = dispatcher.findAlgorithm(&wrap_a, &wrap_b, &manifold, BT_CONTACT_POINT_ALGORITHMS);
    btManifoldResult result(&wrap_a, &wrap_b);
    result.setPersistentManifold(&manifold);
    btDispatcherInfo info;
    algorithm->processCollision(&wrap_a, &wrap_b, info, &result);
    algorithm->~btCollisionAlgorithm();
    dispatcher.freeCollisionAlgorithm(algorithm);
    for (int i = 0; i < manifold.getNumContacts(); ++i) {
      const btManifoldPoint& m = manifold.getContactPoint(i);
      DetectedPoint p;
      p.on_a = from_bullet(m.getPositionWorldOnA());
      p.on_b = from_bullet(m.getPositionWorldOnB());
      p.normal = -from_bullet(m.m_normalWorldOnB);
      p.distance = m.getDistance();
      if (p.distance <= max_distance) out.push_back(p);
    }
    manifold.setNumContacts(0);
  }
};

Detector::Detector() : bullet_(std::make_unique<Bullet>()) {}
Detector::~Detector() = default;

void Detector::detect(const Child& a, const Placement& at_a, const Child& b, const Placement& at_b, double max_distance,
                      std::vector<DetectedPoint>& out) {
  out.clear();
  // Everything relative to a's place, so that far from the origin no digits are lost.
  const Vec3 xa = Vec3::Zero(), xb = at_b.position - at_a.position;
  if (a.kind == ShapeKind::kSphere && b.kind == ShapeKind::kSphere) {
    const double length = xb.norm(), distance = length - a.radius - b.radius;
    if (distance > max_distance) return;
    const Vec3 n = length > 0 ? Vec3(xb / length) : Vec3::UnitZ();
    out.push_back({n * a.radius, xb - n * b.radius, n, distance});
  } else if (b.kind == ShapeKind::kConcave) {
    bullet_->concave(a, xa, at_a.rotation, b, xb, at_b.rotation, max_distance, out);
  } else if (a.kind == ShapeKind::kBox && b.kind == ShapeKind::kBox) {
    bullet_->boxes(a, xa, at_a.rotation, b, xb, at_b.rotation, max_distance, out);
  } else {
    bullet_->convex(a, xa, at_a.rotation, b, xb, at_b.rotation, max_distance, out);
  }
}

}  // namespace soda::physics
