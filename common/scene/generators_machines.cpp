// Machines: what joints and prescribed motions are for.
#include <algorithm>
#include <numbers>
#include <vector>

#include "common/scene/generator_parts.h"

namespace soda::generator {
namespace {

constexpr double kPi = std::numbers::pi;

// One machine of a fixed number of bodies, of which only the first `count` are wanted; joints go with their bodies.
class Machine {
 public:
  Machine(SceneBuilder& builder, Random& chance, const Vec3& middle, std::uint32_t count, std::uint32_t number)
      : random(chance),
        builder_(builder),
        middle_(middle),
        first_(builder.dynamic_count()),
        left_(count),
        number_(number) {}

  // Null where there are enough.
  Body* add(const Geometry& geometry, const Vec3& at, const Quat& orientation = Quat::Identity(),
            double density = 500) {
    if (left_ == 0) return nullptr;
    --left_;
    Body& body = builder_.add(geometry, middle_ + at, orientation, density);
    body.colour = colour(number_ + static_cast<std::uint32_t>(count()));
    return &body;
  }
  // Between the machine's bodies a and b, by number, or a and the world (b < 0). Null where one of them is missing.
  Joint* join(JointKind kind, int a, int b, const Vec3& at, const Vec3& axis = Vec3::UnitZ()) {
    const int there = static_cast<int>(count());
    if (a >= there || b >= there) return nullptr;
    return &builder_.add_joint(kind, first_ + static_cast<std::size_t>(a),
                               b < 0 ? SceneBuilder::kWorld : first_ + static_cast<std::size_t>(b), middle_ + at, axis);
  }

  Random& random;

 private:
  std::size_t count() const { return builder_.dynamic_count() - first_; }
  SceneBuilder& builder_;
  const Vec3 middle_;
  const std::size_t first_;
  std::uint32_t left_, number_;
};

// A chassis on four driven wheels, of which the front ones stop at walls of loose boxes.
void car(Machine& machine, int first, const Vec3& at, double direction) {
  const double speed = direction * (7 + 0.01 * machine.random.below(200));  // rad/s
  const Quat lying = rotation_of(Vec3(kPi / 2, 0, 0));
  machine.add(Box{Vec3(1.4, 0.7, 0.2)}, at + Vec3(0, 0, 0.4));
  for (int wheel = 0; wheel < 4; ++wheel) {
    const Vec3 hub = at + Vec3(wheel % 2 ? 0.5 : -0.5, wheel / 2 ? 0.47 : -0.47, 0.26);
    if (Body* const body = machine.add(Cylinder{0.25, 0.15}, hub, lying)) body->friction = 1;
    if (Joint* const axle = machine.join(JointKind::kHinge, first, first + 1 + wheel, hub, Vec3::UnitY()))
      axle->motor = JointMotor{speed, 30};
  }
}

void cars(Machine& machine) {
  car(machine, 0, Vec3(-1.2, -0.9, 0), 1);
  car(machine, 5, Vec3(1.2, 0.9, 0), -1);
  for (int i = 0; i < 2; ++i) machine.add(Box{Vec3(0.4, 0.4, 0.4)}, Vec3(0.6 - 1.2 * i, -0.9 + 1.8 * i, 0.2));
}

// A chain that swings down from the level, with a ball at its end, and a box in the ball's way.
void swing(Machine& machine) {
  constexpr int kLinks = 10;
  constexpr double kLink = 0.25, kHigh = 3.3;  // m
  const Quat level = rotation_of(Vec3(0, kPi / 2, 0));
  for (int i = 0; i < kLinks; ++i) {
    const Vec3 hinge(i * kLink - 1.2, 0, kHigh);
    machine.add(Capsule{0.05, kLink - 0.1}, hinge + Vec3(0.5 * kLink, 0, 0), level, 2000);
    machine.join(JointKind::kBall, i, i - 1, hinge);
  }
  machine.add(Sphere{0.3}, Vec3(kLinks * kLink - 1.2 + 0.3, 0, kHigh));
  machine.join(JointKind::kBall, kLinks, kLinks - 1, Vec3(kLinks * kLink - 1.2, 0, kHigh));
  machine.add(Box{Vec3(0.5, 0.5, 0.8)}, Vec3(-1.6, 0.001 * machine.random.below(200), 0.4));
}

// An arm that turns for ever, a press, a door on a spring, a weld, a rod, a limb, and loose boxes for them.
void workshop(Machine& machine) {
  if (Body* const arm = machine.add(Box{Vec3(2.4, 0.2, 0.2)}, Vec3(0, 0, 0.3)))
    arm->motion = PrescribedMotion{Vec3::Zero(), Vec3(0, 0, 0.1), 0.5, 0, Vec3(0, 0, 0.01 * machine.random.below(150))};
  machine.add(Box{Vec3(0.5, 0.5, 0.3)}, Vec3(1.8, 1.8, 1.2));
  if (Joint* const press = machine.join(JointKind::kSlider, 1, -1, Vec3(1.8, 1.8, 1.2), Vec3::UnitZ())) {
    press->limits = JointLimits{-0.5, 0.8};  // of the world against the press
    press->motor = JointMotor{0.5, 600};
  }
  machine.add(Box{Vec3(0.8, 0.1, 1)}, Vec3(-1.4, 1.6, 0.6));
  if (Joint* const door = machine.join(JointKind::kHinge, 2, -1, Vec3(-1.8, 1.6, 0.6))) {
    door->limits = JointLimits{-1.5, 1.5};
    door->spring = JointSpring{0.5, 0.3};
  }
  for (int i = 0; i < 2; ++i) machine.add(Box{Vec3(0.4, 0.4, 0.4)}, Vec3(-1.6 + 0.4 * i, -1.6, 0.2));
  machine.join(JointKind::kFixed, 3, 4, Vec3(-1.4, -1.6, 0.2));
  for (int i = 0; i < 2; ++i) machine.add(Sphere{0.2}, Vec3(0.8 + 0.8 * i, -1.6, 0.2));
  if (Joint* const rod = machine.join(JointKind::kDistance, 5, 6, Vec3(0.8, -1.6, 0.2))) {
    rod->frame_b.position = Vec3::Zero();
    rod->limits = JointLimits{0.8, 0.8};
  }
  machine.add(Box{Vec3(0.3, 0.3, 0.6)}, Vec3(0, 1.7, 0.3));
  machine.add(Capsule{0.1, 0.4}, Vec3(0, 1.7, 0.95));
  if (Joint* const shoulder = machine.join(JointKind::kBall, 7, 8, Vec3(0, 1.7, 0.6))) {
    shoulder->cone_limit = 0.6;
    shoulder->limits = JointLimits{-0.4, 0.4};
  }
  for (const Vec3& at : {Vec3(1.8, 1.8, 0.2), Vec3(0.3, 0.9, 0.2), Vec3(-0.3, -0.9, 0.2)})
    machine.add(Box{Vec3(0.4, 0.4, 0.4)}, at);
}

}  // namespace

double add_machines(SceneBuilder& builder, Random& random, std::uint32_t count, const Vec3& middle) {
  constexpr std::uint32_t kBodies = 12;  // of each
  constexpr double kApart = 4.6;         // m: what stands next to each other meets
  const std::uint32_t side = square_side(divide_up(count, kBodies));
  for (std::uint32_t i = 0; i * kBodies < count; ++i) {
    const Vec3 at = middle + kApart * Vec3(i % side - 0.5 * (side - 1), i / side - 0.5 * (side - 1), 0);
    Machine machine(builder, random, at, std::min(kBodies, count - i * kBodies), i);
    (i % 3 == 0 ? cars : i % 3 == 1 ? swing : workshop)(machine);
  }
  return kApart * side;
}

}  // namespace soda::generator
