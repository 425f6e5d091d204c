#include "server/physics/box_box.h"

#include <array>
#include <cmath>

namespace soda::physics {
namespace {

// Of the smaller box's smallest half extent. Faces that are nearly as good as each other, or an edge pair that is
// hardly better than a face, must not take turns from step to step: the earlier candidate stays unless the later one is
// better by this.
constexpr double kFacePreference = 0.02;
// Likewise: a corner on the edge of the other's face counts as on the face.
constexpr double kClipTolerance = 0.004;
constexpr double kParallelEdges = 1e-6;  // squared sine; such edges have no useful cross product
// Squared cosine of 5 deg. Nearer than this to a face's normal, edges are left to the face: it has more points to
// offer.
constexpr double kFaceLike = 0.992;

constexpr double kCrossing = 0.01;  // m, by which edges that touch may miss each other

struct Axis {
  int kind = 0;  // 0: face of a, 1: face of b, 2: edges
  int i = 0, j = 0;
  double separation = -HUGE_VAL;
};

struct Point2 {
  double u, v, depth;  // in the reference face; depth along its normal
};

// The part of a polygon on the side coordinate * sign <= limit; Sutherland and Hodgman, "Reentrant polygon clipping",
// 1974.
template <double Point2::*kCoordinate>
int clip(const Point2* in, int count, double sign, double limit, Point2* out) {
  int kept = 0;
  for (int i = 0; i < count; ++i) {
    const Point2 &p = in[i], &q = in[i + 1 < count ? i + 1 : 0];
    const double dp = sign * (p.*kCoordinate) - limit, dq = sign * (q.*kCoordinate) - limit;
    if (dp <= 0) out[kept++] = p;
    if ((dp < 0 && dq > 0) || (dp > 0 && dq < 0)) {
      const double t = dp / (dp - dq);
      out[kept++] = {p.u + t * (q.u - p.u), p.v + t * (q.v - p.v), p.depth + t * (q.depth - p.depth)};
    }
  }
  return kept;
}

// Face `axis` of the reference box towards the other one. `towards` is the other's centre in the reference's frame,
// `turn` its axes there.
void face_points(const Vec3& half_ref, const Vec3& half_other, const Vec3& towards, const Mat3& turn, int axis,
                 const Placement& at_ref, bool flipped, double tolerance, double max_distance,
                 std::vector<DetectedPoint>& out) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const double side = towards[axis] >= 0 ? 1 : -1;
  // The other's face that looks most against the normal.
  int incident = 0;
  for (int k = 1; k < 3; ++k)
    if (std::abs(turn(axis, k)) > std::abs(turn(axis, incident)) + 1e-9) incident = k;
  const double facing = side * turn(axis, incident) > 0 ? -1 : 1;
  const int p = (incident + 1) % 3, q = (incident + 2) % 3;
  const Vec3 centre = towards + facing * half_other[incident] * turn.col(incident);
  const Vec3 along_p = half_other[p] * turn.col(p), along_q = half_other[q] * turn.col(q);
  std::array<Point2, 8> ring, clipped;
  constexpr double kCorner[4][2] = {{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  for (int k = 0; k < 4; ++k) {
    const Vec3 corner = centre + kCorner[k][0] * along_p + kCorner[k][1] * along_q;
    ring[k] = {corner[u], corner[v], side * corner[axis] - half_ref[axis]};
  }
  const double beside = tolerance + slack_beside(max_distance);
  int count = clip<&Point2::u>(ring.data(), 4, 1, half_ref[u] + beside, clipped.data());
  count = clip<&Point2::u>(clipped.data(), count, -1, half_ref[u] + beside, ring.data());
  count = clip<&Point2::v>(ring.data(), count, 1, half_ref[v] + beside, clipped.data());
  count = clip<&Point2::v>(clipped.data(), count, -1, half_ref[v] + beside, ring.data());
  const Vec3 normal = side * at_ref.rotation.col(axis);  // from the reference to the other
  for (int k = 0; k < count; ++k) {
    if (ring[k].depth > max_distance) continue;
    Vec3 local;
    local[axis] = side * half_ref[axis];
    local[u] = ring[k].u;
    local[v] = ring[k].v;
    const Vec3 on_ref = at_ref.position + at_ref.rotation * local, on_other = on_ref + ring[k].depth * normal;
    if (flipped)
      out.push_back({on_other, on_ref, -normal, ring[k].depth});
    else
      out.push_back({on_ref, on_other, normal, ring[k].depth});
  }
}

// Where edge i of a and edge j of b, of those that look at each other, cross. False where they miss each other.
bool edge_point(const Vec3& half_a, const Placement& at_a, const Vec3& half_b, const Vec3& t, const Mat3& turn, int i,
                int j, double max_distance, std::vector<DetectedPoint>& out) {
  const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
  Vec3 normal;
  normal[i] = 0;
  normal[i1] = -turn(i2, j);
  normal[i2] = turn(i1, j);
  normal /= std::sqrt(normal[i1] * normal[i1] + normal[i2] * normal[i2]);
  if (normal.dot(t) < 0) normal = -normal;
  Vec3 on_a, on_b = t;
  for (int k = 0; k < 3; ++k) on_a[k] = k == i ? 0 : normal[k] > 0 ? half_a[k] : -half_a[k];
  for (int k = 0; k < 3; ++k)
    if (k != j) on_b += (normal.dot(turn.col(k)) > 0 ? -half_b[k] : half_b[k]) * turn.col(k);
  // on_a + s e_i and on_b + r b_j are nearest where the difference is across both edges.
  const double cosine = turn(i, j), scale = 1 / (1 - cosine * cosine);
  const Vec3 gap = on_b - on_a;
  const double along_i = gap[i], along_j = gap.dot(turn.col(j));
  on_a[i] += std::clamp((along_i - cosine * along_j) * scale, -half_a[i], half_a[i]);
  on_b += std::clamp((cosine * along_i - along_j) * scale, -half_b[j], half_b[j]) * turn.col(j);
  const double distance = normal.dot(on_b - on_a);
  const double beside = kCrossing + slack_beside(max_distance);
  if ((on_b - on_a - distance * normal).squaredNorm() > beside * beside) return false;
  out.push_back(
      {at_a.position + at_a.rotation * on_a, at_a.position + at_a.rotation * on_b, at_a.rotation * normal, distance});
  return true;
}

}  // namespace

void box_box(const Vec3& half_a, const Placement& at_a, const Vec3& half_b, const Placement& at_b, double max_distance,
             std::vector<DetectedPoint>& out) {
  const Vec3 between = at_b.position - at_a.position;
  const Vec3 t = at_a.rotation.transpose() * between;           // b's centre in a's frame
  const Mat3 turn = at_a.rotation.transpose() * at_b.rotation;  // b's axes in a's frame
  const Mat3 size = turn.cwiseAbs();
  const double smallest = std::min(half_a.minCoeff(), half_b.minCoeff());
  const double preference = kFacePreference * smallest;

  // Separating axes (S. Gottschalk, M. Lin, D. Manocha, "OBBTree", 1996): the one along which the boxes are furthest
  // apart, or overlap least.
  Axis face, edges;
  const Vec3 face_a = t.cwiseAbs() - half_a - size * half_b;
  for (int i = 0; i < 3; ++i) {
    if (face_a[i] > max_distance) return;
    if (face_a[i] > face.separation + preference) face = {0, i, 0, face_a[i]};
  }
  const Vec3 t_in_b = turn.transpose() * t;
  const Vec3 face_b = t_in_b.cwiseAbs() - half_b - size.transpose() * half_a;
  for (int j = 0; j < 3; ++j) {
    if (face_b[j] > max_distance) return;
    if (face_b[j] > face.separation + preference) face = {1, j, 0, face_b[j]};
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const double squared_sine = 1 - turn(i, j) * turn(i, j);
      if (squared_sine < kParallelEdges) continue;
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      // a_i x b_j in a's frame is (0, -turn(i2, j), turn(i1, j)) on axes (i, i1, i2), and likewise in b's.
      const double steepest = std::max(std::max(size(i1, j), size(i2, j)), std::max(size(i, j1), size(i, j2)));
      const bool face_like = steepest * steepest > kFaceLike * squared_sine;
      const double along = std::abs(t[i2] * turn(i1, j) - t[i1] * turn(i2, j));
      const double reach =
          half_a[i1] * size(i2, j) + half_a[i2] * size(i1, j) + half_b[j1] * size(i, j2) + half_b[j2] * size(i, j1);
      const double separation = (along - reach) / std::sqrt(squared_sine);
      if (separation > max_distance) return;
      if (!face_like && separation > edges.separation) edges = {2, i, j, separation};
    }

  const std::size_t before = out.size();
  const bool edges_first = edges.separation > face.separation + preference;
  if (edges_first && edge_point(half_a, at_a, half_b, t, turn, edges.i, edges.j, max_distance, out)) return;
  const double tolerance = kClipTolerance * smallest;
  if (face.kind == 0)
    face_points(half_a, half_b, t, turn, face.i, at_a, false, tolerance, max_distance, out);
  else
    face_points(half_b, half_a, -t_in_b, turn.transpose(), face.i, at_b, true, tolerance, max_distance, out);
  // The face preferred to nearly touching edges may have nothing in front of it.
  if (out.size() == before && !edges_first && edges.kind == 2)
    edge_point(half_a, at_a, half_b, t, turn, edges.i, edges.j, max_distance, out);
}

}  // namespace soda::physics
