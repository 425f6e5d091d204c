#include "server/physics/actions.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/scene/validate.h"

namespace soda::physics {
namespace {

Vec3 no_longer(const Vec3& v, double most) {
  const double square = v.squaredNorm();
  return square <= most * most ? v : Vec3(v * (most / std::sqrt(square)));
}

void set_limited(BodyState& body, const Model& model, const Vec3& linear, const Vec3& angular) {
  wake(body);
  const Vec3 v = no_longer(linear, model.scene().max_speed);
  const Vec3 w = model.find(body.id)->fixed_rotation ? Vec3(Vec3::Zero()) : no_longer(angular, kMaxSpin);
  if (!std::isfinite(v.sum() + w.sum())) return;
  body.set_v(v);
  body.set_w(w);
}

Mat3 inverse_inertia(const BodyState& body, const BodyModel& m) {
  const Mat3 rotation = body.q().toRotationMatrix();
  return rotation * m.inverse_inertia * rotation.transpose();
}

void apply(BodyState& body, const Model& model, const Vec3& impulse, const Vec3& arm) {
  const BodyModel& m = *model.find(body.id);
  const Vec3 spin = inverse_inertia(body, m) * arm.cross(impulse);
  set_limited(body, model, body.v() + m.inverse_mass * impulse, body.w() + spin);
}

Mat3 cross_matrix(const Vec3& r) {
  Mat3 m;
  m << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
  return m;
}

}  // namespace

void wake(BodyState& body) {
  body.flags &= ~std::uint32_t{kAsleep};
  body.quiet_steps = 0;
}

void push(BodyState& body, const Model& model, const Vec3& impulse, const Vec3& point) {
  apply(body, model, impulse, body.q() * point);
}

void set_velocity(BodyState& body, const Model& model, const Vec3& linear, const Vec3& angular) {
  set_limited(body, model, linear, angular);
}

void pull(BodyState& body, const Model& model, const Spring& spring) {
  const BodyModel& m = *model.find(body.id);
  const double h = model.scene().dt, omega = 2 * std::numbers::pi * spring.frequency;
  const double stiffness = m.mass * omega * omega, damping = 2 * m.mass * spring.damping_ratio * omega;
  const double softness = 1 / (h * (damping + h * stiffness));  // gamma
  const double correction = h * stiffness * softness;           // beta / h
  const Vec3 arm = body.q() * spring.point;
  const Mat3 r = cross_matrix(arm);
  const Mat3 k = (m.inverse_mass + softness) * Mat3::Identity() - r * inverse_inertia(body, m) * r;
  const Vec3 offset = body.x() + arm - spring.target;
  const Vec3 velocity = body.v() + body.w().cross(arm);
  const Vec3 impulse = -(k.inverse() * (velocity + correction * offset));
  apply(body, model, no_longer(impulse, m.mass * spring.max_acceleration * h), arm);
}

BodyState at_rest(BodyId id, const Vec3& position, const Quat& orientation) {
  BodyState body;
  body.id = id;
  body.set_x(position);
  body.set_q(orientation);
  return body;
}

}  // namespace soda::physics
