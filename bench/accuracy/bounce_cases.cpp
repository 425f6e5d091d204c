// A4, A7, A8, A16: spheres that fall, collide and bounce.
#include <algorithm>
#include <cmath>

#include "bench/accuracy/measures.h"
#include "common/scene/random.h"
#include "common/scene/scene_builder.h"

namespace soda::bench {
namespace {

void add_ball(SceneBuilder& builder, const Vec3& at, double restitution) {
  static const Inertial inertial = with_mass(mass_of(Sphere{0.1}, kDefaultDensity), 10);
  Body& ball = builder.add(Sphere{0.1}, at);
  ball.inertial = inertial;
  ball.friction = 0;
  ball.restitution = restitution;
}

// ---- A4: balls that bounce for ever
Scene bouncing(double higher) {
  SceneBuilder builder("bouncing");
  for (int i = 0; i < 49; ++i) add_ball(builder, Vec3(i % 7 - 3, i / 7 - 3, 5 + higher * i), 1);
  builder.add_ground(200, 0).restitution = 1;
  return builder.finish();
}

class EnergyProbe : public Probe {
 public:
  explicit EnergyProbe(const Scene& scene) : energy_(scene) {}
  bool look(double, Bodies bodies) override {
    energy_.look(bodies);
    return true;
  }

 protected:
  EnergyWatch energy_;
};

struct BouncingProbe final : EnergyProbe {
  using EnergyProbe::EnergyProbe;
  std::vector<double> errors() const override { return {std::abs(energy_.end()), energy_.rise()}; }
};

// ---- A7, A8: a cube of 6 x 6 x 6 balls falls and runs apart (the "666" of SimBenchmark, J. Hwangbo et al.)
Scene cube_of_balls(double base, double restitution) {
  SceneBuilder builder("666");
  Random random(666);
  for (int i = 0; i < 216; ++i) {
    const Vec3 at = 0.21 * Vec3(i % 6 - 2.5, i / 6 % 6 - 2.5, i / 36) + Vec3(0, 0, base);
    add_ball(builder, at + random.between(Vec3::Zero(), Vec3::Constant(0.001)), restitution);
  }
  builder.add_ground(200, 0).restitution = restitution;
  return builder.finish();
}

class PenetrationProbe : public Probe {
 public:
  explicit PenetrationProbe(const Scene& scene) : penetration_(scene), energy_(scene) {}
  bool look(double, Bodies bodies) override {
    const auto depth = penetration_.of(bodies);
    sum_ += depth.sum_of_squares;
    largest_ = std::max(largest_, depth.largest);
    energy_.look(bodies);
    ++looks_;
    return true;
  }
  std::vector<double> errors() const override { return {sum_ / looks_, energy_.rise(), largest_}; }

 private:
  Penetration penetration_;
  EnergyWatch energy_;
  double sum_ = 0, largest_ = 0, looks_ = 0;
};

struct ElasticProbe final : EnergyProbe {
  using EnergyProbe::EnergyProbe;
  std::vector<double> errors() const override {
    return {energy_.rise(), std::abs(energy_.end()), energy_.mean_square()};
  }
};

// ---- A16: balls shot at a thin wall, at each speed in 40 phases of the step
constexpr double kSpeeds[] = {10, 20, 50, 100, 200, 300, 400, 500};  // m/s
constexpr int kPhases = 40;
constexpr double kWall = 0.02, kShot = 0.05, kUntilHit = 0.1;  // m, m, s

Scene thin_wall(double dt) {
  SceneBuilder builder("thin wall");
  builder.scene.gravity = Vec3::Zero();
  builder.scene.max_speed = 1000;
  for (std::size_t s = 0; s < std::size(kSpeeds); ++s)
    for (int phase = 0; phase < kPhases; ++phase) {
      const double gap = kSpeeds[s] * (kUntilHit + dt * phase / kPhases);
      Body& ball = builder.add(Sphere{kShot}, Vec3(-0.5 * kWall - kShot - gap, phase - 0.5 * kPhases,
                                                   static_cast<double>(s) - 0.5 * std::size(kSpeeds)));
      ball.linear_velocity = Vec3(kSpeeds[s], 0, 0);
      ball.restitution = 1;
    }
  builder.add_static(Box{Vec3(kWall, 100, 100)}, Vec3::Zero()).restitution = 1;
  return builder.finish();
}

class WallProbe : public Probe {
 public:
  explicit WallProbe(const Scene& scene) {
    for (const Body* body : dynamic_bodies(scene)) speeds_.push_back(body->linear_velocity.x());
  }
  bool look(double, Bodies bodies) override {
    tunnelled_ = speed_error_ = 0;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (bodies[i].x().x() > 0)
        ++tunnelled_;
      else
        speed_error_ = std::max(speed_error_, std::abs(bodies[i].v().x() + speeds_[i]) / speeds_[i]);
    }
    return true;
  }
  std::vector<double> errors() const override {
    return {speed_error_, tunnelled_ / static_cast<double>(speeds_.size())};
  }

 private:
  std::vector<double> speeds_;
  double tunnelled_ = 0, speed_error_ = 0;  // as of the last look
};

template <typename P>
auto probe() {
  return [](const Scene& scene) { return std::make_unique<P>(scene); };
}

}  // namespace

std::vector<Case> bounce_cases() {
  return {
      {.id = "A4",
       .name = "bouncing balls",
       .measures = {{"energy_end", "change of energy after 20 s, relative, either way", 0.02},
                    {"energy_rise", "largest rise of energy, relative", 0.01}},
       .variants = {{"staggered", 20, [](double) { return bouncing(0.01); }, probe<BouncingProbe>()},
                    {"level", 20, [](double) { return bouncing(0); }, probe<BouncingProbe>()}},
       .judged_at = {1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 1000}},
      {.id = "A7",
       .name = "666 balls",
       // The best that SimBenchmark reports: RaiSim at 1 ms.
       .measures = {{"depth_squares_m2", "sum over pairs of squared depth, mean over time", 1.35e-4},
                    {"energy_rise", "largest rise of energy, relative", 0.01},
                    {"depth_m", "largest depth"}},
       .variants = {{"plastic", 10, [](double) { return cube_of_balls(0.101, 0); }, probe<PenetrationProbe>()}}},
      {.id = "A8",
       .name = "666 elastic balls",
       .measures = {{"energy_rise", "largest rise of energy, relative", 0.01},
                    {"energy_end", "change of energy after 10 s, relative, either way"},
                    {"energy_squares_J2", "squared change of energy, mean over time"}},
       .variants = {{"elastic", 10, [](double) { return cube_of_balls(1.101, 1); }, probe<ElasticProbe>()}}},
      {.id = "A16",
       .name = "thin wall",
       .measures = {{"speed", "error of the speed after the rebound, relative, largest", 0.05},
                    {"tunnelled", "share of the balls that went through", 0}},
       .variants = {{"shot", 0.3, thin_wall, probe<WallProbe>()}}},
  };
}

}  // namespace soda::bench
