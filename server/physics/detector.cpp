#include "server/physics/detector.h"

#include <BulletCollision/CollisionShapes/btTriangleShape.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkEpaPenetrationDepthSolver.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/physics/box_box.h"
#include "server/physics/face_clipping.h"
#include "server/physics/triangle_surface.h"

namespace soda::physics {
namespace {

btVector3 to_bullet(const Vec3& v) { return btVector3(v.x(), v.y(), v.z()); }
Vec3 from_bullet(const btVector3& v) { return Vec3(v.x(), v.y(), v.z()); }
btTransform to_bullet(const Placement& at) {
  const Mat3& r = at.rotation;
  return btTransform(btMatrix3x3(r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1), r(2, 2)),
                     to_bullet(at.position));
}

// A normal this near to that of a face is the face's: the rest is the solver's noise.
constexpr double kFaceCosine = 0.9998;  // 1.1 deg
// At an inner edge of a surface, a normal nearer than this to the triangle's is taken to be the triangle's.
constexpr double kSeamCosine = 0.99;  // 8 deg
// m; where clipping finds nothing as near as this above the nearest point, that point is used, too (edges that cross).
constexpr double kMissed = 0.002;
constexpr double kOnEdge = 1e-6;  // barycentric; a point this near to a triangle's edge is on it

Vec3 barycentric(const Triangle& t, const Vec3& p) {
  const Vec3 e0 = t.corner[1] - t.corner[0], e1 = t.corner[2] - t.corner[0], d = p - t.corner[0];
  const double a = e0.dot(e0), b = e0.dot(e1), c = e1.dot(e1), x = d.dot(e0), y = d.dot(e1);
  const double scale = 1 / (a * c - b * b), v = (c * x - b * y) * scale, w = (a * y - b * x) * scale;
  return Vec3(1 - v - w, v, w);
}

// C. Ericson, "Real-Time Collision Detection", 2005, 5.1.5.
Vec3 nearest_on(const Triangle& t, const Vec3& p) {
  const Vec3 &a = t.corner[0], &b = t.corner[1], &c = t.corner[2];
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d1 <= 0 && d2 <= 0) return a;
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const double scale = 1 / (va + vb + vc);
  return a + vb * scale * ab + vc * scale * ac;
}

// Whether a body may touch the triangle at `p`, a point of it, from the side `front` (1 or -1) otherwise than with the
// triangle's own normal: at edges that stick out towards it, or where the surface ends.
bool sticks_out(const Triangle& t, const Vec3& p, double front) {
  const Vec3 at = barycentric(t, p);
  for (int i = 0; i < 3; ++i) {
    if (at[(i + 2) % 3] > kOnEdge) continue;  // not on the edge from corner i to corner i + 1
    if (t.bend[i] == Bend::kOpen || t.bend[i] == (front > 0 ? Bend::kConvex : Bend::kConcave)) return true;
  }
  return false;
}

}  // namespace

class Detector::Pair {
 public:
  void spheres(const Child& a, const Child& b, const Placement& at_b, double max_distance, std::vector<DetectedPoint>& out) {
    const double length = at_b.position.norm(), distance = length - a.radius - b.radius;
    if (distance > max_distance) return;
    const Vec3 n = length > 0 ? Vec3(at_b.position / length) : Vec3(Vec3::UnitZ());
    out.push_back({n * a.radius, at_b.position - n * b.radius, n, distance});
  }

  void sphere_box(const Child& sphere, const Placement& at_sphere, const Child& box, const Placement& at_box,
                  bool sphere_is_a, double max_distance, std::vector<DetectedPoint>& out) {
    const Vec3 centre = at_box.rotation.transpose() * (at_sphere.position - at_box.position);
    const Vec3& half = box.box_half;
    const Vec3 nearest = centre.cwiseMax(-half).cwiseMin(half);
    Vec3 on_box = nearest, n;  // n: from the box to the sphere
    double height;             // of the centre above the box
    if (nearest != centre) {
      height = (centre - nearest).norm();
      n = (centre - nearest) / height;
    } else {  // the centre is inside: out through the nearest face
      int axis;
      height = -(half - centre.cwiseAbs()).minCoeff(&axis);
      n = Vec3::Zero();
      n[axis] = centre[axis] >= 0 ? 1 : -1;
      on_box[axis] = n[axis] * half[axis];
    }
    const double distance = height - sphere.radius;
    if (distance > max_distance) return;
    const Vec3 normal = at_box.rotation * n;
    const Vec3 on_b = at_box.position + at_box.rotation * on_box, on_s = on_b + distance * normal;
    if (sphere_is_a)
      out.push_back({on_s, on_b, -normal, distance});
    else
      out.push_back({on_b, on_s, normal, distance});
  }

  void convex(const Child& a, const Placement& at_a, const Child& b, const Placement& at_b, double max_distance,
              std::vector<DetectedPoint>& out) {
    std::optional<DetectedPoint> nearest = gjk(*a.shape, at_a, *b.shape, at_b, max_distance);
    if (!nearest) return;
    if (a.kind == ShapeKind::kSphere || b.kind == ShapeKind::kSphere) {
      out.push_back(*nearest);
      return;
    }
    feature_along(a, at_a, nearest->normal, feature_a_);
    feature_along(b, at_b, -nearest->normal, feature_b_);
    const double facing_a = feature_a_.normal.dot(nearest->normal), facing_b = -feature_b_.normal.dot(nearest->normal);
    Vec3 normal = nearest->normal;
    if (std::max(facing_a, facing_b) > kFaceCosine)
      normal = facing_a >= facing_b ? feature_a_.normal : Vec3(-feature_b_.normal);
    clip_or(*nearest, normal, max_distance, out);
  }

  void plane(const Child& a, const Placement& at_a, const Placement& plane, double max_distance,
             std::vector<DetectedPoint>& out) {
    const Vec3 up = plane.rotation.col(2);
    feature_along(a, at_a, -up, feature_a_);
    for (const Vec3& p : feature_a_.points)
      if (const double height = up.dot(p - plane.position); height <= max_distance)
        out.push_back({p, p - height * up, -up, height});
  }

  void surface(const Child& a, const Placement& at_a, const Child& b, const Placement& at_b, double max_distance,
               std::vector<DetectedPoint>& out) {
    // In the surface's frame.
    const Mat3 turn = at_b.rotation.transpose() * at_a.rotation;
    const Vec3 centre = at_b.rotation.transpose() * (at_a.position - at_b.position) + turn * a.box_centre;
    const Vec3 half = turn.cwiseAbs() * a.box_half + Vec3::Constant(max_distance);
    b.surface->find({centre - half, centre + half}, near_);
    for (const std::uint32_t index : near_) {
      Triangle t = b.surface->triangle(index);
      for (Vec3& corner : t.corner) corner = at_b.position + at_b.rotation * corner;
      const Vec3 cross = (t.corner[1] - t.corner[0]).cross(t.corner[2] - t.corner[0]);
      const double twice_area = cross.norm();
      if (!(twice_area > 0)) continue;
      const Vec3 middle = at_a.position + at_a.rotation * a.box_centre, up = cross / twice_area;
      const double front = b.surface->one_sided() || up.dot(middle - t.corner[0]) >= 0 ? 1 : -1;
      if (a.kind == ShapeKind::kSphere)
        sphere_triangle(a, at_a, t, front * up, front, max_distance, out);
      else
        convex_triangle(a, at_a, t, front * up, front, max_distance, out);
    }
  }

 private:
  // The nearest points, or those of the smallest movement that separates the two.
  std::optional<DetectedPoint> gjk(const btConvexShape& a, const Placement& at_a, const btConvexShape& b,
                                   const Placement& at_b, double max_distance) {
    struct Result : btDiscreteCollisionDetectorInterface::Result {
      bool found = false;
      btVector3 normal_on_b, point_on_b;
      double depth = 0;
      void setShapeIdentifiersA(int, int) override {}
      void setShapeIdentifiersB(int, int) override {}
      void addContactPoint(const btVector3& normal, const btVector3& point, btScalar distance) override {
        found = true, normal_on_b = normal, point_on_b = point, depth = distance;
      }
    } result;
    simplex_.reset();
    btGjkPairDetector detector(&a, &b, &simplex_, &epa_);
    btDiscreteCollisionDetectorInterface::ClosestPointInput input;
    input.m_transformA = to_bullet(at_a);
    input.m_transformB = to_bullet(at_b);
    const double limit = max_distance + a.getMargin() + b.getMargin();
    input.m_maximumDistanceSquared = limit * limit;
    detector.getClosestPoints(input, result, nullptr);
    if (!result.found || !(result.depth <= max_distance)) return {};
    const Vec3 normal = -from_bullet(result.normal_on_b), on_b = from_bullet(result.point_on_b);
    return DetectedPoint{on_b - result.depth * normal, on_b, normal, result.depth};
  }

  // Clips the two features; adds the nearest point where that finds none as near.
  void clip_or(const DetectedPoint& nearest, const Vec3& normal, double max_distance, std::vector<DetectedPoint>& out) {
    const std::size_t before = out.size();
    clipper_.clip(feature_a_, feature_b_, normal, max_distance, out);
    double least = HUGE_VAL;
    for (std::size_t i = before; i < out.size(); ++i) least = std::min(least, out[i].distance);
    if (least > nearest.distance + kMissed) out.push_back({nearest.on_a, nearest.on_b, normal, nearest.distance});
  }

  // `up` looks from the triangle to the side where the body is; `front` says whether that is the triangle's front.
  void sphere_triangle(const Child& a, const Placement& at_a, const Triangle& t, const Vec3& up, double front,
                       double max_distance, std::vector<DetectedPoint>& out) {
    Vec3 on_b = nearest_on(t, at_a.position);
    const Vec3 away = at_a.position - on_b;
    const double length = away.norm();
    double height = up.dot(away);
    Vec3 normal = -up;
    if (height < kSeamCosine * length) {
      if (length - a.radius > max_distance || !sticks_out(t, on_b, front)) return;  // a neighbour has this contact
      normal = away / -length;
      height = length;
    }
    if (height - a.radius > max_distance) return;
    on_b = at_a.position + height * normal;
    out.push_back({at_a.position + a.radius * normal, on_b, normal, height - a.radius});
  }

  void convex_triangle(const Child& a, const Placement& at_a, const Triangle& t, const Vec3& up, double front,
                       double max_distance, std::vector<DetectedPoint>& out) {
    const btTriangleShape shape(to_bullet(t.corner[0]), to_bullet(t.corner[1]), to_bullet(t.corner[2]));
    const_cast<btTriangleShape&>(shape).setMargin(0);
    const std::optional<DetectedPoint> nearest = gjk(*a.shape, at_a, shape, {Vec3::Zero(), Mat3::Identity()}, max_distance);
    if (!nearest) return;
    feature_b_.points.assign(t.corner.begin(), t.corner.end());
    feature_b_.normal = up;
    const double facing = -up.dot(nearest->normal);
    if (facing < kSeamCosine && facing > -kSeamCosine && sticks_out(t, nearest->on_b, front)) {
      feature_along(a, at_a, nearest->normal, feature_a_);
      clip_or(*nearest, nearest->normal, max_distance, out);
      return;
    }
    // Flat on the triangle; or at a seam, or through the triangle already, where only its own normal makes sense.
    feature_along(a, at_a, -up, feature_a_);
    clipper_.clip(feature_a_, feature_b_, -up, max_distance, out);
  }

  btVoronoiSimplexSolver simplex_;
  btGjkEpaPenetrationDepthSolver epa_;
  FaceClipper clipper_;
  Feature feature_a_, feature_b_;
  std::vector<std::uint32_t> near_;
};

Detector::Detector() : pair_(std::make_unique<Pair>()) {}
Detector::~Detector() = default;

void Detector::detect(const Child& a, const Placement& at_a, const Child& b, const Placement& at_b, double max_distance,
                      std::vector<DetectedPoint>& out) {
  out.clear();
  // Everything relative to a's place, so that far from the origin no digits are lost.
  const Placement from{Vec3::Zero(), at_a.rotation}, to{at_b.position - at_a.position, at_b.rotation};
  if (b.kind == ShapeKind::kPlane)
    pair_->plane(a, from, to, max_distance, out);
  else if (b.kind == ShapeKind::kConcave)
    pair_->surface(a, from, b, to, max_distance, out);
  else if (a.kind == ShapeKind::kBox && b.kind == ShapeKind::kBox)
    box_box(a.box_half, from, b.box_half, to, max_distance, out);
  else if (a.kind == ShapeKind::kSphere && b.kind == ShapeKind::kSphere)
    pair_->spheres(a, b, to, max_distance, out);
  else if (a.kind == ShapeKind::kSphere && b.kind == ShapeKind::kBox)
    pair_->sphere_box(a, from, b, to, true, max_distance, out);
  else if (a.kind == ShapeKind::kBox && b.kind == ShapeKind::kSphere)
    pair_->sphere_box(b, to, a, from, false, max_distance, out);
  else
    pair_->convex(a, from, b, to, max_distance, out);
}

}  // namespace soda::physics
