// A5, A6: sliding and rolling under dry friction.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "bench/accuracy/measures.h"
#include "common/scene/scene_builder.h"

namespace soda::bench {
namespace {

constexpr double kGravity = 9.81;  // m/s^2
constexpr double kMu = 0.5;

// ---- A5: a cube on a slope, and cubes sliding on the level
Scene slope(double angle) {
  SceneBuilder builder("slope");
  const Quat turn(Eigen::AngleAxisd(angle, Vec3::UnitY()));  // x points down the slope
  builder.add(Box{Vec3(1, 1, 1)}, turn * Vec3(0, 0, 0.5), turn).friction = kMu;
  builder.add_static(Box{Vec3(200, 200, 2)}, turn * Vec3(0, 0, -1), turn).friction = kMu;
  return builder.finish();
}

constexpr double kPushed = 5;  // m/s

Scene level() {
  SceneBuilder builder("level");
  for (const double angle : {0.0, 45.0}) {
    const double a = angle / 180 * std::numbers::pi;
    Body& cube = builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, angle == 0 ? 0 : 10, 0.5));
    cube.friction = kMu;
    cube.linear_velocity = kPushed * Vec3(std::cos(a), std::sin(a), 0);
  }
  builder.add_ground(200, kMu);
  return builder.finish();
}

enum Friction { kCreep, kSlide, kStop, kDirections, kFrictionMeasures };

// Errors of a cube that should stay, or slide with a = g (sin - mu cos).
class SlopeProbe : public Probe {
 public:
  SlopeProbe(const Scene& scene, double angle, bool slides)
      : start_(scene.bodies[0].pose.position),
        turn_(scene.bodies[0].pose.orientation),
        angle_(angle),
        slides_(slides) {}
  bool look(double time, Bodies bodies) override {
    const Vec3 moved = turn_.conjugate() * (bodies[0].x() - start_);
    const double along = std::hypot(moved.x(), moved.y());
    if (!slides_) {
      error_ = std::max(error_, along);
    } else if (time > 0) {
      const double exact = 0.5 * kGravity * (std::sin(angle_) - kMu * std::cos(angle_)) * time * time;
      error_ = std::abs(along / exact - 1);  // as of the last look
    }
    return true;
  }
  std::vector<double> errors() const override {
    std::vector<double> e(kFrictionMeasures, kNotMeasured);
    e[slides_ ? kSlide : kCreep] = error_;
    return e;
  }

 private:
  Vec3 start_;
  Quat turn_;
  double angle_;
  bool slides_;
  double error_ = 0;
};

// The way until rest is v^2 / (2 mu g), in each direction.
class LevelProbe : public Probe {
 public:
  explicit LevelProbe(const Scene& scene) : starts_(dynamic_bodies(scene)) {}
  bool look(double, Bodies bodies) override {
    for (int i = 0; i < 2; ++i) way_[i] = displacement(*starts_[i], bodies[i]).aside;
    return true;
  }
  std::vector<double> errors() const override {
    const double exact = kPushed * kPushed / (2 * kMu * kGravity);
    std::vector<double> e(kFrictionMeasures, kNotMeasured);
    e[kStop] = std::max(std::abs(way_[0] / exact - 1), std::abs(way_[1] / exact - 1));
    e[kDirections] = std::abs(way_[0] - way_[1]) / exact;
    return e;
  }

 private:
  std::vector<const Body*> starts_;
  double way_[2] = {0, 0};
};

// ---- A6: balls on a slab that is pulled (SimBenchmark, "rolling")
constexpr double kForce = 150, kSlab = 10, kBall = 1;  // N, kg, kg
constexpr int kBalls = 25;
constexpr double kSlabGround = 0.4, kBallSlab = 0.8;  // friction of the pairs

Scene rolling(const Vec3& direction) {
  SceneBuilder builder("rolling");
  builder.scene.max_speed = 1e5;
  const Box slab_shape{Vec3(20, 20, 1)};
  Body& slab = builder.add(slab_shape, Vec3(0, 0, 0.5));
  slab.inertial = with_mass(mass_of(slab_shape, 1), kSlab);
  slab.friction = kBallSlab;
  // A constant force as a drive that never gets near its speed: it accelerates by its most all the time.
  slab.drive = Drive{.velocity = 1e5 * (1 - 1e-9) * direction, .max_acceleration = kForce / kSlab, .bounds = {}};
  const Inertial ball_inertial = with_mass(mass_of(Sphere{0.5}, 1), kBall);
  for (int i = 0; i < kBalls; ++i) {
    Body& ball = builder.add(Sphere{0.5}, Vec3(2 * (i % 5 - 2), 2 * (i / 5 - 2), 1.5));
    ball.inertial = ball_inertial;
    ball.friction = kBallSlab;
  }
  builder.add_ground(200, kSlabGround * kSlabGround / kBallSlab);  // a pair's is the root of the product
  return builder.finish();
}

// All balls roll without slipping, so slab and balls accelerate evenly:
//   f1 = mu (M + 25 m) g on the slab from below, f2 = ((F - f1) / M) / (3.5 / m + 25 / M) on it from each ball,
//   a_slab = (F - f1 - 25 f2) / M, a_ball = f2 / m.
class RollingProbe : public Probe {
 public:
  explicit RollingProbe(const Vec3& direction) : direction_(direction) {
    const double below = kSlabGround * (kSlab + kBalls * kBall) * kGravity;
    const double ball = (kForce - below) / kSlab / (3.5 / kBall + kBalls / kSlab);
    slab_ = (kForce - below - kBalls * ball) / kSlab;
    ball_ = ball / kBall;
  }
  bool look(double time, Bodies bodies) override {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Vec3 wrong = bodies[i].v() - (i == 0 ? slab_ : ball_) * time * direction_;
      sum_ += wrong.squaredNorm();
      ++count_;
    }
    return true;
  }
  std::vector<double> errors() const override { return {sum_ / count_}; }

 private:
  Vec3 direction_;
  double slab_ = 0, ball_ = 0;  // m/s^2
  double sum_ = 0, count_ = 0;
};

}  // namespace

std::vector<Case> friction_cases() {
  const double steepest = std::atan(kMu);
  const auto on_slope = [](const char* name, double seconds, double angle, bool slides) -> Variant {
    return {name, seconds, [angle](double) { return slope(angle); },
            [angle, slides](const Scene& scene) { return std::make_unique<SlopeProbe>(scene, angle, slides); }};
  };
  const auto pulled = [](const char* name, const Vec3& direction) -> Variant {
    return {name, 4, [direction](double) { return rolling(direction); },
            [direction](const Scene&) { return std::make_unique<RollingProbe>(direction); }};
  };
  return {
      {.id = "A5",
       .name = "incline",
       .measures = {{"creep_m", "way down a slope of .98 of the angle of friction in 10 s", 1e-3},
                    {"slide", "error of the way down 30 degrees in 2 s, relative", 0.02},
                    {"stop", "error of the way until rest on the level, relative", 0.02},
                    {"directions", "that way along x against that at 45 degrees, relative", 0.02}},
       .variants = {on_slope("stick", 10, 0.98 * steepest, false),
                    on_slope("slide", 2, std::numbers::pi / 6, true),
                    {"level", 2, [](double) { return level(); },
                     [](const Scene& scene) { return std::make_unique<LevelProbe>(scene); }}}},
      {.id = "A6",
       .name = "rolling",
       .measures = {{"speed_squares_m2_s2", "squared error of velocity, mean over bodies and time", 1e-6}},
       .variants = {pulled("slanting", Vec3(0.5, std::sqrt(0.75), 0)), pulled("along_y", Vec3::UnitY())}},
  };
}

}  // namespace soda::bench
