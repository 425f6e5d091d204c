// What users do to a body, as changes of its state. Pure functions; no result is faster than the scene allows.
#pragma once

#include "common/body_state.h"
#include "server/physics/model.h"

namespace soda::physics {

// Not asleep, and as restless as if it had just moved.
void wake(BodyState& body);

// An impulse in N s, world axes, at a point in m from the centre of mass, body axes. All that follow wake the body.
void push(BodyState& body, const Model& model, const Vec3& impulse, const Vec3& point);
void set_velocity(BodyState& body, const Model& model, const Vec3& linear, const Vec3& angular);  // m/s, rad/s

struct Spring {
  Vec3 point = Vec3::Zero();    // m, from the centre of mass, body axes
  Vec3 target = Vec3::Zero();   // m
  double frequency = 0;         // Hz, as if the body hung at its centre of mass, alone
  double damping_ratio = 0;     // 1 is critical
  double max_acceleration = 0;  // m/s^2, of the body's mass
};
// One step's impulse of a spring between the point and the target, as a soft constraint: implicit, so stable at any
// stiffness. E. Catto, "Soft Constraints: Reinventing the Spring", GDC 2011: with k and c of the oscillator,
// gamma = 1 / (h (c + h k)), beta / h = h k gamma.
void pull(BodyState& body, const Model& model, const Spring& spring);

// At rest there, with nothing remembered.
BodyState at_rest(BodyId id, const Vec3& position, const Quat& orientation);

}  // namespace soda::physics
