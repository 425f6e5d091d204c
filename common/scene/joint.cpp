#include "common/scene/joint.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <tuple>
#include <utility>

#include "common/grid.h"
#include "common/scene/scene.h"

namespace soda {
namespace {

constexpr double kSlackShare = 0.5;   // of the smaller body's bounding radius
constexpr double kLeastSlack = 0.02;  // m

double radius_of(const Scene& scene, BodyId id) {
  const Body* const body = find_body(scene, id);
  return body && !body->is_static ? bounding_radius(scene, *body) : HUGE_VAL;
}

bool is_dynamic(const Scene& scene, BodyId id) {
  const Body* const body = find_body(scene, id);
  return body && !body->is_static;
}

// The shortest turn that takes z, or x, to a unit vector. From IEEE operations only: generated scenes are to have the
// same bits everywhere.
Quat turn_to(bool from_x, Vec3 axis) {
  // Of an axis that points back, the nearer end of its line is turned to, after half a turn about y: exact either way.
  const bool back = (from_x ? axis.x() : axis.z()) < 0;
  if (back) axis = -axis;
  const Quat turn =
      from_x ? Quat(1 + axis.x(), 0, 0 - axis.z(), axis.y()) : Quat(1 + axis.z(), 0 - axis.y(), axis.x(), 0);
  return back ? normalized(turn) * Quat(0, 0, 1, 0) : normalized(turn);
}

// As long as a unit quaternion may be for a scene's reader to keep its bits.
Quat kept_unit(const Quat& q) { return std::abs(q.squaredNorm() - 1) <= 1e-12 ? q : normalized(q); }

}  // namespace

const char* name_of(JointKind kind) {
  static const char* const names[] = {"fixed", "ball", "hinge", "slider", "distance", "universal"};
  const auto index = static_cast<std::size_t>(kind);
  return index < std::size(names) ? names[index] : "kind";
}

Pose joint_frame(JointKind kind, const Vec3& at, const Vec3& axis) {
  return {at, turn_to(kind == JointKind::kSlider, axis / std::sqrt(axis.squaredNorm()))};
}

Pose universal_frame(const Vec3& at, const Vec3& axis_a, const Vec3& axis_b) {
  const Pose along = joint_frame(JointKind::kSlider, at, axis_a);
  // A turn about x, by the half angle's sine and cosine: IEEE operations only.
  const Vec3 side = along.orientation.conjugate() * axis_b;
  const double length = std::sqrt(side.y() * side.y() + side.z() * side.z());
  const double y = side.y() / length, z = side.z() / length;
  const Quat turn = y >= 0 ? Quat(1 + y, z, 0, 0) : Quat(z, 1 - y, 0, 0);
  return {at, kept_unit(along.orientation * normalized(turn))};
}

Pose frame_in(const Pose& pose, const Pose& frame) {
  const Quat back = pose.orientation.conjugate();
  return {back * (frame.position - pose.position), kept_unit(back * frame.orientation)};
}

void turn_round(Joint& joint) {
  std::swap(joint.a, joint.b);
  std::swap(joint.frame_a, joint.frame_b);
  if (joint.kind == JointKind::kDistance) return;
  if (joint.kind == JointKind::kUniversal) {
    // x and y change their parts: half a turn about the line between them.
    constexpr double kHalf = std::numbers::sqrt2 / 2;
    for (Pose* frame : {&joint.frame_a, &joint.frame_b})
      frame->orientation = kept_unit(frame->orientation * Quat(0, kHalf, kHalf, 0));
    return;
  }
  // 0 - x, so that 0 stays 0 and not -0.
  if (joint.limits) joint.limits = JointLimits{0 - joint.limits->upper, 0 - joint.limits->lower};
  if (joint.motor) joint.motor->target_velocity = 0 - joint.motor->target_velocity;
}

void order_ends(const Scene& scene, Joint& joint) {
  if (is_dynamic(scene, joint.b) && (!is_dynamic(scene, joint.a) || joint.a > joint.b)) turn_round(joint);
}

double joint_slack(const Scene& scene, const Joint& joint) {
  return std::max(kLeastSlack, kSlackShare * std::min(radius_of(scene, joint.a), radius_of(scene, joint.b)));
}

double joint_reach_a(const Scene& scene, const Joint& joint) {
  double travel = 0;
  if (joint.kind == JointKind::kSlider || joint.kind == JointKind::kDistance)
    if (joint.limits) travel = std::max(std::abs(joint.limits->lower), std::abs(joint.limits->upper));
  return joint_slack(scene, joint) + travel;
}

double joint_reach_b(const Scene& scene, const Joint& joint) { return joint_slack(scene, joint); }

void finish_joints(Scene& scene) {
  std::stable_sort(scene.joints.begin(), scene.joints.end(),
                   [](const Joint& l, const Joint& r) { return std::tie(l.a, l.b) < std::tie(r.a, r.b); });
  for (Body& body : scene.bodies) body.joint_reach = 0;
  for (const Joint& joint : scene.joints) {
    Body* const a = find_body(scene, joint.a);
    Body* const b = find_body(scene, joint.b);
    if (!b || b->is_static) continue;  // what does not move is known to all
    const auto reach = [](Body* body, const Pose& frame, double beyond) {
      if (!body || body->is_static) return;
      body->joint_reach = std::max(body->joint_reach, (frame.position - body->inertial.centre).norm() + beyond);
    };
    reach(a, joint.frame_a, joint_reach_a(scene, joint));
    reach(b, joint.frame_b, joint_reach_b(scene, joint));
  }
}

}  // namespace soda
