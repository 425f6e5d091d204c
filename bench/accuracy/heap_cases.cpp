// A18, A19: many bodies at once.
#include <algorithm>
#include <cmath>

#include "bench/accuracy/measures.h"
#include "common/scene/random.h"
#include "common/scene/scene_builder.h"

namespace soda::bench {
namespace {

// ---- A18: 400 bodies in a shaft of 2 x 2 m
constexpr double kSmall = 0.1, kShaft = 2, kPitSeconds = 5;  // m, radius or half edge; m; s
constexpr int kFilling = 400;

Scene pit(const Geometry& geometry) {
  SceneBuilder builder("pit");
  Random random(18);
  for (int i = 0; i < kFilling; ++i) {
    const Vec3 at = 0.23 * Vec3(i % 8 - 3.5, i / 8 % 8 - 3.5, i / 64) + Vec3(0, 0, 0.15);
    builder.add(geometry, at + random.between(Vec3::Constant(-0.01), Vec3::Constant(0.01)));
  }
  builder.add_ground(200);
  for (int axis = 0; axis < 2; ++axis)
    for (const double side : {-1.0, 1.0}) {
      Vec3 at(0, 0, 2), size(kShaft + 2, kShaft + 2, 4);
      at[axis] = side * 0.5 * (kShaft + 1);
      size[axis] = 1;
      builder.add_static(Box{size}, at);
    }
  return builder.finish();
}

// Looks at the last second for depth, at the last half for motion.
class PitProbe : public Probe {
 public:
  explicit PitProbe(const Scene& scene) : penetration_(scene), energy_(scene) {}
  bool look(double time, Bodies bodies) override {
    energy_.look(bodies);
    const double left = kPitSeconds - time;
    if (left < 1) depth_ = std::max(depth_, penetration_.of(bodies).largest);
    if (left < 0.5) kinetic_ = std::max(kinetic_, energy_.mechanics().kinetic(bodies) / kFilling);
    escaped_ = 0;
    for (const BodyState& body : bodies)
      escaped_ += body.x().z() < 0 || std::max(std::abs(body.x().x()), std::abs(body.x().y())) > 0.5 * kShaft;
    return true;
  }
  std::vector<double> errors() const override { return {depth_ / kSmall, kinetic_, escaped_, energy_.rise()}; }

 private:
  Penetration penetration_;
  EnergyWatch energy_;
  double depth_ = 0, kinetic_ = 0, escaped_ = 0;
};

// ---- A19: two clusters of 27 cubes meet head on, off centre
Scene clusters(double restitution) {
  SceneBuilder builder("clusters");
  builder.scene.gravity = Vec3::Zero();
  const Box cube{Vec3(0.5, 0.5, 0.5)};
  const Inertial unit = mass_of(cube, 1);
  for (const double side : {-1.0, 1.0})
    for (int i = 0; i < 27; ++i) {
      const Vec3 middle(side * 1.2, side * 0.1, side * 0.05);  // one is (.2, .1) m off the other's way
      Body& body = builder.add(cube, middle + 0.51 * Vec3(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1));
      body.inertial = with_mass(unit, 1 + i * 7 % 3);  // 1 to 3 kg
      body.linear_velocity = Vec3(-5 * side, 0, 0);
      body.restitution = restitution;
    }
  return builder.finish();
}

class ClusterProbe : public Probe {
 public:
  explicit ClusterProbe(const Scene& scene) : energy_(scene) {}
  bool look(double time, Bodies bodies) override {
    const Mechanics& m = energy_.mechanics();
    energy_.look(bodies);
    if (time == 0) {
      p0_ = m.momentum(bodies), l0_ = m.angular_momentum(bodies);
      // Of all bodies without their directions: what the errors are relative to.
      for (std::size_t i = 0; i < bodies.size(); ++i) {
        p_scale_ += m.mass(i) * bodies[i].v().norm();
        l_scale_ += m.mass(i) * bodies[i].v().norm() * bodies[i].x().norm();
      }
    }
    p_ = std::max(p_, (m.momentum(bodies) - p0_).norm() / p_scale_);
    l_ = std::max(l_, (m.angular_momentum(bodies) - l0_).norm() / l_scale_);
    return true;
  }
  std::vector<double> errors() const override { return {l_, p_, energy_.rise(), energy_.end() + 1}; }

 private:
  EnergyWatch energy_;
  Vec3 p0_ = Vec3::Zero(), l0_ = Vec3::Zero();
  double p_scale_ = 0, l_scale_ = 0, p_ = 0, l_ = 0;
};

}  // namespace

std::vector<Case> heap_cases() {
  const auto filled = [](const char* name, const Geometry& geometry) -> Variant {
    return {name, kPitSeconds, [geometry](double) { return pit(geometry); },
            [](const Scene& scene) { return std::make_unique<PitProbe>(scene); }};
  };
  const auto meeting = [](const char* name, double restitution) -> Variant {
    return {name, 2, [restitution](double) { return clusters(restitution); },
            [](const Scene& scene) { return std::make_unique<ClusterProbe>(scene); }};
  };
  return {
      {.id = "A18",
       .name = "pit",
       .measures = {{"depth", "largest depth in the last second, against the radius or half edge", 0.05},
                    {"kinetic_J", "kinetic energy per body in the last half second", 1e-3},
                    {"escaped", "bodies outside the shaft at the end", 0},
                    {"energy_rise", "largest rise of energy, relative", 0.01}},
       .variants = {filled("spheres", Sphere{kSmall}), filled("boxes", Box{Vec3::Constant(2 * kSmall)})},
       .most_substeps = 2000,
       .smallest_dt_bullet = 1.0 / 240,
       .goal_ms = 80},
      {.id = "A19",
       .name = "clusters",
       .measures = {{"angular", "largest change of angular momentum, relative", 1e-6},
                    {"linear", "largest change of momentum, relative", 1e-12},
                    {"energy_rise", "largest rise of energy, relative", 1e-9},
                    {"energy_left", "energy at the end, relative"}},
       .variants = {meeting("e03", 0.3), meeting("e10", 1)}},
  };
}

}  // namespace soda::bench
