// What users do to bodies while a session runs, as programs use it: plain values, checked at the door (action_proto.h,
// action_log.h). Scene and action log together are the whole run, to the bit.
#pragma once

#include <cstdint>
#include <memory>
#include <variant>

#include "common/ids.h"
#include "common/math.h"
#include "common/scene/scene.h"

namespace soda {

// Number of an action in a session's log, from 1 on.
using ActionNumber = std::uint64_t;

constexpr Step kMaxActionStep = Step{1} << 40;                 // as of sessions
constexpr std::size_t kMaxActionBytes = std::size_t{4} << 20;  // of an encoded action

struct Push {
  BodyId body = 0;
  Vec3 impulse = Vec3::Zero();  // N s, world axes
  Vec3 point = Vec3::Zero();    // m, from the centre of mass, in the body's axes
};

struct SetVelocity {
  BodyId body = 0;
  Vec3 linear = Vec3::Zero();   // m/s
  Vec3 angular = Vec3::Zero();  // rad/s, world axes
};

// At rest. At the action's step the body is woken, and what it touches with it; from the next step on it is elsewhere.
struct SetPose {
  BodyId body = 0;
  Vec3 position = Vec3::Zero();  // m, of the centre of mass
  Quat orientation = Quat::Identity();
};

constexpr double kDefaultGrabFrequency = 3, kDefaultGrabDamping = 1, kDefaultGrabAcceleration = 200;

struct Grab {
  BodyId body = 0;
  Vec3 point = Vec3::Zero();                           // m, from the centre of mass, in the body's axes
  Vec3 target = Vec3::Zero();                          // m, world
  double frequency = kDefaultGrabFrequency;            // Hz
  double damping_ratio = kDefaultGrabDamping;          // 1 is critical
  double max_acceleration = kDefaultGrabAcceleration;  // m/s^2
};

struct MoveGrab {
  ActionNumber grab = 0;
  Vec3 target = Vec3::Zero();  // m
};

struct Release {
  ActionNumber grab = 0;
};

struct Spawn {
  std::shared_ptr<const Scene> body;  // a scene of that one dynamic body, complete; its id is given in the log
};

// At the action's step the body is woken, and what rests on it with it; from the next step on it is not there.
struct Remove {
  BodyId body = 0;
};

using Action = std::variant<Push, SetVelocity, SetPose, Grab, MoveGrab, Release, Spawn, Remove>;

// An action that has been accepted. State `step` is the one after the actions of that step.
struct LoggedAction {
  ActionNumber number = 0;
  Step step = 0;
  Action action;
};

// "push", "velocity", "pose", "grab", "move", "release", "spawn", "remove".
const char* name_of(const Action& action);

}  // namespace soda
