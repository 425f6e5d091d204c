// A scene as the simulation uses it: plain values, checked once at the door (validate.h), then trusted.
// Stored as Protobuf (idl/scene.proto, scene_file.h). SI units throughout; z is up in the generators only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/ids.h"
#include "common/math.h"
#include "common/scene/joint.h"

namespace soda {

// ---- geometry: all are centred on their own origin, their axis along z where they have one -------------------------
struct Sphere {
  double radius = 0;  // m
};
struct Box {
  Vec3 size = Vec3::Zero();  // m, full edge lengths
};
struct Capsule {
  double radius = 0, length = 0;  // m; length of the cylindrical part, along z
};
struct Cylinder {
  double radius = 0, length = 0;  // m; along z
};
struct ConvexHull {
  std::vector<Vec3> points;  // m, at least 4, not in one plane
};
struct Plane {                  // static only: the half space below is solid
  Vec3 normal = Vec3::UnitZ();  // unit
};
struct TriangleMesh {                                   // static only
  std::vector<Vec3> vertices;                           // m
  std::vector<std::array<std::uint32_t, 3>> triangles;  // indices into vertices
};
struct HeightField {  // static only; sample (i, j) lies at ((i - (columns-1)/2) spacing_x, (j - (rows-1)/2) spacing_y)
  std::uint32_t columns = 0, rows = 0;  // at least 2 each
  double spacing_x = 0, spacing_y = 0;  // m
  std::vector<double> heights;          // m, row by row (j outer), columns * rows values
};
using Geometry = std::variant<Sphere, Box, Capsule, Cylinder, ConvexHull, Plane, TriangleMesh, HeightField>;

struct Shape {
  std::uint32_t geometry = 0;  // index into Scene::geometries, so that bodies can share large ones
  Pose pose;                   // in the body's frame
};

// ---- bodies ---------------------------------------------------------------------------------------------------------
struct Inertial {
  double mass = 0;              // kg
  Vec3 centre = Vec3::Zero();   // m, centre of mass in the body's frame
  Mat3 inertia = Mat3::Zero();  // kg m^2 about the centre of mass, in the body's axes; symmetric, positive definite
};

// Makes crowds and conveyors: accelerates a body towards a target velocity, within bounds at which it turns round.
// Acts across gravity only (on all components where there is no gravity).
struct Drive {
  Vec3 velocity = Vec3::Zero();  // m/s, target
  double max_acceleration = 0;   // m/s^2
  // Where the body's centre is beyond a bound along an axis and the target points further out, that axis of the target
  // is turned round. No bounds: never.
  std::optional<Aabb> bounds;
};

// Makes a body kinematic: it follows a function of time, whatever it meets. At time t since its start its frame is at
// start + velocity t + amplitude (sin(2 pi frequency t + phase) - sin(phase)), turned by angular_velocity t.
struct PrescribedMotion {
  Vec3 velocity = Vec3::Zero();          // m/s
  Vec3 amplitude = Vec3::Zero();         // m
  double frequency = 0;                  // Hz
  double phase = 0;                      // rad
  Vec3 angular_velocity = Vec3::Zero();  // rad/s, world axes
};

// Of one body: contact records name a pair of shapes in 2 x 12 bits; the last pair means a joint.
constexpr std::size_t kMaxShapes = 4095;

struct Body {
  BodyId id = 0;
  std::string name;  // may be empty; for messages
  bool is_static = false;
  Pose pose;                             // of the body's frame, in the world
  Vec3 linear_velocity = Vec3::Zero();   // m/s, of the centre of mass
  Vec3 angular_velocity = Vec3::Zero();  // rad/s, world frame
  std::vector<Shape> shapes;             // at least one; several are a compound
  Inertial inertial;                     // dynamic bodies only; filled in from shapes and density where not given
  double friction = 0.5;                 // of a pair: sqrt(f1 f2)
  double restitution = 0;                // 0 .. 1; of a pair: the larger
  double linear_damping = 0, angular_damping = 0;  // 1/s
  std::optional<Drive> drive;                      // dynamic bodies only
  std::optional<PrescribedMotion> motion;          // likewise; then nothing else moves it
  bool fixed_rotation = false;                     // likewise, without motion: nothing ever turns it
  double joint_reach = 0;  // m, about the centre of mass, within which its joints act; filled in from them
  // Two bodies collide where each one's groups have a bit in the other's mask.
  std::uint32_t collision_groups = 1, collision_mask = 0xffffffff;
  std::uint32_t colour = 0xb0b0b0ff;  // RGBA, for display
};

// A part of space that one world of a session owns at the start. Of what lies in none the nearest one's world has it;
// of what lies in several the last one's.
struct Territory {
  WorldId world = 0;
  Aabb region;  // m
};

// How joints that hang together by bodies are solved.
enum class JointMethod : std::uint8_t {
  kChosen,    // as a whole unless that would take too long
  kDirect,    // as a whole, however many
  kIterated,  // one after the other
};

struct Scene {
  std::string name;
  Vec3 gravity = Vec3(0, 0, -9.81);  // m/s^2
  double dt = 1.0 / 60;              // s, one step
  std::uint32_t substeps = 0;        // solver sub-steps per step; 0: chosen for each island by its state
  JointMethod joint_method = JointMethod::kChosen;
  bool sleeping = true;                // whether quiet islands may sleep
  double max_speed = 100;              // m/s; faster bodies are clamped, counted and reported
  double territory_cell = 0;           // m, edge of a territory cell; 0: chosen from the bodies (grid.h)
  std::vector<Territory> territories;  // given by hand; empty: chosen (territory.h)
  std::vector<Geometry> geometries;
  std::vector<Body> bodies;   // ascending by id
  std::vector<Joint> joints;  // ascending by a, then b; no joint names a body that is not there
};

// The scene's body of that id, or null.
const Body* find_body(const Scene& scene, BodyId id);
Body* find_body(Scene& scene, BodyId id);

}  // namespace soda
