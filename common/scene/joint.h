// Joints as the simulation uses them: what keeps two bodies, or a body and the world, together.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/ids.h"
#include "common/math.h"

namespace soda {

struct Scene;

enum class JointKind : std::uint8_t {
  kFixed,      // frames stay one
  kBall,       // origins stay one
  kHinge,      // origins and z axes stay one
  kSlider,     // axes stay parallel, b's origin on a's x axis
  kDistance,   // origins stay within limits of each other
  kUniversal,  // origins stay one, a's x axis stays across b's y axis
};

struct JointLimits {
  double lower = 0, upper = 0;  // rad or m
};
struct JointMotor {
  double target_velocity = 0;  // rad/s or m/s
  double max_effort = 0;       // N m or N
};
struct JointSpring {
  double frequency = 0;      // Hz
  double damping_ratio = 0;  // 1 is critical
};

// The angle of a hinge is that of frame b against frame a about their z axis; the travel of a slider that of frame b's
// origin along frame a's x axis.
struct Joint {
  std::string name;  // may be empty; for messages
  JointKind kind = JointKind::kFixed;
  BodyId a = 0;           // a dynamic body
  BodyId b = 0;           // a dynamic body with a higher id, a static one, or 0: the world
  Pose frame_a, frame_b;  // in the bodies' frames
  // Hinge: rad. Slider, distance: m, always given (equal ones are a rod). Ball: the twist about z, rad.
  std::optional<JointLimits> limits;
  std::optional<double> cone_limit;  // ball: rad, between the frames' z axes
  std::optional<JointMotor> motor;   // hinge, slider, distance
  // Fixed, ball: holds softly instead of rigidly. Hinge, slider, distance: pulls towards the middle of the limits, or 0
  // where there are none.
  std::optional<JointSpring> spring;
  bool bodies_collide = false;  // with each other
};

const char* name_of(JointKind kind);  // as idl/scene.proto spells it

// The frame of a joint of that kind at a place, its axis (z; of a slider x) along `axis`, which must not be zero.
Pose joint_frame(JointKind kind, const Vec3& at, const Vec3& axis);
// Of a universal joint: x along `axis_a`, y along `axis_b`, or as near to it as may be; the two must not be parallel.
Pose universal_frame(const Vec3& at, const Vec3& axis_a, const Vec3& axis_b);
// The same frame, given in the world, in that of a body at `pose`.
Pose frame_in(const Pose& pose, const Pose& frame);

// The same joint with its ends changed over: what it measures, where it has a sign, has the other one.
void turn_round(Joint& joint);
// Turns a joint round where it needs it: a is dynamic, and b dynamic with a higher id, or neither. For whoever makes
// scenes; the bodies are there already, ascending by id. What cannot be put right is left for the checks.
void order_ends(const Scene& scene, Joint& joint);

// How far each end looks for the other, m, beyond what the joint's limits allow: worlds look for a joint's other body
// no further away. A joint that is torn further than both ends look does nothing until its bodies are near again.
double joint_slack(const Scene& scene, const Joint& joint);

// Of each end: the sphere about its place, radius in m, within which the other end's place is looked for.
double joint_reach_a(const Scene& scene, const Joint& joint);
double joint_reach_b(const Scene& scene, const Joint& joint);

// Orders the scene's joints (by a, then b, else as they were), and gives Body::joint_reach its value. For whoever makes
// scenes; the bodies are there already, ascending by id.
void finish_joints(Scene& scene);

}  // namespace soda
