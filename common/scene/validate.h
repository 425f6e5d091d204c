// The door: what a scene must fulfil before anything is done with it. Everything behind the door trusts it.
#pragma once

#include <cstddef>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "common/scene/scene.h"

namespace soda {

// What is wrong, and where. what() reads
//   scenes/demo.txtpb:14: body 7 "crate": shape[0].box.size.y: must be between 1e-05 and 1e+07 m, is 0
// with the parts left out that do not apply.
struct SceneError : std::runtime_error {
  static constexpr std::size_t kNoBody = static_cast<std::size_t>(-1);

  SceneError(std::string source_, std::string body_, std::string field_, std::string reason_, int line_ = 0,
             std::size_t body_index_ = kNoBody);

  std::string source;  // file name
  std::string body;    // `body 7 "crate"`; empty for the scene's own fields
  std::string field;   // as idl/scene.proto (or SDF) spells it; may be empty
  std::string reason;
  int line = 0;            // in a text file, counted from 1; 0: not known
  std::size_t body_index;  // position among the bodies, for finding the line; kNoBody if none
};

// A field of a part of a scene and what is wrong with it.
struct Problem {
  std::string field, reason;
};

// Limits, all inclusive. Beyond them double precision, Bullet's tolerances or plain sense fail.
constexpr double kMaxCoordinate = 1e7;                   // m: an ulp is 2 nm
constexpr double kMinSize = 1e-5, kMaxSize = 1e7;        // m, of any edge, radius or spacing
constexpr double kMinMass = 1e-9, kMaxMass = 1e12;       // kg
constexpr double kMinGyration = 1e-6;                    // m: sqrt(smallest principal inertia / mass)
constexpr double kMaxGyration = 1e7;                     // m: sqrt(largest principal inertia / mass)
constexpr double kMinDensity = 1e-3, kMaxDensity = 1e6;  // kg/m^3
constexpr double kMaxSpeedLimit = 1e5;                   // m/s, of Scene::max_speed
constexpr double kMaxSpin = 1e5;                         // rad/s
constexpr double kMaxAcceleration = 1e6;                 // m/s^2, of gravity and drives
constexpr double kMinStep = 1e-6, kMaxStep = 1;          // s, of Scene::dt
constexpr unsigned kMaxSubsteps = 64;
constexpr double kMaxFriction = 100;
constexpr double kMaxDamping = 1e4;             // 1/s
constexpr double kMaxAngle = std::numbers::pi;  // rad, of limits of hinges and twists
constexpr double kMaxEffort = 1e18;             // N, N m
constexpr double kMaxFrequency = 1e4;           // Hz, of springs
constexpr double kMaxDampingRatio = 100;
constexpr std::size_t kMaxJointsOfPair = 255;
constexpr std::size_t kMaxNameLength = 1000;  // bytes
constexpr std::size_t kMaxHullPoints = 100'000;

// Throws SceneError for the first thing wrong. `source` is the name that the error shows. `joint_numbers`: of each
// joint, the number that the error shows, where that is not its place in the scene.
void validate(const Scene& scene, std::string_view source, std::span<const std::size_t> joint_numbers = {});

// What validate checks about a shape's geometry; `field` starts with the geometry's kind, as in "box.size.y".
// Convex hulls are also checked for volume, which costs building them.
std::optional<Problem> problem_in(const Geometry& geometry, bool is_static);

// What validate checks about a joint alone, without its bodies; `field` is relative to the joint, as in
// "hinge.limits.lower".
std::optional<Problem> problem_in(const Joint& joint);

// `joint[3] "elbow".hinge.limits`, or `joint[3].hinge.limits` without a name.
std::string joint_field(std::size_t number, const std::string& name, const std::string& field);

// `body 7 "crate"`, or `body 7` without a name.
std::string label_of(const Body& body);

}  // namespace soda
