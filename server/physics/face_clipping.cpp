#include "server/physics/face_clipping.h"

#include <cmath>

#include "server/physics/polytope.h"

namespace soda::physics {
namespace {

constexpr double kClipTolerance = 0.004;  // of a face's size: a corner on its edge counts as on it
constexpr double kUsableFace = 0.2;       // cosine; faces that look further away from the normal are seen from the side
constexpr double kStraight = 0.9999;      // cosine; a face that looks along the normal
constexpr double kSameFacing = 1e-6;      // of two faces that look along the normal as well, a's is clipped against
constexpr double kParallelSine = 0.05;    // lines that cross at a larger angle touch in one point only
constexpr double kLineCosine = 0.1;  // a capsule seen from nearer to its axis than that shows its end, else its side
constexpr double kCapCosine = 0.7;   // a cylinder seen from closer to its axis shows its cap

void box_face(const Child& child, const Placement& at, const Vec3& direction, Feature& f) {
  const Vec3 local = at.rotation.transpose() * direction;
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (std::abs(local[k]) > std::abs(local[axis]) + kSameFacing) axis = k;
  const double side = local[axis] >= 0 ? 1 : -1;
  const int p = (axis + 1) % 3, q = (axis + 2) % 3;
  f.normal = side * at.rotation.col(axis);
  const Vec3 centre = at.position + child.box_half[axis] * f.normal;
  const Vec3 along_p = child.box_half[p] * at.rotation.col(p), along_q = child.box_half[q] * at.rotation.col(q);
  f.points = {centre + along_p + along_q, centre - along_p + along_q, centre - along_p - along_q,
              centre + along_p - along_q};
}

void hull_face(const Child& child, const Placement& at, const Vec3& direction, Feature& f) {
  face_along(*child.polytope, at.rotation.transpose() * direction, f);
  f.normal = at.rotation * f.normal;
  for (Vec3& p : f.points) p = at.position + at.rotation * p;
}

void cylinder_feature(const Child& child, const Placement& at, const Vec3& direction, Feature& f) {
  const Vec3 axis = at.rotation.col(2);
  const double radius = child.radius, cosine = axis.dot(direction), side = cosine >= 0 ? 1 : -1;
  const Vec3 across = direction - cosine * axis;  // from the axis to the rim's furthest point
  const double sine = across.norm();
  if (std::abs(cosine) < kCapCosine) {
    const Vec3 rim = at.position + (radius / sine) * across;
    f.points = {rim + child.half_length * axis, rim - child.half_length * axis};
    return;
  }
  f.normal = side * axis;
  const Vec3 centre = at.position + child.half_length * f.normal;
  // An octagon that starts at the rim's furthest point, so that a tilted cylinder stands on its very rim.
  const Vec3 u = sine > 1e-9 ? Vec3(across / sine) : at.rotation.col(0);
  const Vec3 v = f.normal.cross(u);
  constexpr double kHalf = 0.70710678118654752440;
  constexpr double kOctagon[8][2] = {{1, 0},  {kHalf, kHalf},   {0, 1},  {-kHalf, kHalf},
                                     {-1, 0}, {-kHalf, -kHalf}, {0, -1}, {kHalf, -kHalf}};
  for (const auto& [c, s] : kOctagon) f.points.push_back(centre + radius * (c * u + s * v));
}

// Line against line, nearly parallel: both ends of the stretch along which they run side by side.
void along_both(const Feature& a, const Feature& b, const Vec3& normal, double max_distance,
                std::vector<DetectedPoint>& out) {
  const Vec3 line_a = a.points[1] - a.points[0], line_b = b.points[1] - b.points[0];
  const double square_a = line_a.squaredNorm(), square_b = line_b.squaredNorm();
  if (!(square_a > 0) || !(square_b > 0)) return;
  if (line_a.cross(line_b).squaredNorm() > kParallelSine * kParallelSine * square_a * square_b) return;
  const auto place_on_a = [&](const Vec3& p) { return (p - a.points[0]).dot(line_a) / square_a; };
  double t0 = place_on_a(b.points[0]), t1 = place_on_a(b.points[1]);
  if (t0 > t1) std::swap(t0, t1);
  const double slack = slack_beside(max_distance) / std::sqrt(square_a);
  t0 = std::max(t0, -slack);
  t1 = std::min(t1, 1 + slack);
  if (t0 > t1) return;
  for (const double t : {t0, t1}) {
    const Vec3 on_a = a.points[0] + t * line_a;
    const double s = (on_a - b.points[0]).dot(line_b) / square_b;
    const Vec3 on_b = b.points[0] + s * line_b;
    const double distance = normal.dot(on_b - on_a);
    if (distance <= max_distance) out.push_back({on_a, on_b, normal, distance});
  }
}

}  // namespace

void feature_along(const Child& child, const Placement& at, const Vec3& direction, Feature& f) {
  f.points.clear();
  f.normal = Vec3::Zero();
  switch (child.kind) {
    case ShapeKind::kSphere:
      f.points = {at.position + child.radius * direction};
      break;
    case ShapeKind::kBox:
      box_face(child, at, direction, f);
      break;
    case ShapeKind::kHull:
      hull_face(child, at, direction, f);
      break;
    case ShapeKind::kCapsule: {
      const Vec3 axis = at.rotation.col(2), low = at.position + child.radius * direction;
      const double cosine = axis.dot(direction);
      if (std::abs(cosine) < kLineCosine)
        f.points = {low + child.half_length * axis, low - child.half_length * axis};
      else
        f.points = {low + (cosine > 0 ? child.half_length : -child.half_length) * axis};
      break;
    }
    case ShapeKind::kCylinder:
      cylinder_feature(child, at, direction, f);
      break;
    case ShapeKind::kPlane:
    case ShapeKind::kConcave:
      break;
  }
}

double reach_along(const Child& child, const Placement& at, const Vec3& direction) {
  const Vec3 local = at.rotation.transpose() * direction;
  const double middle = at.position.dot(direction);
  switch (child.kind) {
    case ShapeKind::kSphere:
      return middle + child.radius;
    case ShapeKind::kBox:
      return middle + local.cwiseAbs().dot(child.box_half);
    case ShapeKind::kCapsule:
      return middle + child.radius + child.half_length * std::abs(local.z());
    case ShapeKind::kCylinder:
      return middle + child.radius * local.head<2>().norm() + child.half_length * std::abs(local.z());
    case ShapeKind::kHull: {
      double most = -HUGE_VAL;
      for (const Vec3& v : child.polytope->vertices) most = std::max(most, local.dot(v));
      return middle + most;
    }
    case ShapeKind::kPlane:
    case ShapeKind::kConcave:
      break;
  }
  return HUGE_VAL;
}

void FaceClipper::clip(const Feature& a, const Feature& b, const Vec3& normal, double max_distance,
                       std::vector<DetectedPoint>& out) {
  const double facing_a = a.points.size() >= 3 ? std::abs(a.normal.dot(normal)) : 0;
  const double facing_b = b.points.size() >= 3 ? std::abs(b.normal.dot(normal)) : 0;
  if (std::max(facing_a, facing_b) > kUsableFace) {
    if (facing_a + kSameFacing >= facing_b)
      onto_face(a, b, normal, true, max_distance, out);
    else
      onto_face(b, a, normal, false, max_distance, out);
  } else if (a.points.size() == 2 && b.points.size() == 2) {
    along_both(a, b, normal, max_distance, out);
  }
}

void FaceClipper::onto_face(const Feature& face, const Feature& other, const Vec3& normal, bool face_is_a,
                            double max_distance, std::vector<DetectedPoint>& out) {
  // Sutherland and Hodgman, "Reentrant polygon clipping", 1974, by the prism over the face along the normal.
  ring_ = other.points;
  const std::size_t corners = face.points.size();
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : face.points) middle += p / static_cast<double>(corners);
  // Beside a face that is tilted against the normal its plane sticks out of the body: no slack there.
  double beside = 0;
  if (std::abs(face.normal.dot(normal)) > kStraight) {
    double size = 0;
    for (const Vec3& p : face.points) size = std::max(size, (p - face.points[0]).squaredNorm());
    beside = kClipTolerance * std::sqrt(size) + slack_beside(max_distance);
  }
  for (std::size_t e = 0; e < corners && !ring_.empty(); ++e) {
    const Vec3& from = face.points[e];
    const Vec3 edge = face.points[e + 1 < corners ? e + 1 : 0] - from;
    Vec3 outwards = edge.cross(normal);
    const double length = outwards.norm();
    if (!(length > 0)) continue;
    outwards /= outwards.dot(middle - from) > 0 ? -length : length;
    const double limit = outwards.dot(from) + beside;
    clipped_.clear();
    const std::size_t n = ring_.size();
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3 &p = ring_[i], &q = ring_[i + 1 < n ? i + 1 : 0];
      const double dp = outwards.dot(p) - limit, dq = outwards.dot(q) - limit;
      if (dp <= 0) clipped_.push_back(p);
      // Of two points there is one line only, not one there and one back.
      if (((dp < 0 && dq > 0) || (dp > 0 && dq < 0)) && !(n == 2 && i == 1))
        clipped_.push_back(p + (dp / (dp - dq)) * (q - p));
    }
    ring_.swap(clipped_);
  }
  const double inverse_facing = 1 / face.normal.dot(normal);
  for (const Vec3& p : ring_) {
    // Along the normal onto the face's plane.
    const double distance = (face_is_a ? 1 : -1) * face.normal.dot(p - face.points[0]) * inverse_facing;
    if (distance > max_distance) continue;
    const Vec3 on_face = p - ((face_is_a ? distance : -distance) * normal);
    if (face_is_a)
      out.push_back({on_face, p, normal, distance});
    else
      out.push_back({p, on_face, normal, distance});
  }
}

}  // namespace soda::physics
