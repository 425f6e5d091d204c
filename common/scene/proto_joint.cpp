#include "common/scene/proto_joint.h"

#include <algorithm>
#include <cmath>

namespace soda {
namespace {

JointLimits read_limits(const pb::Limits& limits, const std::string& field) {
  refuse_unknown(limits, field);
  return {limits.lower(), limits.upper()};
}

JointSpring read_spring(const pb::Spring& spring, const std::string& field) {
  refuse_unknown(spring, field);
  return {spring.frequency(), spring.damping_ratio()};
}

void read_fixed(const pb::FixedJoint& fixed, Joint& joint) {
  joint.kind = JointKind::kFixed;
  refuse_unknown(fixed, "fixed");
  if (fixed.has_spring()) joint.spring = read_spring(fixed.spring(), "fixed.spring");
}

void read_ball(const pb::BallJoint& ball, Joint& joint) {
  joint.kind = JointKind::kBall;
  refuse_unknown(ball, "ball");
  if (ball.has_cone_limit()) joint.cone_limit = ball.cone_limit();
  if (ball.has_twist_limits()) joint.limits = read_limits(ball.twist_limits(), "ball.twist_limits");
  if (ball.has_spring()) joint.spring = read_spring(ball.spring(), "ball.spring");
}

// Of one freedom: hinge, slider, distance.
template <class Message>
void read_single(const Message& message, JointKind kind, Joint& joint) {
  joint.kind = kind;
  const std::string field = name_of(kind);
  refuse_unknown(message, field);
  if (message.has_limits()) joint.limits = read_limits(message.limits(), field + ".limits");
  if (message.has_motor()) {
    refuse_unknown(message.motor(), field + ".motor");
    joint.motor = JointMotor{message.motor().target_velocity(), message.motor().max_effort()};
  }
  if (message.has_spring()) joint.spring = read_spring(message.spring(), field + ".spring");
}

void read_kind(const pb::Joint& message, Joint& joint) {
  switch (message.kind_case()) {
    case pb::Joint::kFixed:
      return read_fixed(message.fixed(), joint);
    case pb::Joint::kBall:
      return read_ball(message.ball(), joint);
    case pb::Joint::kHinge:
      return read_single(message.hinge(), JointKind::kHinge, joint);
    case pb::Joint::kSlider:
      return read_single(message.slider(), JointKind::kSlider, joint);
    case pb::Joint::kDistance:
      return read_single(message.distance(), JointKind::kDistance, joint);
    case pb::Joint::kUniversal:
      joint.kind = JointKind::kUniversal;
      return refuse_unknown(message.universal(), "universal");
    case pb::Joint::KIND_NOT_SET:
      break;
  }
  throw FieldError("",
                   "is of no kind that this version of SODA knows (fixed, ball, hinge, slider, distance, universal)");
}

// None for the world.
const Body* find_end(const Scene& scene, BodyId id, const char* field) {
  if (id == kWorldBody) return nullptr;
  const Body* const body = find_body(scene, id);
  if (!body) throw FieldError(field, "names no body of this scene: " + std::to_string(id));
  return body;
}

Vec3 place_of(const Body* body, const Pose& frame) { return body ? (body->pose * frame).position : frame.position; }

void write_limits(const JointLimits& limits, pb::Limits* out) {
  out->set_lower(limits.lower);
  out->set_upper(limits.upper);
}

void write_spring(const JointSpring& spring, pb::Spring* out) {
  out->set_frequency(spring.frequency);
  out->set_damping_ratio(spring.damping_ratio);
}

template <class Message>
void write_single(const Joint& joint, Message* out) {
  if (joint.limits) write_limits(*joint.limits, out->mutable_limits());
  if (joint.motor) {
    out->mutable_motor()->set_target_velocity(joint.motor->target_velocity);
    out->mutable_motor()->set_max_effort(joint.motor->max_effort);
  }
  if (joint.spring) write_spring(*joint.spring, out->mutable_spring());
}

}  // namespace

Joint read_joint(const pb::Joint& message, const Scene& scene) {
  refuse_unknown(message, "");
  Joint joint;
  joint.name = message.name();
  joint.bodies_collide = message.bodies_collide();
  read_kind(message, joint);
  if (!message.has_body_a()) throw FieldError("body_a", "must be given");
  joint.a = message.body_a();
  joint.b = message.body_b();
  const Body* const a = find_end(scene, joint.a, "body_a");
  const Body* const b = find_end(scene, joint.b, "body_b");
  if (joint.a == joint.b) throw FieldError("body_b", "must be another body than body_a");
  if ((!a || a->is_static) && (!b || b->is_static))
    throw FieldError("body_a", "neither of the joint's bodies moves: one of them must be dynamic");
  if (message.has_frame_a()) joint.frame_a = read_pose(message.frame_a(), "frame_a");
  if (message.has_frame_b()) joint.frame_b = read_pose(message.frame_b(), "frame_b");
  if (joint.kind == JointKind::kDistance && !joint.limits) {
    const double apart = (place_of(a, joint.frame_a) - place_of(b, joint.frame_b)).norm();
    // Places that are no numbers are found by the checks of what they come from.
    if (!std::isfinite(apart))
      joint.limits = JointLimits{1, 1};
    else
      joint.limits = joint.spring ? JointLimits{0, 2 * apart} : JointLimits{apart, apart};
  }
  if (auto p = problem_in(joint)) throw FieldError(p->field, p->reason);
  order_ends(scene, joint);
  return joint;
}

void write_joint(const Joint& joint, pb::Joint* out) {
  out->set_name(joint.name);
  out->set_body_a(joint.a);
  out->set_body_b(joint.b);
  write_pose(joint.frame_a, out->mutable_frame_a());
  write_pose(joint.frame_b, out->mutable_frame_b());
  out->set_bodies_collide(joint.bodies_collide);
  switch (joint.kind) {
    case JointKind::kFixed:
      out->mutable_fixed();
      if (joint.spring) write_spring(*joint.spring, out->mutable_fixed()->mutable_spring());
      return;
    case JointKind::kBall:
      out->mutable_ball();
      if (joint.cone_limit) out->mutable_ball()->set_cone_limit(*joint.cone_limit);
      if (joint.limits) write_limits(*joint.limits, out->mutable_ball()->mutable_twist_limits());
      if (joint.spring) write_spring(*joint.spring, out->mutable_ball()->mutable_spring());
      return;
    case JointKind::kHinge:
      return write_single(joint, out->mutable_hinge());
    case JointKind::kSlider:
      return write_single(joint, out->mutable_slider());
    case JointKind::kDistance:
      return write_single(joint, out->mutable_distance());
    case JointKind::kUniversal:
      out->mutable_universal();
      return;
  }
}

}  // namespace soda
