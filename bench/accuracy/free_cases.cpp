// A1, A2: bodies that touch nothing.
#include <algorithm>
#include <cmath>

#include "bench/accuracy/measures.h"
#include "common/scene/scene_builder.h"

namespace soda::bench {
namespace {

// ---- A1: x = x0 + v0 t + g t^2 / 2
Scene projectile(double) {
  SceneBuilder builder("projectile");
  Body& ball = builder.add(Sphere{0.1}, Vec3::Zero());
  ball.inertial = with_mass(mass_of(Sphere{0.1}, kDefaultDensity), 1);
  ball.linear_velocity = Vec3(10, 0, 10);
  return builder.finish();
}

class ProjectileProbe : public Probe {
 public:
  explicit ProjectileProbe(const Scene& scene) : g_(scene.gravity), v0_(scene.bodies[0].linear_velocity) {}
  bool look(double time, Bodies bodies) override {
    furthest_ = std::max(furthest_, (bodies[0].x() - (time * v0_ + 0.5 * time * time * g_)).norm());
    return true;
  }
  std::vector<double> errors() const override { return {furthest_}; }

 private:
  Vec3 g_, v0_;
  double furthest_ = 0;
};

// ---- A2: a free body with three different moments of inertia
const Vec3 kMoments(1, 2, 3);  // kg m^2

Scene tumbling(const Vec3& spin) {
  SceneBuilder builder("tumbling");
  builder.scene.gravity = Vec3::Zero();
  Body& body = builder.add(Box{Vec3(1, 1, 1)}, Vec3::Zero());
  body.inertial.mass = 1;
  body.inertial.inertia = kMoments.asDiagonal();
  body.angular_velocity = spin;
  return builder.finish();
}

// How often the spin about the middle axis changes its sign within `seconds`: Euler's equations I w' = (I w) x w in
// body axes, by the classical Runge-Kutta method in steps of a tenth of a millisecond.
int exact_flips(Vec3 w, double seconds) {
  const auto rate = [](const Vec3& a) -> Vec3 { return kMoments.cwiseProduct(a).cross(a).cwiseQuotient(kMoments); };
  constexpr double h = 1e-4;
  int flips = 0;
  for (long i = 0; i < std::lround(seconds / h); ++i) {
    const Vec3 k1 = rate(w), k2 = rate(w + 0.5 * h * k1), k3 = rate(w + 0.5 * h * k2), k4 = rate(w + h * k3);
    const double before = w.y();
    w += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    flips += before * w.y() < 0;
  }
  return flips;
}

constexpr double kTumblingSeconds = 60;

class TumblingProbe : public Probe {
 public:
  TumblingProbe(const Scene& scene, bool count_flips)
      : mechanics_(scene), exact_(count_flips ? exact_flips(scene.bodies[0].angular_velocity, kTumblingSeconds) : -1) {}
  bool look(double, Bodies bodies) override {
    const double energy = mechanics_.kinetic(bodies);
    const Vec3 momentum = mechanics_.spin_of(bodies[0], 0);
    const double middle = (bodies[0].q().conjugate() * bodies[0].w()).y();
    if (energy0_ == 0) energy0_ = energy, momentum0_ = momentum, middle_ = middle;
    energy_error_ = std::max(energy_error_, std::abs(energy / energy0_ - 1));
    momentum_error_ = std::max(momentum_error_, (momentum - momentum0_).norm() / momentum0_.norm());
    flips_ += middle * middle_ < 0;
    middle_ = middle;
    return true;
  }
  std::vector<double> errors() const override {
    return {energy_error_, momentum_error_, exact_ < 0 ? kNotMeasured : std::abs(flips_ - exact_)};
  }

 private:
  Mechanics mechanics_;
  int exact_;  // negative: flips are not counted
  int flips_ = 0;
  double energy0_ = 0, middle_ = 0, energy_error_ = 0, momentum_error_ = 0;
  Vec3 momentum0_ = Vec3::Zero();
};

}  // namespace

std::vector<Case> free_cases() {
  const auto tumble = [](const char* name, const Vec3& spin, bool count_flips) -> Variant {
    return {name, kTumblingSeconds, [spin](double) { return tumbling(spin); },
            [count_flips](const Scene& scene) { return std::make_unique<TumblingProbe>(scene, count_flips); }};
  };
  return {
      {.id = "A1",
       .name = "projectile",
       .measures = {{"distance_m", "largest distance from the parabola", 1e-9}},
       .variants = {{"thrown", 2, projectile,
                     [](const Scene& scene) { return std::make_unique<ProjectileProbe>(scene); }}},
       .substeps = {4}},
      {.id = "A2",
       .name = "tumbling",
       .measures = {{"energy", "largest change of energy, relative", 1e-3},
                    {"momentum", "largest change of angular momentum, relative", 1e-10},
                    {"flips_wrong", "flips about the middle axis too many or too few", 0}},
       .variants = {tumble("middle", Vec3(0.01, 5, 0.01), true), tumble("fast", Vec3(2, 2, 20), false)}},
  };
}

}  // namespace soda::bench
