#include "server/physics/contact_update.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

Vec3 vec(const double* p) { return Vec3(p[0], p[1], p[2]); }
void store(const Vec3& v, double* p) { p[0] = v.x(), p[1] = v.y(), p[2] = v.z(); }
void store(const Quat& q, double* p) { p[0] = q.x(), p[1] = q.y(), p[2] = q.z(), p[3] = q.w(); }

constexpr std::uint32_t kGroupMask = 0xff;
constexpr double kSameNormal = 0.99;      // cosine; points whose normals agree this well share a record
constexpr double kSamePointShare = 0.01;  // of the smaller half extent; nearer points are one

// Squared sine of half the angle by which a body has turned since.
double half_sine_squared(const double* then, const Quat& now) {
  const double dot = now.x() * then[0] + now.y() * then[1] + now.z() * then[2] + now.w() * then[3];
  return std::max(0.0, 1 - dot * dot);
}

// Whether points found then still tell where the two touch. Three points and more are a whole face: that has to move
// away or tilt visibly before others matter. One or two points, and those on a surface of triangles, tell nothing of
// the corners further off, which may come down meanwhile: no corner may have moved so far.
bool still_fit(const ContactRecord& record, const Party& a, const Party& b, double limit, bool whole_face) {
  const double moved = (b.position - a.position - vec(record.offset)).squaredNorm();
  const double turned_a = half_sine_squared(record.orientation_a, a.orientation);
  const double turned_b = half_sine_squared(record.orientation_b, b.orientation);
  if (whole_face && record.count >= 3)
    return moved < limit * limit && turned_a < kRecycleHalfSine * kRecycleHalfSine &&
           turned_b < kRecycleHalfSine * kRecycleHalfSine;
  constexpr double kLimit = kRecycleCornerDistance * kRecycleCornerDistance;
  return moved < kLimit && 4 * turned_a * a.radius * a.radius < kLimit && 4 * turned_b * b.radius * b.radius < kLimit;
}

// Of the normal turned back instead of the arms.
double nearest_point(const ContactRecord& record, const Party& a, const Party& b) {
  const auto turned_back = [&](const double* then, const Party& party) -> Vec3 {
    return Quat(then[3], then[0], then[1], then[2]) * (party.orientation.conjugate() * vec(record.normal));
  };
  const Vec3 normal_a = turned_back(record.orientation_a, a), normal_b = turned_back(record.orientation_b, b);
  double nearest = std::numeric_limits<double>::infinity();
  for (std::uint32_t k = 0; k < record.count; ++k)
    nearest = std::min(nearest, normal_b.dot(vec(record.points[k].arm_b)) - normal_a.dot(vec(record.points[k].arm_a)));
  return vec(record.normal).dot(b.position - a.position) + nearest;
}

// A round body rolls away from its anchors; only faces keep theirs, and a cylinder's cap is one.
bool keeps_anchors(ShapeKind kind, std::uint32_t points) {
  return kind != ShapeKind::kSphere && kind != ShapeKind::kCapsule && (kind != ShapeKind::kCylinder || points >= 3);
}

Placement place(const Party& body, const Child& child) {
  if (child.centred) return {body.position, body.rotation};
  return {body.position + body.rotation * child.pose.position, body.rotation * child.rotation};
}

Aabb child_box(const Party& body, const Child& child, double grow) {
  Aabb box = bounding_box(std::span(&child, 1), body.position, body.rotation);
  box.min.array() -= grow;
  box.max.array() += grow;
  return box;
}

// Keeps four points of many: the deepest, the one furthest from it, the one that makes the largest triangle with both,
// and the one furthest outside of that triangle. First come first where equal.
void reduce(std::vector<DetectedPoint>& points) {
  if (points.size() <= kMaxContactPoints) return;
  const Vec3 n = points[0].normal;
  const auto take = [&](std::size_t rank, auto&& score) {
    std::size_t best = rank;
    double best_score = -1e300;
    for (std::size_t i = rank; i < points.size(); ++i)
      if (const double s = score(points[i]); s > best_score) best = i, best_score = s;
    std::swap(points[rank], points[best]);
  };
  take(0, [](const DetectedPoint& p) { return -p.distance; });
  take(1, [&](const DetectedPoint& p) { return (p.on_b - points[0].on_b).squaredNorm(); });
  const Vec3 p0 = points[0].on_b, p1 = points[1].on_b;
  take(2, [&](const DetectedPoint& p) { return std::abs(n.dot((p1 - p0).cross(p.on_b - p0))); });
  const Vec3 p2 = points[2].on_b;
  const double turn = n.dot((p1 - p0).cross(p2 - p0)) < 0 ? -1 : 1;
  take(3, [&](const DetectedPoint& p) {
    const double outside_01 = -turn * n.dot((p1 - p0).cross(p.on_b - p0));
    const double outside_12 = -turn * n.dot((p2 - p1).cross(p.on_b - p1));
    const double outside_20 = -turn * n.dot((p0 - p2).cross(p.on_b - p2));
    return std::max({outside_01, outside_12, outside_20});
  });
  points.resize(kMaxContactPoints);
}

// From how a body's axes lay to how they lie now.
Mat3 turn_since(const double* then, const Mat3& rotation_now) {
  return rotation_now * Quat(then[3], then[0], then[1], then[2]).toRotationMatrix().transpose();
}

// Hands impulses of old points over to new ones at the same place on either body; `lone` where both hold one point of a
// round body, which is the same contact wherever it has rolled.
void match_impulses(ContactRecord& record, const Party& a, const Party& b, std::span<const ContactRecord> previous,
                    bool lone) {
  std::uint32_t used[8] = {};
  const std::size_t records = std::min<std::size_t>(previous.size(), std::size(used));
  for (std::uint32_t i = 0; i < record.count; ++i) {
    ContactPoint& point = record.points[i];
    double best = kMatchDistance * kMatchDistance;
    std::size_t best_record = records;
    std::uint32_t best_point = 0;
    for (std::size_t r = 0; r < records; ++r) {
      const ContactRecord& from = previous[r];
      const Mat3 turn_a = turn_since(from.orientation_a, a.rotation),
                 turn_b = turn_since(from.orientation_b, b.rotation);
      for (std::uint32_t k = 0; k < from.count; ++k) {
        if (used[r] & (1u << k)) continue;
        const double distance = lone ? 0
                                     : std::min((turn_a * vec(from.points[k].arm_a) - vec(point.arm_a)).squaredNorm(),
                                                (turn_b * vec(from.points[k].arm_b) - vec(point.arm_b)).squaredNorm());
        if (distance < best) best = distance, best_record = r, best_point = k;
      }
    }
    if (best_record == records) continue;
    point.impulse = previous[best_record].points[best_point].impulse;
    used[best_record] |= 1u << best_point;
  }
}

}  // namespace

void ContactUpdater::update(const Party& a, const Party& b, std::span<const ContactRecord> previous,
                            double max_distance, std::vector<ContactRecord>& out) {
  const double limit = std::min(kRecycleDistance, kRecycleExtentShare * std::min(a.inner_extent, b.inner_extent));
  const bool compound = a.children.size() > 1 || b.children.size() > 1;
  for (std::uint32_t i = 0; i < a.children.size(); ++i) {
    Aabb box_a;
    if (compound) box_a = child_box(a, a.children[i], max_distance);
    for (std::uint32_t j = 0; j < b.children.size(); ++j) {
      if (compound && !box_a.overlaps(child_box(b, b.children[j], 0))) continue;
      // This child pair's old records: a run in canonical order.
      const std::uint32_t pair = child_pair(i, j);
      std::size_t first = 0;
      while (first < previous.size() && (previous[first].part & ~kGroupMask) < pair) ++first;
      std::size_t end = first;
      while (end < previous.size() && (previous[end].part & ~kGroupMask) == pair) ++end;
      const auto old = previous.subspan(first, end - first);
      if (!old.empty() && keeps_anchors(a.children[i].kind, old[0].count) &&
          keeps_anchors(b.children[j].kind, old[0].count) &&
          still_fit(old[0], a, b, limit, b.children[j].kind != ShapeKind::kConcave)) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const ContactRecord& record : old) nearest = std::min(nearest, nearest_point(record, a, b));
        if (nearest <= max_distance) {
          out.insert(out.end(), old.begin(), old.end());
          ++counters.recycled;
          continue;
        }
      }
      detect(a, i, b, j, old, max_distance, out);
    }
  }
}

void ContactUpdater::detect(const Party& a, std::uint32_t child_a, const Party& b, std::uint32_t child_b,
                            std::span<const ContactRecord> previous, double max_distance,
                            std::vector<ContactRecord>& out) {
  ++counters.detected;
  const Child& ca = a.children[child_a];
  const Child& cb = b.children[child_b];
  const Placement at_a = place(a, ca), at_b = place(b, cb);
  detector_.detect(ca, at_a, cb, at_b, max_distance, points_);
  if (points_.empty()) return;
  const bool sphere = ca.kind == ShapeKind::kSphere || cb.kind == ShapeKind::kSphere;
  const double same = kSamePointShare * std::min(ca.inner_extent, cb.inner_extent);
  for (std::uint32_t group = 0; !points_.empty() && group <= kGroupMask; ++group) {
    const Vec3 normal = points_[0].normal;
    group_.clear();
    std::size_t kept = 0;
    for (const DetectedPoint& p : points_) {
      if (normal.dot(p.normal) < kSameNormal) {
        points_[kept++] = p;
        continue;
      }
      const bool doubled = std::any_of(group_.begin(), group_.end(), [&](const DetectedPoint& o) {
        return (o.on_b - p.on_b).squaredNorm() < same * same && (o.on_a - p.on_a).squaredNorm() < same * same;
      });
      if (!doubled) group_.push_back(p);
    }
    points_.resize(kept);
    reduce(group_);
    ContactRecord record;
    record.a = a.key;
    record.b = b.key;
    record.part = child_pair(child_a, child_b) | group;
    record.count = static_cast<std::uint32_t>(group_.size());
    store(normal, record.normal);
    store(b.position - a.position, record.offset);
    store(a.orientation, record.orientation_a);
    store(b.orientation, record.orientation_b);
    for (std::uint32_t i = 0; i < record.count; ++i) {
      store(group_[i].on_a + (at_a.position - a.position), record.points[i].arm_a);
      store(group_[i].on_b + (at_a.position - b.position), record.points[i].arm_b);
    }
    const bool lone = sphere && record.count == 1 && previous.size() == 1 && previous[0].count == 1;
    match_impulses(record, a, b, previous, lone);
    for (const ContactRecord& old : previous)
      if (old.part == record.part) {
        std::copy(std::begin(old.friction), std::end(old.friction), record.friction);
        record.twist = old.twist;
      }
    out.push_back(record);
  }
}

}  // namespace soda::physics
