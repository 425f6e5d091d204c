// A3, A9, A10, A15: bodies that hang on joints.
#include <algorithm>
#include <cmath>

#include "bench/accuracy/measures.h"
#include "common/scene/scene_builder.h"

namespace soda::bench {
namespace {

constexpr double kG = 9.81;  // m/s^2

// The places that each joint keeps together, of one run.
class Gaps {
 public:
  explicit Gaps(const Scene& scene) {
    const std::vector<const Body*> bodies = dynamic_bodies(scene);
    const auto end = [&](BodyId id, const Pose& frame) -> End {
      for (std::size_t i = 0; i < bodies.size(); ++i)
        if (bodies[i]->id == id) return {i, frame.position - bodies[i]->inertial.centre};
      return {kNobody, frame.position};
    };
    for (const Joint& joint : scene.joints)
      pairs_.push_back({end(joint.a, joint.frame_a), end(joint.b, joint.frame_b)});
  }
  double sum(Bodies bodies) const {  // m
    double sum = 0;
    for (const auto& [a, b] : pairs_) sum += (place(a, bodies) - place(b, bodies)).norm();
    return sum;
  }
  double largest(Bodies bodies) const {  // m
    double largest = 0;
    for (const auto& [a, b] : pairs_) largest = std::max(largest, (place(a, bodies) - place(b, bodies)).norm());
    return largest;
  }

 private:
  static constexpr std::size_t kNobody = static_cast<std::size_t>(-1);
  struct End {
    std::size_t body;
    Vec3 place;  // m, about its centre of mass, or in the world
  };
  static Vec3 place(const End& end, Bodies bodies) {
    return end.body == kNobody ? end.place : Vec3(bodies[end.body].x() + bodies[end.body].q() * end.place);
  }
  std::vector<std::pair<End, End>> pairs_;
};

// ---- A3: a heavy gyroscope in steady precession, its axis level: I w Omega = m g l
constexpr double kArm = 0.2, kSpinInertia = 0.02;  // m, kg m^2
constexpr double kWatched = 10;                    // s

double precession(double spin) { return kG * kArm / (kSpinInertia * spin); }  // rad/s, of 1 kg

Scene gyroscope(double spin) {
  SceneBuilder builder("gyroscope");
  Body& disk = builder.add(Sphere{0.1}, Vec3(kArm, 0, 0));
  disk.inertial.mass = 1;
  disk.inertial.inertia = Vec3(kSpinInertia, 0.01, 0.01).asDiagonal();
  disk.angular_velocity = Vec3(spin, 0, precession(spin));
  disk.linear_velocity = Vec3(0, kArm * precession(spin), 0);
  builder.add_joint(JointKind::kBall, 0, SceneBuilder::kWorld, Vec3::Zero());
  return builder.finish();
}

class GyroscopeProbe : public Probe {
 public:
  explicit GyroscopeProbe(double spin) : rate_(precession(spin)) {}
  bool look(double time, Bodies bodies) override {
    const Vec3 x = bodies[0].x();
    double change = std::atan2(x.y(), x.x()) - azimuth_;
    change -= 2 * M_PI * std::round(change / (2 * M_PI));
    azimuth_ += change;
    if (time > 0) azimuth_error_ = std::abs(azimuth_ / (rate_ * time) - 1);
    tilt_ = std::max(tilt_, std::abs(std::asin(std::clamp(x.z() / x.norm(), -1.0, 1.0))));
    return true;
  }
  std::vector<double> errors() const override { return {azimuth_error_, tilt_}; }

 private:
  double rate_, azimuth_ = 0, azimuth_error_ = 0, tilt_ = 0;
};

// ---- A9: pendulums of 1 kg released level, their centres of mass 1 m from the pivot
Scene pendulum(JointKind kind, double inertia, int links) {
  SceneBuilder builder("pendulum");
  for (int i = 0; i < links; ++i) {
    Body& link = builder.add(Sphere{0.1}, Vec3(i + 1, 0, 0));
    link.inertial.mass = 1;
    link.inertial.inertia = inertia * Mat3::Identity();
  }
  builder.add_joint(kind, 0, SceneBuilder::kWorld, Vec3::Zero(), Vec3::UnitY());
  for (std::size_t i = 1; i < static_cast<std::size_t>(links); ++i)
    builder.add_joint(kind, i - 1, i, Vec3(static_cast<double>(i), 0, 0), Vec3::UnitY());
  return builder.finish();
}

// Of one link: its angle below the horizon by the classical Runge-Kutta method, (I + 1) angle'' = g cos(angle).
class PendulumProbe : public Probe {
 public:
  PendulumProbe(const Scene& scene, double inertia, int links)
      : mechanics_(scene), gaps_(scene), inertia_(inertia), links_(links) {}
  bool look(double time, Bodies bodies) override {
    const double energy = mechanics_.energy(bodies);
    if (time == 0) first_ = energy;
    energy_ = std::max(energy_, std::abs(energy - first_) / (kG * links_));
    gap_ = std::max(gap_, gaps_.largest(bodies));
    if (links_ > 1) return true;
    advance(time);
    double angle = std::atan2(-bodies[0].x().z(), bodies[0].x().x());
    angle -= exact_;
    angle -= 2 * M_PI * std::round(angle / (2 * M_PI));
    angle_ = std::max(angle_, std::abs(angle));
    return true;
  }
  std::vector<double> errors() const override { return {energy_, gap_, links_ > 1 ? kNotMeasured : angle_}; }

 private:
  void advance(double time) {
    const auto acceleration = [&](double a) { return kG * std::cos(a) / (inertia_ + 1); };
    const long steps = std::lround((time - time_) / 1e-5);
    const double h = steps > 0 ? (time - time_) / static_cast<double>(steps) : 0;
    for (long i = 0; i < steps; ++i) {
      const double v1 = rate_, a1 = acceleration(exact_);
      const double v2 = rate_ + 0.5 * h * a1, a2 = acceleration(exact_ + 0.5 * h * v1);
      const double v3 = rate_ + 0.5 * h * a2, a3 = acceleration(exact_ + 0.5 * h * v2);
      const double v4 = rate_ + h * a3, a4 = acceleration(exact_ + h * v3);
      exact_ += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
      rate_ += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    time_ = time;
  }
  Mechanics mechanics_;
  Gaps gaps_;
  double inertia_;
  int links_;
  double first_ = 0, energy_ = 0, gap_ = 0, angle_ = 0;
  double time_ = 0, exact_ = 0, rate_ = 0;
};

// ---- A10: a chain of 20 links with a load at its end
constexpr int kLinks = 20;
constexpr double kLink = 0.2;  // m

Scene chain(double load, bool level) {
  SceneBuilder builder("chain");
  const Vec3 along = level ? Vec3::UnitX() : Vec3(-Vec3::UnitZ());
  const Vec3 pivot(0, 0, (kLinks + 2) * kLink);  // so that the energy is that of the fall
  const Quat turn = level ? rotation_of(Vec3(0, M_PI / 2, 0)) : Quat::Identity();
  for (int i = 0; i < kLinks; ++i) {
    const Capsule link{0.04, kLink - 0.08};
    builder.add(link, pivot + (i + 0.5) * kLink * along, turn).inertial = with_mass(mass_of(link, 1000), 1);
  }
  const Box cube{Vec3(0.4, 0.4, 0.4)};
  builder.add(cube, pivot + (kLinks * kLink + 0.2) * along).inertial = with_mass(mass_of(cube, 1000), load);
  builder.add_joint(JointKind::kBall, 0, SceneBuilder::kWorld, pivot);
  for (std::size_t i = 1; i <= kLinks; ++i)
    builder.add_joint(JointKind::kBall, i - 1, i, pivot + static_cast<double>(i) * kLink * along);
  return builder.finish();
}

class ChainProbe : public Probe {
 public:
  ChainProbe(const Scene& scene, bool judged) : gaps_(scene), energy_(scene), judged_(judged) {}
  bool look(double, Bodies bodies) override {
    last_ = gaps_.sum(bodies) / (kLinks * kLink);
    largest_ = std::max(largest_, last_);
    energy_.look(bodies);
    return true;
  }
  std::vector<double> errors() const override {
    if (judged_) return {largest_, last_, kNotMeasured, energy_.rise()};
    return {kNotMeasured, kNotMeasured, largest_, energy_.rise()};
  }

 private:
  Gaps gaps_;
  EnergyWatch energy_;
  bool judged_;
  double last_ = 0, largest_ = 0;
};

// ---- A15: Newton's cradle, its strings at the balls' centres, so that blows do not turn them
constexpr int kBalls = 5;
constexpr double kBall = 0.1, kString = 1, kLifted = M_PI / 6;  // m, m, rad

Scene cradle(double gap) {
  SceneBuilder builder("cradle");
  for (int i = 0; i < kBalls; ++i) {
    const double pivot = i * (2 * kBall + gap), angle = i == 0 ? kLifted : 0;
    Body& ball = builder.add(Sphere{kBall}, Vec3(pivot - kString * std::sin(angle), 0, -kString * std::cos(angle)));
    ball.restitution = 1;
    ball.friction = 0;
  }
  for (std::size_t i = 0; i < kBalls; ++i)
    builder.add_rod(i, SceneBuilder::kWorld, builder.scene.bodies[i].pose.position,
                    Vec3(static_cast<double>(i) * (2 * kBall + gap), 0, 0));
  return builder.finish();
}

class CradleProbe : public Probe {
 public:
  explicit CradleProbe(const Scene& scene) : mechanics_(scene) {
    arrival_ = std::sqrt(2 * kG * kString * (1 - std::cos(kLifted)));
    met_ = 0.25 * 2 * M_PI * std::sqrt(kString / kG);  // s, about: of small swings
  }
  bool look(double time, Bodies bodies) override {
    double rest = 0;  // J, with all hanging
    for (std::size_t i = 0; i < mechanics_.size(); ++i) rest -= mechanics_.mass(i) * kG * kString;
    const double energy = mechanics_.energy(bodies) - rest;
    if (time == 0) first_ = energy;
    energy_ = energy / first_ - 1;
    rise_ = std::max(rise_, energy_);
    if (time > met_ - 0.02 && time < met_ + 0.1) leaves_ = std::max(leaves_, bodies[kBalls - 1].v().x() / arrival_);
    if (time > met_ + 0.05 && time < met_ + 0.1)
      for (std::size_t i = 0; i + 1 < kBalls; ++i) others_ = std::max(others_, bodies[i].v().norm() / arrival_);
    return true;
  }
  std::vector<double> errors() const override { return {std::abs(1 - leaves_), others_, std::abs(energy_), rise_}; }

 private:
  Mechanics mechanics_;
  double arrival_, met_, first_ = 0, energy_ = 0, rise_ = 0, leaves_ = 0, others_ = 0;
};

}  // namespace

std::vector<Case> joint_cases() {
  const auto spinning = [](const char* name, double spin) -> Variant {
    return {name, kWatched, [spin](double) { return gyroscope(spin); },
            [spin](const Scene&) { return std::make_unique<GyroscopeProbe>(spin); }};
  };
  const auto swinging = [](const char* name, JointKind kind, double inertia, int links) -> Variant {
    return {name, 10, [=](double) { return pendulum(kind, inertia, links); },
            [=](const Scene& scene) { return std::make_unique<PendulumProbe>(scene, inertia, links); }};
  };
  const auto hanging = [](const char* name, double load, bool level) -> Variant {
    return {name, 10, [=](double) { return chain(load, level); },
            [=](const Scene& scene) { return std::make_unique<ChainProbe>(scene, load <= 100); }};
  };
  const auto knocking = [](const char* name, double gap) -> Variant {
    return {name, 20, [gap](double) { return cradle(gap); },
            [](const Scene& scene) { return std::make_unique<CradleProbe>(scene); }};
  };
  return {
      {.id = "A3",
       .name = "gyroscope",
       .measures = {{"azimuth", "error of the angle after 10 s, relative", 0.02},
                    {"tilt_rad", "largest angle of the axis against the horizon", 0.2}},
       .variants = {spinning("spin50", 50), spinning("spin20", 20)}},
      {.id = "A9",
       .name = "pendulums",
       .measures = {{"energy", "largest change of energy over m g L", 0.01},
                    {"gap_m", "largest gap in a joint, of 1 m", 1e-3},
                    {"angle_rad", "largest error of the angle, of one link"}},
       .variants = {swinging("ball", JointKind::kBall, 1.0 / 12, 1), swinging("slim", JointKind::kBall, 0.004, 1),
                    swinging("hinge", JointKind::kHinge, 1.0 / 12, 1),
                    swinging("double", JointKind::kHinge, 1.0 / 12, 2)},
       .goal_ms = 1},
      {.id = "A10",
       .name = "hanging chains",
       .measures = {{"stretch", "largest sum of the gaps over the length, up to 100 kg", 0.01},
                    {"stretch_end", "the same at the end"},
                    {"stretch_1000", "with 1000 kg", 0.01},
                    {"energy_rise", "largest rise of energy, relative", 0.01}},
       .variants = {hanging("1kg", 1, false), hanging("10kg", 10, false), hanging("100kg", 100, false),
                    hanging("1000kg", 1000, false), hanging("level10kg", 10, true)},
       .goal_ms = 6},
      {.id = "A15",
       .name = "Newton cradle",
       .measures = {{"last", "error of the speed of the last ball against the arriving one", 0.05},
                    {"others", "speed of the others, relative", 0.05},
                    {"energy", "change of energy after 20 s, relative", 0.05},
                    {"energy_rise", "largest rise of energy, relative", 0.01}},
       .variants = {knocking("gap0", 0), knocking("gap1mm", 1e-3)}},
  };
}

}  // namespace soda::bench
