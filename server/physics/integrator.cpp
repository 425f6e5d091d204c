#include "server/physics/integrator.h"

#include <algorithm>
#include <cmath>

#include "server/physics/kinematics.h"
#include "server/physics/tuning.h"

namespace soda::physics {

StepConstants::StepConstants(const Scene& scene)
    : dt(scene.dt),
      substeps(scene.substeps),
      gravity(scene.gravity),
      up(scene.gravity.isZero(0) ? Vec3(Vec3::Zero()) : Vec3(-scene.gravity / scene.gravity.norm())),
      max_speed(scene.max_speed),
      sleeping(scene.sleeping),
      quiet_steps_to_sleep(static_cast<std::uint32_t>(std::ceil(kSleepTime / scene.dt))) {}

namespace {

// The drive's target with the axes turned round that the state says, and those that the bounds now ask for.
Vec3 drive_target(const Drive& drive, const Vec3& x, std::uint32_t& flags) {
  Vec3 target = drive.velocity;
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t bit = kDriveReversed << axis;
    double t = flags & bit ? -target[axis] : target[axis];
    if (drive.bounds &&
        ((x[axis] > drive.bounds->max[axis] && t > 0) || (x[axis] < drive.bounds->min[axis] && t < 0))) {
      flags ^= bit;
      t = -t;
    }
    target[axis] = t;
  }
  return target;
}

// Of a product of unit quaternions: a step of Newton's towards 1 / length, without root or division.
Quat kept_unit(const Quat& q) {
  const double scale = 1.5 - 0.5 * (q.x() * q.x() + q.y() * q.y() + q.z() * q.z() + q.w() * q.w());
  return Quat(scale * q.w(), scale * q.x(), scale * q.y(), scale * q.z());
}

void limit_speed(MovingBody& body, double max_speed) {
  const double square = body.v.squaredNorm();
  if (square <= max_speed * max_speed) return;
  body.v *= max_speed / std::sqrt(square);
  body.clamped = true;
}

}  // namespace

Mat3 inverse_inertia_in_world(const BodyModel& model, const Quat& orientation) {
  if (model.isotropic) return model.inverse_inertia;
  const Mat3 rotation = orientation.toRotationMatrix();
  return rotation * model.inverse_inertia * rotation.transpose();
}

void begin_step(const BodyState& state, const BodyModel& model, MovingBody& body) {
  // Never -0: whether it stays so would depend on what is solved in other lanes.
  body.v = state.v() + Vec3::Zero();
  body.w = state.w() + Vec3::Zero();
  body.moved = body.turned = Vec3::Zero();
  body.x = state.x();
  body.q = state.q();
  body.inverse_mass = model.inverse_mass;
  body.inverse_inertia = inverse_inertia_in_world(model, body.q);
  body.model = &model;
  body.clamped = false;
  if (model.drive) {
    std::uint32_t flags = state.flags;
    body.drive_target = drive_target(*model.drive, body.x, flags);
  }
}

void accelerate(MovingBody& body, double h, const StepConstants& constants) {
  const BodyModel& model = *body.model;
  if (model.kinematic) return;
  body.v += h * constants.gravity;
  if (model.drive) {
    Vec3 wanted = body.drive_target - body.v;
    wanted -= constants.up.dot(wanted) * constants.up;
    const double most = model.drive->max_acceleration * h, length = wanted.norm();
    body.v += length > most ? Vec3(wanted * (most / length)) : wanted;
  }
  // Implicit: v' = v - h c v'
  if (model.linear_damping > 0) body.v *= 1 / (1 + h * model.linear_damping);
  if (model.angular_damping > 0) body.w *= 1 / (1 + h * model.angular_damping);
}

void move(MovingBody& body, double h, const StepConstants& constants) {
  limit_speed(body, constants.max_speed);
  body.moved += h * body.v;
  if (body.model->fixed_rotation) return;
  const Vec3 turn = h * body.w;
  body.turned += turn;
  const bool gyroscopic = !body.model->isotropic && turn.squaredNorm() > kGyroscopicAngle * kGyroscopicAngle;
  if (!gyroscopic) {
    body.q = kept_unit(rotation_of(turn) * body.q);
    return;
  }
  // Angular momentum L is kept in the world frame. The implicit midpoint rule on the rotation group: the turn over h is
  // that of w = I(q_half)^-1 L, where q_half = exp(w h / 2) q. Symmetric in time, so that energy does not drift; a
  // fixed number of iterations, so that it is a pure function.
  const Mat3& inertia = body.model->inertia;
  const auto spin_at = [&](const Quat& q, const Vec3& momentum) -> Vec3 {
    return q * (body.model->inverse_inertia * (q.conjugate() * momentum));
  };
  const Vec3 momentum = body.q * (inertia * (body.q.conjugate() * body.w));
  Vec3 w = body.w;
  for (int i = 0; i < kMidpointIterations; ++i) w = spin_at(rotation_of(0.5 * h * w) * body.q, momentum);
  body.q = kept_unit(rotation_of(h * w) * body.q);
  body.w = spin_at(body.q, momentum);
}

void fly(MovingBody& body, std::uint32_t substeps, const StepConstants& constants) {
  const Vec3 before = body.v;
  accelerate(body, constants.dt, constants);
  limit_speed(body, constants.max_speed);
  // The mean of both velocities is exact under constant acceleration.
  body.moved = (0.5 * constants.dt) * (before + body.v);
  const Vec3 after = body.v;
  body.v = Vec3::Zero();  // `move` is for the rotation alone here
  const Vec3 moved = body.moved;
  for (std::uint32_t i = 0; i < substeps; ++i) move(body, constants.dt / substeps, constants);
  body.v = after;
  body.moved = moved;
}

bool end_step(MovingBody& body, const StepConstants& constants, BodyState& state) {
  if (body.model->kinematic) {
    follow(*body.model->kinematic, state.quiet_steps + 1, constants.dt, state);
    return true;
  }
  if (body.model->drive) (void)drive_target(*body.model->drive, body.x, state.flags);
  state.flags &= ~std::uint32_t{kAsleep};
  const Vec3 x = body.x + body.moved;
  const double sum = x.sum() + body.v.sum() + body.w.sum();
  // Of what turns by more than can be counted in a sub-step the quaternion is nothing.
  const bool is_rotation = std::abs(body.q.squaredNorm() - 1) < 1e-9;
  if (!std::isfinite(sum) || !is_rotation) {
    state.set_v(Vec3::Zero());
    state.set_w(Vec3::Zero());
    state.quiet_steps = 0;
    return false;
  }
  limit_speed(body, constants.max_speed);
  state.set_x(x);
  state.set_q(body.q);
  state.set_v(body.v);
  state.set_w(body.w);
  const double r = body.model->reach;
  const bool quiet = body.v.squaredNorm() < kSleepSpeed * kSleepSpeed &&
                     body.w.squaredNorm() * r * r < kSleepSpeed * kSleepSpeed && !body.model->drive;
  state.quiet_steps = quiet ? std::min(state.quiet_steps + 1, constants.quiet_steps_to_sleep) : 0;
  return true;
}

}  // namespace soda::physics
