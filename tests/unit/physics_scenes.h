// Scenes and comparisons for the tests of the step.
#pragma once

#include <string>
#include <vector>

#include "common/body_set.h"
#include "common/scene/scene_builder.h"
#include "server/physics/stepper.h"

namespace soda::physics::test {

// Shapes of every kind that may move, about half a metre wide.
enum class Kind { kSphere, kBox, kCapsule, kCylinder, kHull, kTetrahedron, kTable, kDumbbell, kCount };
const char* name_of(Kind kind);
Body& add_shape(SceneBuilder& builder, Kind kind, const Vec3& position, const Quat& orientation = Quat::Identity());

// All of them in the air, turned at random, above a plane, a bowl of triangles, a wavy height field and a static box.
Scene shapes_scene();
// Small boxes under and on a plank and a slab that are much larger than they.
Scene wide_scene();

// A heavy ball that comes down on the middle of a scene when everything there has gone to sleep.
Scene with_meteor(Scene scene, double height);

// A scene for tests of purity, and what must have happened in it for the test to mean anything.
struct Case {
  const char* name;
  Scene (*make)();
  int steps;
  bool sleeps, wakes;  // some bodies must fall asleep, and wake again, within `steps`
};
const std::vector<Case>& cases();
inline void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

// Empty where equal bit for bit, else the first body or record and field that differ, in hex floats.
std::string first_difference(const BodySet& expected, const BodySet& got);

// What happens in a run, told state by state.
class Watch {
 public:
  void see(const BodySet& set);
  std::size_t most_contacts = 0, most_islands = 0;
  std::size_t slept = 0, woke = 0;  // changes of bodies
 private:
  std::vector<bool> asleep_;
  std::vector<std::uint32_t> parent_;
};

// Steps until `seconds` have passed.
void run(Stepper& stepper, BodySet& set, const Scene& scene, double seconds);

const BodyState& body(const BodySet& set, BodyId id);

// Kinetic and potential energy, J; linear and angular momentum (about the origin).
double energy(const Model& model, const BodySet& set);
Vec3 momentum(const Model& model, const BodySet& set);
Vec3 angular_momentum(const Model& model, const BodySet& set);

}  // namespace soda::physics::test
