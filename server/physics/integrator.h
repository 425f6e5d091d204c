// Moving bodies through time: gravity, drives, damping, rotation. The quaternion is the state; a rotation matrix is
// only ever made from it.
#pragma once

#include <cstdint>

#include "common/body_state.h"
#include "server/physics/model.h"

namespace soda::physics {

// What every island's step needs to know of the scene.
struct StepConstants {
  explicit StepConstants(const Scene& scene);
  double dt;               // s
  std::uint32_t substeps;  // 0: chosen for each island
  Vec3 gravity;            // m/s^2
  Vec3 up;                 // unit, against gravity; zero without gravity
  double max_speed;        // m/s
  bool sleeping;
  std::uint32_t quiet_steps_to_sleep;
};

// A body while it is being stepped.
struct MovingBody {
  // As a Motion (solver_kernel.h).
  alignas(32) Vec3 v;  // m/s
  double v_pad = 0;
  Vec3 w;  // rad/s
  double w_pad = 0;
  Vec3 moved;  // m: sum over the sub-steps so far
  double moved_pad = 0;
  Vec3 turned;  // rad, likewise
  double turned_pad = 0;
  Quat q;                // now
  Vec3 x;                // m, at the start of the step
  double inverse_mass;   // 1/kg
  Mat3 inverse_inertia;  // world frame, at the start of the step
  const BodyModel* model;
  Vec3 drive_target;  // m/s, with the axes turned round; meaningful where the model has a drive
  bool clamped;       // was faster than the scene's largest speed
};

Mat3 inverse_inertia_in_world(const BodyModel& model, const Quat& orientation);  // 1/(kg m²)

// From a state.
void begin_step(const BodyState& state, const BodyModel& model, MovingBody& body);

// v += (gravity, drive, damping) over h seconds.
void accelerate(MovingBody& body, double h, const StepConstants& constants);

// x += v h, q = exp(w h) q; bodies whose inertia is not isotropic keep their angular momentum. Clamps to max_speed.
void move(MovingBody& body, double h, const StepConstants& constants);

// A body that touches nothing: exact ballistic flight over the whole step (without damping and drive), rotation as
// above, in so many sub-steps.
void fly(MovingBody& body, std::uint32_t substeps, const StepConstants& constants);

// Writes the result into `state`, its velocity limited to max_speed whatever contacts made of it, with flags of the
// drive and the quiet counter; returns false where the result is not finite: the body then keeps its pose and stops.
bool end_step(MovingBody& body, const StepConstants& constants, BodyState& state);

}  // namespace soda::physics
