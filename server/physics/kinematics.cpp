#include "server/physics/kinematics.h"

#include <cmath>
#include <numbers>

namespace soda::physics {
namespace {

constexpr double kFullTurn = 2 * std::numbers::pi;

Pose pose_at(const Body& body, double time) {
  const PrescribedMotion& motion = *body.motion;
  Pose pose{body.pose.position + time * motion.velocity, normalized(body.pose.orientation)};
  // Whole turns are taken off, so that sines stay exact for days.
  const double cycles = motion.frequency * time;
  double now, then, cosine;
  sin_cos(kFullTurn * (cycles - std::floor(cycles)) + motion.phase, now, cosine);
  sin_cos(motion.phase, then, cosine);
  pose.position += (now - then) * motion.amplitude;
  const double speed = motion.angular_velocity.norm();
  if (!(speed > 0)) return pose;
  const double turns = speed * time / kFullTurn;
  pose.orientation = normalized(
      rotation_of((kFullTurn * (turns - std::floor(turns)) / speed) * motion.angular_velocity) * pose.orientation);
  return pose;
}

}  // namespace

void follow(const Body& body, std::uint32_t steps, double dt, BodyState& state) {
  const Pose now = pose_at(body, steps * dt), next = pose_at(body, (steps + 1.0) * dt);
  const Vec3 x = now.position + now.orientation * body.inertial.centre,
             x_next = next.position + next.orientation * body.inertial.centre;
  state.set_x(x);
  state.set_q(now.orientation);
  state.set_v((x_next - x) / dt);
  state.set_w(body.motion->angular_velocity);
  state.quiet_steps = steps;
}

}  // namespace soda::physics
