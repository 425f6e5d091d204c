#include <algorithm>
#include <cmath>
#include <tuple>

#include "common/scene/validate_parts.h"

namespace soda {

using namespace checks;

namespace {

constexpr double kMostCosineOfUniversal = 0.1;

bool has_axis(JointKind kind) {
  return kind == JointKind::kHinge || kind == JointKind::kSlider || kind == JointKind::kDistance;
}

bool is_angle(JointKind kind) { return kind == JointKind::kHinge || kind == JointKind::kBall; }

MaybeProblem limits_problem(const std::string& field, JointKind kind, const JointLimits& limits) {
  const double most = is_angle(kind) ? kMaxAngle : kMaxSize;
  const double least = kind == JointKind::kDistance ? 0 : -most;
  const char* unit = is_angle(kind) ? " rad" : " m";
  if (auto p = in_range(field + ".lower", limits.lower, least, most, unit)) return p;
  if (auto p = in_range(field + ".upper", limits.upper, least, most, unit)) return p;
  if (!(limits.lower <= limits.upper))
    return Problem{field + ".upper",
                   "must not be below lower, is " + number(limits.upper) + " below " + number(limits.lower)};
  if (kind == JointKind::kDistance && limits.upper == 0)
    return Problem{field + ".upper", "must be positive, is 0: a ball joint holds two places together"};
  return {};
}

MaybeProblem motor_problem(const std::string& field, JointKind kind, const JointMotor& motor) {
  const double most = is_angle(kind) ? kMaxSpin : kMaxSpeedLimit;
  if (auto p =
          in_range(field + ".target_velocity", motor.target_velocity, -most, most, is_angle(kind) ? " rad/s" : " m/s"))
    return p;
  return in_range(field + ".max_effort", motor.max_effort, 0, kMaxEffort, is_angle(kind) ? " N m" : " N");
}

MaybeProblem spring_problem(const std::string& field, const JointSpring& spring) {
  if (auto p = in_range(field + ".frequency", spring.frequency, 0, kMaxFrequency, " Hz")) return p;
  if (spring.frequency == 0) return Problem{field + ".frequency", "must be positive, is 0"};
  return in_range(field + ".damping_ratio", spring.damping_ratio, 0, kMaxDampingRatio);
}

bool can_turn(const Body& body) { return !body.is_static && !body.motion && !body.fixed_rotation; }

MaybeProblem ends_problem(const Scene& scene, const Joint& joint) {
  const Body* const a = find_body(scene, joint.a);
  if (!a) return Problem{"body_a", "names no body of this scene: " + std::to_string(joint.a)};
  if (a->is_static) return Problem{"body_a", "must be a dynamic body"};
  const Body* const b = find_body(scene, joint.b);
  if (joint.b != kWorldBody && !b) return Problem{"body_b", "names no body of this scene: " + std::to_string(joint.b)};
  if (a == b) return Problem{"body_b", "must be another body than body_a"};
  if (b && !b->is_static && joint.b < joint.a) return Problem{"body_b", "must have a higher id than body_a"};
  if (a->motion && (!b || b->is_static || b->motion)) return Problem{"", "neither of its bodies can be moved by it"};
  // Nothing but a distance and a ball joint without limits does without turning one of its bodies.
  const bool turns =
      joint.kind != JointKind::kDistance && (joint.kind != JointKind::kBall || joint.limits || joint.cone_limit);
  if (turns && !can_turn(*a) && (!b || !can_turn(*b)))
    return Problem{"", "neither of its bodies can be turned by it (fixed_rotation)"};
  const Vec3 place_a = (a->pose * joint.frame_a).position;
  const Vec3 place_b = b ? (b->pose * joint.frame_b).position : joint.frame_b.position;
  const double apart = (place_a - place_b).norm(), most = joint_reach_a(scene, joint) + joint_reach_b(scene, joint);
  if (joint.kind == JointKind::kUniversal) {
    const Quat turn_b = b ? b->pose.orientation * joint.frame_b.orientation : joint.frame_b.orientation;
    const double cosine = (a->pose.orientation * joint.frame_a.orientation * Vec3::UnitX()).dot(turn_b * Vec3::UnitY());
    if (!(std::abs(cosine) <= kMostCosineOfUniversal))
      return Problem{
          "universal",
          "x of frame a and y of frame b must be at right angles (within 6 degrees); the cosine of their angle is " +
              number(cosine)};
  }
  if (!(apart <= most))
    return Problem{"", "the bodies are " + number(apart) + " m apart at this joint; at most " + number(most) + " m"};
  return {};
}

}  // namespace

std::optional<Problem> problem_in(const Joint& joint) {
  if (auto p = name_problem(joint.name)) return p;
  if (joint.kind > JointKind::kUniversal) return Problem{"", "is of no known kind"};
  if (auto p = pose_problem("frame_a", joint.frame_a)) return p;
  if (auto p = pose_problem("frame_b", joint.frame_b)) return p;
  const std::string kind = name_of(joint.kind);
  const std::string limits = kind + (joint.kind == JointKind::kBall ? ".twist_limits" : ".limits");
  if (joint.limits) {
    if (joint.kind == JointKind::kFixed || joint.kind == JointKind::kUniversal) return Problem{kind, "has no limits"};
    if (auto p = limits_problem(limits, joint.kind, *joint.limits)) return p;
  } else if (joint.kind == JointKind::kSlider || joint.kind == JointKind::kDistance) {
    return Problem{limits, "must be given"};
  }
  if (joint.cone_limit) {
    if (joint.kind != JointKind::kBall) return Problem{kind, "has no cone limit: only a ball joint has"};
    if (auto p = in_range("ball.cone_limit", *joint.cone_limit, 0, kMaxAngle, " rad")) return p;
    if (*joint.cone_limit == 0) return Problem{"ball.cone_limit", "must be positive, is 0"};
  }
  if (joint.motor) {
    if (!has_axis(joint.kind)) return Problem{kind, "has no motor: only a hinge, a slider and a distance have"};
    if (auto p = motor_problem(kind + ".motor", joint.kind, *joint.motor)) return p;
  }
  if (joint.spring && joint.kind == JointKind::kUniversal) return Problem{kind, "has no spring"};
  return joint.spring ? spring_problem(kind + ".spring", *joint.spring) : std::nullopt;
}

std::string joint_field(std::size_t number, const std::string& name, const std::string& field) {
  std::string text = "joint[" + std::to_string(number) + "]";
  if (!name.empty()) text += " \"" + name + "\"";
  return field.empty() ? text : text + "." + field;
}

std::optional<JointProblem> checks::problem_in_joints(const Scene& scene) {
  std::size_t of_pair = 0;
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint& joint = scene.joints[j];
    const auto problem = [&](const Problem& p) { return JointProblem{j, p.field, p.reason}; };
    if (auto p = problem_in(joint)) return problem(*p);
    if (auto p = ends_problem(scene, joint)) return problem(*p);
    const Joint* const before = j > 0 ? &scene.joints[j - 1] : nullptr;
    if (before && std::tie(before->a, before->b) > std::tie(joint.a, joint.b))
      return problem({"body_a", "joints must be in ascending order of their bodies"});
    of_pair = before && before->a == joint.a && before->b == joint.b ? of_pair + 1 : 1;
    if (of_pair > kMaxJointsOfPair)
      return problem({"body_b", "two bodies have at most " + std::to_string(kMaxJointsOfPair) + " joints"});
  }
  return {};
}

}  // namespace soda
