// Joints of SDF models.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <sdf/JointAxis.hh>
#include <sdf/sdf.hh>

#include "common/import/sdf_model.h"
#include "common/import/sdf_pose.h"
#include "common/scene/validate.h"

namespace soda {
namespace {

constexpr double kNoLimit = 1e16;  // from there on SDF means none
constexpr double kAcross = 1e-3;   // cosine of two axes at right angles, at most

JointKind kind_of(const sdf::Joint& joint, std::string& reason) {
  switch (joint.Type()) {
    case sdf::JointType::REVOLUTE:
    case sdf::JointType::CONTINUOUS:
      return JointKind::kHinge;
    case sdf::JointType::PRISMATIC:
      return JointKind::kSlider;
    case sdf::JointType::UNIVERSAL:
      return JointKind::kUniversal;
    case sdf::JointType::BALL:
      return JointKind::kBall;
    case sdf::JointType::FIXED:
      return JointKind::kFixed;
    default:
      reason = "\"" + (joint.Element() ? joint.Element()->Get<std::string>("type") : "this") +
               "\" is not simulated; revolute, continuous, prismatic, ball, fixed and universal are";
      return JointKind::kFixed;
  }
}

}  // namespace

void SdfModelConverter::add_joints(const sdf::Model& model, const std::string& scope) {
  for (std::uint64_t j = 0; j < model.JointCount(); ++j) add_joint(*model.JointByIndex(j), scope);
  for (std::uint64_t m = 0; m < model.ModelCount(); ++m)
    add_joints(*model.ModelByIndex(m), scope + model.ModelByIndex(m)->Name() + "::");
}

// 0 for the world.
BodyId SdfModelConverter::find_link(const std::string& name, const std::string& place, const char* end) const {
  const auto it = std::find_if(bodies_.begin(), bodies_.end(), [&](const Body& body) { return body.name == name; });
  if (it == bodies_.end())
    fail(place, end, "link \"" + top_ + "::" + name + "\" has nothing that collides, so it is no body to be joined");
  return static_cast<BodyId>(it - bodies_.begin()) + 1;
}

void SdfModelConverter::add_joint(const sdf::Joint& from, const std::string& scope) {
  Joint joint;
  joint.name = scope + from.Name();
  const std::string place = "joint \"" + top_ + "::" + joint.name + "\"";
  const auto check = [&](const sdf::Errors& errors, const char* field) {
    if (!errors.empty()) fail(place, field, errors.front().Message());
  };
  std::string reason;
  joint.kind = kind_of(from, reason);
  if (!reason.empty()) fail(place, "type", reason);

  std::string parent, child;
  check(from.ResolveParentLink(parent), "parent");
  check(from.ResolveChildLink(child), "child");
  // SDF measures the child against the parent, as we do b against a.
  joint.a = parent == "world" ? kWorldBody : find_link(scope + parent, place, "parent");
  joint.b = child == "world" ? kWorldBody : find_link(scope + child, place, "child");
  const auto pose_of_end = [&](BodyId end) { return end == kWorldBody ? Pose{} : bodies_[end - 1].pose; };
  const auto moves = [&](BodyId end) { return end != kWorldBody && !bodies_[end - 1].is_static; };
  if (!moves(joint.a) && !moves(joint.b)) {
    warnings_.add("a <joint> between what does not move is left out", top_ + "::" + joint.name, uses_);
    return;
  }

  ignition::math::Pose3d in_child;
  check(from.SemanticPose().Resolve(in_child, child), "pose");
  // In the model, as the poses of the bodies.
  Pose frame = compose(pose_of_end(joint.b), pose_of(in_child));
  const bool has_axis = joint.kind == JointKind::kHinge || joint.kind == JointKind::kSlider;
  const auto direction_of = [&](unsigned index) {
    const std::string field = index == 0 ? "axis" : "axis2";
    const sdf::JointAxis* const axis = from.Axis(index);
    if (!axis) fail(place, field, "must be given");
    ignition::math::Vector3d xyz;
    check(axis->ResolveXyz(xyz), (field + ".xyz").c_str());
    const Vec3 direction = vec3_of(xyz);
    if (!(direction.squaredNorm() > 1e-12 && direction.squaredNorm() < 1e12))
      fail(place, field + ".xyz", "must be a direction");
    return direction;
  };
  const sdf::JointAxis* const axis = from.Axis(0);
  if (has_axis) frame = compose(frame, joint_frame(joint.kind, Vec3::Zero(), direction_of(0)));
  if (joint.kind == JointKind::kUniversal) {
    const Vec3 first = direction_of(0).normalized(), second = direction_of(1).normalized();
    if (std::abs(first.dot(second)) > kAcross) fail(place, "axis2.xyz", "must be across axis.xyz");
    frame = compose(frame, universal_frame(Vec3::Zero(), first, second));
    for (const unsigned index : {0u, 1u})
      if (from.Axis(index)->Lower() > -kNoLimit || from.Axis(index)->Upper() < kNoLimit)
        warnings_.add("the limits of a universal <joint> are left out", top_ + "::" + joint.name, uses_);
  }
  joint.frame_a = frame_in(pose_of_end(joint.a), frame);
  joint.frame_b = frame_in(pose_of_end(joint.b), frame);
  if (from.Type() == sdf::JointType::REVOLUTE) read_hinge_limits(*axis, place, joint);
  if (from.Type() == sdf::JointType::PRISMATIC) {
    if (!(std::abs(axis->Lower()) < kNoLimit && std::abs(axis->Upper()) < kNoLimit))
      fail(place, "axis.limit", "a prismatic joint must have both limits, lower and upper");
    joint.limits = JointLimits{axis->Lower(), axis->Upper()};
  }
  joints_.push_back(std::move(joint));
}

// SDF counts turns; our angle is within half a turn either way. What spans less than a turn is moved there, by turning
// one of the frames.
void SdfModelConverter::read_hinge_limits(const sdf::JointAxis& axis, const std::string& place, Joint& joint) {
  JointLimits limits{axis.Lower(), axis.Upper()};
  if (limits.lower <= -kNoLimit && limits.upper >= kNoLimit) return;
  if (limits.lower > limits.upper) fail(place, "axis.limit.upper", "must not be below lower");
  if (limits.upper - limits.lower >= 2 * std::numbers::pi) {
    warnings_.add("the limits of a revolute <joint> that span a turn or more, or are only one, are left out",
                  top_ + "::" + joint.name, uses_);
    return;
  }
  if (limits.lower < -kMaxAngle || limits.upper > kMaxAngle) {
    const double middle = limits.lower + 0.5 * (limits.upper - limits.lower);
    joint.frame_b.orientation = joint.frame_b.orientation * rotation_of(Vec3(0, 0, -middle));
    limits = JointLimits{limits.lower - middle, limits.upper - middle};
  }
  joint.limits = limits;
}

}  // namespace soda
