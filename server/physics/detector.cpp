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
#include "server/physics/polytope.h"
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
constexpr double kBetterAxis = 1e-3;  // m, by which another direction must be better than that found
constexpr double kOnEdge = 1e-6;      // barycentric; a point this near to a triangle's edge is on it
constexpr double kCrossing = 0.01;    // m, by which edges that touch may miss each other
constexpr double kAlike = 1e-3;       // of a triangle's size; corners that reach equally far within this do
// Of the smaller shape's smallest half extent: see find_axes.
constexpr double kFacePreference = 0.02;
// Pairs of edges beyond which the test of all separating axes costs more than GJK.
constexpr std::size_t kMostEdgePairs = 4096;

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

// Which of a triangle's edges (bits) hold `p`, a point of it.
unsigned edges_at(const Triangle& t, const Vec3& p) {
  const Vec3 at = barycentric(t, p);
  unsigned edges = 0;
  for (unsigned i = 0; i < 3; ++i)
    if (at[(i + 2) % 3] <= kOnEdge) edges |= 1u << i;
  return edges;
}

// Which of them look along `direction`.
unsigned edges_along(const Triangle& t, const Vec3& direction) {
  double along[3], most = -HUGE_VAL, size = 0;
  for (int i = 0; i < 3; ++i) {
    along[i] = direction.dot(t.corner[i] - t.corner[0]);
    most = std::max(most, along[i]);
    size = std::max(size, (t.corner[i] - t.corner[0]).norm());
  }
  const auto far = [&](int i) { return along[i] > most - kAlike * size; };
  unsigned edges = 0;
  for (int i = 0; i < 3; ++i)
    if (far(i) && far((i + 1) % 3)) edges |= 1u << i;
  if (edges == 0)  // a corner alone: the edges that meet there
    for (int i = 0; i < 3; ++i)
      if (far(i)) edges = 1u << i | 1u << (i + 2) % 3;
  return edges;
}

// Whether a body on the side `front` (1 or -1) may touch one of those edges otherwise than with the triangle's own
// normal: where it sticks out, or where the surface ends.
bool sticks_out(const Triangle& t, unsigned edges, double front) {
  for (unsigned i = 0; i < 3; ++i)
    if ((edges & 1u << i) && (t.bend[i] == Bend::kOpen || t.bend[i] == (front > 0 ? Bend::kConvex : Bend::kConcave)))
      return true;
  return false;
}

}  // namespace

class Detector::Pair {
 public:
  void spheres(const Child& a, const Child& b, const Placement& at_b, double max_distance,
               std::vector<DetectedPoint>& out) {
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
    if (a.polytope && b.polytope && a.polytope->edges.size() * b.polytope->edges.size() <= kMostEdgePairs)
      polytopes(a, at_a, b, at_b, max_distance, out);
    else
      by_gjk(a, at_a, b, at_b, max_distance, out);
  }

  void by_gjk(const Child& a, const Placement& at_a, const Child& b, const Placement& at_b, double max_distance,
              std::vector<DetectedPoint>& out) {
    std::optional<DetectedPoint> nearest = gjk(*a.shape, at_a, *b.shape, at_b, max_distance);
    if (!nearest) return;
    if (nearest->distance < 0) improve(a, at_a, b, at_b, *nearest);
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
    if (a.polytope) place(*a.polytope, at_a, polytope_a_);
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
      else if (a.polytope)
        polytope_triangle(a, t, up, front, max_distance, out);
      else
        round_triangle(a, at_a, t, front * up, front, max_distance, out);
    }
  }

 private:
  // The nearest points, or those of the smallest movement that separates the two; none where they are further apart.
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

  // Where shapes overlap, GJK and EPA may end far from the best direction: the shapes' own axes and that between their
  // centres are tried as well.
  void improve(const Child& a, const Placement& at_a, const Child& b, const Placement& at_b, DetectedPoint& p) {
    const auto separation = [&](const Vec3& d) { return -reach_along(b, at_b, -d) - reach_along(a, at_a, d); };
    double best = separation(p.normal);
    const double before = best;
    const auto consider = [&](const Vec3& d) {
      if (const double s = separation(d); s > best + kBetterAxis) best = s, p.normal = d;
    };
    const Vec3 between = at_b.position - at_a.position;
    for (int axis = 0; axis < 3; ++axis)
      for (const Vec3& d : {Vec3(at_a.rotation.col(axis)), Vec3(at_b.rotation.col(axis))})
        consider(d.dot(between) < 0 ? Vec3(-d) : d);
    if (const double length = between.norm(); length > 0) consider(between / length);
    if (best == before) return;
    p.distance = best;
    p.on_a = 0.5 * (p.on_a + p.on_b) - 0.5 * best * p.normal;
    p.on_b = p.on_a + best * p.normal;
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
      if (length - a.radius > max_distance || !sticks_out(t, edges_at(t, on_b), front))
        return;  // a neighbour has this contact
      normal = away / -length;
      height = length;
    }
    if (height - a.radius > max_distance) return;
    on_b = at_a.position + height * normal;
    out.push_back({at_a.position + a.radius * normal, on_b, normal, height - a.radius});
  }

  // Capsules and cylinders.
  void round_triangle(const Child& a, const Placement& at_a, const Triangle& t, const Vec3& up, double front,
                      double max_distance, std::vector<DetectedPoint>& out) {
    btTriangleShape shape(to_bullet(t.corner[0]), to_bullet(t.corner[1]), to_bullet(t.corner[2]));
    shape.setMargin(0);
    const std::optional<DetectedPoint> nearest =
        gjk(*a.shape, at_a, shape, {Vec3::Zero(), Mat3::Identity()}, max_distance);
    if (!nearest) return;
    feature_b_.points.assign(t.corner.begin(), t.corner.end());
    feature_b_.normal = up;
    const bool flat = std::abs(up.dot(nearest->normal)) > kSeamCosine;
    if (!flat && sticks_out(t, edges_at(t, nearest->on_b), front)) {
      feature_along(a, at_a, nearest->normal, feature_a_);
      clip_or(*nearest, nearest->normal, max_distance, out);
      return;
    }
    // Flat on the triangle; or at a seam, or through the triangle already, where only its own normal makes sense.
    feature_along(a, at_a, -up, feature_a_);
    clipper_.clip(feature_a_, feature_b_, -up, max_distance, out);
  }

  void polytopes(const Child& a, const Placement& at_a, const Child& b, const Placement& at_b, double max_distance,
                 std::vector<DetectedPoint>& out) {
    place(*a.polytope, at_a, polytope_a_);
    place(*b.polytope, at_b, polytope_b_);
    const SeparatingAxes axes =
        find_axes(polytope_a_, polytope_b_, max_distance, kFacePreference * std::min(a.inner_extent, b.inner_extent));
    touch(axes, max_distance, out);
    if (out.empty() && axes.best.separation < 0) by_gjk(a, at_a, b, at_b, max_distance, out);  // odd corners
  }

  // The points of polytope_a_ and polytope_b_ along the axis found.
  void touch(const SeparatingAxes& axes, double max_distance, std::vector<DetectedPoint>& out) {
    const SeparatingAxis& axis = axes.best.kind == SeparatingAxis::kEdges ? axes.face : axes.best;
    if (axes.best.kind == SeparatingAxis::kNone) return;
    if (axes.best.kind == SeparatingAxis::kEdges) {
      const DetectedPoint p = nearest_on_edges(polytope_a_, axes.best.a, polytope_b_, axes.best.b, axes.best.normal);
      // Edges whose lines cross outside of them do not touch.
      const double beside = kCrossing + slack_beside(max_distance);
      if ((p.on_b - p.on_a - p.distance * p.normal).squaredNorm() < beside * beside) {
        if (p.distance <= max_distance) out.push_back(p);
        return;
      }
    }
    if (axis.kind == SeparatingAxis::kFaceOfA)
      face_of(polytope_a_, axis.a, feature_a_);
    else
      face_along(polytope_a_, axis.normal, feature_a_);
    if (axis.kind == SeparatingAxis::kFaceOfB)
      face_of(polytope_b_, axis.b, feature_b_);
    else
      face_along(polytope_b_, -axis.normal, feature_b_);
    const std::size_t before = out.size();
    clipper_.clip(feature_a_, feature_b_, axis.normal, max_distance, out);
    // The deepest corner need not be one of the face that looks most against the normal.
    double least = HUGE_VAL;
    for (std::size_t i = before; i < out.size(); ++i) least = std::min(least, out[i].distance);
    if (least < axis.separation + kMissed) return;
    const bool of_a = axis.kind == SeparatingAxis::kFaceOfA;
    Feature& corner = of_a ? feature_b_ : feature_a_;
    corner.points = {of_a ? corner_along(polytope_b_, -axis.normal) : corner_along(polytope_a_, axis.normal)};
    clipper_.clip(feature_a_, feature_b_, axis.normal, max_distance, out);
  }

  // polytope_a_, which is that of `a`, against a triangle with the given normal.
  void polytope_triangle(const Child& a, const Triangle& t, const Vec3& normal, double front, double max_distance,
                         std::vector<DetectedPoint>& out) {
    triangle_polytope(t.corner, normal, polytope_b_);
    const SeparatingAxes axes = find_axes(polytope_a_, polytope_b_, max_distance, kFacePreference * a.inner_extent);
    const SeparatingAxis& axis = axes.best;
    if (axis.kind == SeparatingAxis::kNone) return;
    const Vec3 up = front * normal;
    unsigned edges = 0;  // of the triangle, that are touched
    if (axis.kind == SeparatingAxis::kFaceOfA)
      edges = std::abs(up.dot(axis.normal)) > kSeamCosine ? 0 : edges_along(t, -axis.normal);
    else if (axis.kind == SeparatingAxis::kEdges)
      edges = 1u << axis.b / 2;
    else if (axis.b >= 2)
      edges = 1u << (axis.b - 2);
    if (edges != 0 && sticks_out(t, edges, front)) {
      touch(axes, max_distance, out);
      return;
    }
    face_along(polytope_a_, -up, feature_a_);
    feature_b_.points.assign(t.corner.begin(), t.corner.end());
    feature_b_.normal = up;
    clipper_.clip(feature_a_, feature_b_, -up, max_distance, out);
  }

  btVoronoiSimplexSolver simplex_;
  btGjkEpaPenetrationDepthSolver epa_;
  FaceClipper clipper_;
  Feature feature_a_, feature_b_;
  Polytope polytope_a_, polytope_b_;
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
