// Joints: what each kind holds and lets go, against motions that are known.
#include <gtest/gtest.h>

#include <cmath>

#include "common/scene/scene_builder.h"
#include "physics_scenes.h"

namespace soda::physics::test::joints {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kG = 9.81;

struct World {
  explicit World(SceneBuilder& builder) : model(builder.finish()), stepper(model), set(model.initial_state()) {}
  void run(double seconds) {
    for (int i = 0; i < static_cast<int>(std::lround(seconds / model.scene().dt)); ++i) stepper.step(set);
  }
  const BodyState& at(std::size_t i) const { return set.bodies[i]; }
  // Where a joint's two places are, m apart.
  double gap(std::size_t joint) const {
    const Joint& j = model.scene().joints.at(joint);
    const auto place = [&](BodyId id, const Pose& frame) {
      if (id == kWorldBody) return frame.position;
      for (const Body& b : model.scene().bodies)
        if (b.id == id) {
          const BodyState& s = body(set, id);
          return Vec3(s.x() + s.q() * (frame.position - b.inertial.centre));
        }
      return Vec3(Vec3::Zero());
    };
    return (place(j.b, j.frame_b) - place(j.a, j.frame_a)).norm();
  }
  Model model;
  Stepper stepper;
  BodySet set;
};

SceneBuilder awake(const char* name) {
  SceneBuilder builder(name);
  builder.scene.sleeping = false;
  return builder;
}

TEST(Joint, APendulumSwingsWithItsPeriodAndKeepsItsEnergy) {
  for (const JointKind kind : {JointKind::kBall, JointKind::kHinge}) {
    SceneBuilder builder = awake("pendulum");
    builder.scene.dt = 1.0 / 240;
    const double angle = 0.1;
    builder.add(Sphere{0.05}, Vec3(std::sin(angle), 0, -std::cos(angle)));
    builder.add_joint(kind, 0, SceneBuilder::kWorld, Vec3::Zero(), Vec3::UnitY());
    World world(builder);
    // T = 2 pi sqrt((L^2 + 2/5 r^2) / (g L)) (1 + a^2/16)
    const double period = 2 * kPi * std::sqrt((1 + 0.4 * 0.05 * 0.05) / kG) * (1 + angle * angle / 16);
    double lowest = 1, last = world.at(0).v().x(), turned = 0;
    int turns = 0;
    const int steps = static_cast<int>(10.5 * period * 240);
    for (int i = 1; i <= steps; ++i) {
      world.stepper.step(world.set);
      const double v = world.at(0).v().x();
      if (last > 0 && v <= 0) turned = i - v / (v - last), ++turns;
      last = v;
      lowest = std::min(lowest, world.at(0).x().z());
      ASSERT_LT(world.gap(0), 1e-4);
    }
    ASSERT_EQ(turns, 10);
    EXPECT_NEAR(turned / 240 / turns, period, 0.002 * period);
    EXPECT_NEAR(lowest, -1, 1e-4);
    EXPECT_NEAR(energy(world.model, world.set) / world.model.find(1)->mass, -kG * std::cos(angle),
                0.01 * kG * (1 - std::cos(angle)));
  }
}

TEST(Joint, AHingeTurnsAboutItsAxisOnlyAndStopsAtItsLimits) {
  SceneBuilder builder = awake("door");
  builder.scene.gravity = Vec3::Zero();
  Body& door = builder.add(Box{Vec3(1, 0.1, 2)}, Vec3(0.5, 0, 0));
  door.angular_velocity = Vec3(0.3, 0, 2);
  door.linear_velocity = Vec3(0, 1, 0);
  Joint& hinge = builder.add_joint(JointKind::kHinge, 0, SceneBuilder::kWorld, Vec3::Zero(), Vec3::UnitZ());
  hinge.limits = JointLimits{-1, 1};
  World world(builder);
  double most = 0;
  for (int i = 0; i < 300; ++i) {
    world.stepper.step(world.set);
    const Quat q = world.at(0).q();
    EXPECT_LT(std::hypot(q.x(), q.y()), 2e-3);
    EXPECT_LT(world.gap(0), 2e-3);
    most = std::max(most, std::abs(2 * std::atan2(q.z(), q.w())));
  }
  EXPECT_GT(most, 0.99);
  EXPECT_LT(most, 1.01);
}

// A flap that falls open against a limit at half a turn, where angles begin anew.
TEST(Joint, AHingeAtALimitOfHalfATurnStaysThere) {
  SceneBuilder builder = awake("flap");
  Body& flap = builder.add(Box{Vec3(1, 1, 0.1)}, Vec3(0.5, 0, 0));
  flap.angular_velocity = Vec3(0, -6, 0);
  flap.linear_velocity = Vec3(0, 0, 3);
  Joint& hinge = builder.add_joint(JointKind::kHinge, 0, SceneBuilder::kWorld, Vec3::Zero(), Vec3::UnitY());
  hinge.limits = JointLimits{0, kPi};  // of the world against the flap
  World world(builder);
  double lowest = 1;
  for (int i = 0; i < 240; ++i) {
    world.stepper.step(world.set);
    lowest = std::min(lowest, world.at(0).x().z());
    ASSERT_LT(world.at(0).v().norm(), 8) << i;
  }
  EXPECT_GT(lowest, -0.05);
  EXPECT_LT(world.at(0).x().x(), -0.49) << "it did not fall open";
}

// Torn apart further than its ends look, it lets go.
TEST(Joint, ATornJointDoesNothing) {
  SceneBuilder builder = awake("torn");
  builder.scene.gravity = Vec3::Zero();
  for (int i = 0; i < 2; ++i) builder.add(Sphere{0.2}, Vec3(0.4 * i, 0, 0));
  builder.add_joint(JointKind::kBall, 0, 1, Vec3(0.2, 0, 0));
  World world(builder);
  world.stepper.step(world.set);
  ASSERT_EQ(world.set.contacts.size(), 1u);
  world.set.bodies[1].set_x(Vec3(0.2 + 0.15 + 0.2, 0, 0));
  world.stepper.step(world.set);
  EXPECT_EQ(world.set.contacts.size(), 1u) << "it holds within its slack";
  world.set.bodies[1].set_x(Vec3(0.9, 0, 0));
  world.set.bodies[1].set_v(Vec3::Zero());
  world.set.bodies[0].set_v(Vec3::Zero());
  world.stepper.step(world.set);
  EXPECT_EQ(world.set.contacts.size(), 0u);
  EXPECT_EQ(world.at(1).v(), Vec3::Zero());
}

TEST(Joint, AMotorReachesItsSpeedAsFastAsItsEffortAllows) {
  SceneBuilder builder = awake("motors");
  builder.scene.gravity = Vec3::Zero();
  builder.add(Box{Vec3(0.4, 0.4, 0.4)}, Vec3::Zero());
  Joint& wheel = builder.add_joint(JointKind::kHinge, 0, SceneBuilder::kWorld, Vec3::Zero(), Vec3::UnitX());
  builder.add(Box{Vec3(0.4, 0.4, 0.4)}, Vec3(0, 5, 0));
  wheel.motor = JointMotor{-5, 2};  // of the world against the body
  Joint& lift = builder.add_joint(JointKind::kSlider, 1, SceneBuilder::kWorld, Vec3(0, 5, 0), Vec3::UnitZ());
  lift.motor = JointMotor{-2, 32};
  lift.limits = JointLimits{-3, 0};
  World world(builder);
  const double inertia = world.model.find(1)->inertia(0, 0), mass = world.model.find(2)->mass;
  world.run(0.5);
  EXPECT_NEAR(world.at(0).w().x(), std::min(5.0, 2 / inertia * 0.5), 0.05);
  EXPECT_NEAR(world.at(1).v().z(), std::min(2.0, 32 / mass * 0.5), 0.02);
  world.run(4.5);
  EXPECT_NEAR(world.at(0).w().x(), 5, 1e-6);
  EXPECT_NEAR(world.at(1).x().z(), 3, 0.01);  // at its limit
  EXPECT_NEAR(world.at(1).x().y(), 5, 1e-3);
}

TEST(Joint, ASpringSwingsWithItsFrequency) {
  SceneBuilder builder = awake("spring");
  builder.scene.gravity = Vec3::Zero();
  builder.scene.dt = 1.0 / 240;
  builder.add(Sphere{0.1}, Vec3(0, 0, 0.5)).linear_velocity = Vec3(0, 0, 1);
  Joint& spring = builder.add_rod(0, SceneBuilder::kWorld, Vec3(0, 0, 0.5), Vec3(0, 0, -0.5));
  spring.limits = JointLimits{0, 2};
  spring.spring = JointSpring{1, 0};
  World world(builder);
  double last = 1, turned = 0;
  int turns = 0;
  for (int i = 1; i <= 480; ++i) {
    world.stepper.step(world.set);
    const double v = world.at(0).v().z();
    if (last > 0 && v <= 0) turned = i - v / (v - last), ++turns;
    last = v;
  }
  ASSERT_EQ(turns, 2);
  EXPECT_NEAR(turned / 240, 1.25, 0.02);
}

TEST(Joint, ARodKeepsItsLength) {
  SceneBuilder builder = awake("rod");
  builder.add(Sphere{0.1}, Vec3(1, 0, 0));
  builder.add(Sphere{0.1}, Vec3(2, 0, 0));
  builder.add_rod(0, SceneBuilder::kWorld, Vec3(1, 0, 0), Vec3::Zero());
  builder.add_rod(0, 1, Vec3(1, 0, 0), Vec3(2, 0, 0));
  World world(builder);
  for (int i = 0; i < 300; ++i) {
    world.stepper.step(world.set);
    EXPECT_NEAR(world.at(0).x().norm(), 1, 5e-3);
    EXPECT_NEAR((world.at(1).x() - world.at(0).x()).norm(), 1, 5e-3);
  }
}

TEST(Joint, FixedBodiesFallAndTurnAsOne) {
  SceneBuilder builder = awake("dumbbell");
  builder.scene.gravity = Vec3::Zero();
  for (int i = 0; i < 4; ++i) {
    Body& body = builder.add(Box{Vec3(0.5, 0.3, 0.2)}, Vec3(0.5 * i, 0, 0));
    body.angular_velocity = Vec3(0, 0, 1);
    body.linear_velocity = Vec3(0, 0.5 * i, 0);
  }
  for (int i = 0; i < 3; ++i) builder.add_joint(JointKind::kFixed, i, i + 1, Vec3(0.25 + 0.5 * i, 0, 0));
  World world(builder);
  const Vec3 p = momentum(world.model, world.set), l = angular_momentum(world.model, world.set);
  const double e = energy(world.model, world.set);
  world.run(5);
  EXPECT_LT((momentum(world.model, world.set) - p).norm(), 1e-11 * p.norm());
  EXPECT_LT((angular_momentum(world.model, world.set) - l).norm(), 1e-3 * l.norm());
  EXPECT_NEAR(energy(world.model, world.set), e, 0.01 * e);
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(world.gap(static_cast<std::size_t>(i)), 1e-3);
    EXPECT_LT(world.at(static_cast<std::size_t>(i)).q().angularDistance(world.at(3).q()), 5e-3);
  }
  EXPECT_GT((world.at(0).x() - Vec3(0, 0, 0)).norm(), 0.5);
}

TEST(Joint, ABallJointsConeAndTwistAreLimited) {
  SceneBuilder builder = awake("shoulder");
  builder.scene.gravity = Vec3::Zero();
  Body& arm = builder.add(Box{Vec3(0.2, 0.3, 1)}, Vec3(0, 0, 0.5));
  arm.angular_velocity = Vec3(3, 1, 2);
  arm.linear_velocity = Vec3(0.5, -1.5, 0);
  Joint& shoulder = builder.add_joint(JointKind::kBall, 0, SceneBuilder::kWorld, Vec3::Zero(), Vec3::UnitZ());
  shoulder.cone_limit = 0.5;
  shoulder.limits = JointLimits{-0.3, 0.3};
  World world(builder);
  double most_cone = 0, most_twist = 0;
  for (int i = 0; i < 600; ++i) {
    world.stepper.step(world.set);
    const Quat q = world.at(0).q();
    most_cone = std::max(most_cone, std::acos((q * Vec3::UnitZ()).z()));
    most_twist = std::max(most_twist, std::abs(2 * std::atan2(q.z(), std::abs(q.w()))));
  }
  EXPECT_GT(most_cone, 0.45);
  EXPECT_LT(most_cone, 0.52);
  EXPECT_GT(most_twist, 0.28);
  EXPECT_LT(most_twist, 0.33);
}

TEST(Joint, JointedBodiesCollideOnlyIfTheyShould) {
  for (const bool collide : {false, true}) {
    SceneBuilder builder = awake("overlap");
    builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(0, 0, 0));
    builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(0.45, 0, 0));
    builder.add_joint(JointKind::kHinge, 0, 1, Vec3(0.225, 0, 0), Vec3::UnitX()).bodies_collide = collide;
    World world(builder);
    world.stepper.step(world.set);
    std::size_t contacts = 0, joints = 0;
    for (const ContactRecord& record : world.set.contacts) (is_joint(record) ? joints : contacts) += 1;
    EXPECT_EQ(joints, 1u);
    EXPECT_EQ(contacts > 0, collide);
  }
}

// A chain of 20 links of 1 kg with something heavy at its end; tells how far its joints gape, at most.
double gape_of_chain(double load, JointMethod method, std::uint32_t substeps) {
  SceneBuilder builder = awake("chain");
  builder.scene.joint_method = method;
  builder.scene.substeps = substeps;
  for (int i = 0; i < 20; ++i) {
    builder.add(Capsule{0.03, 0.1}, Vec3(0, 0, -0.1 - 0.2 * i), Quat::Identity(),
                1 / (4.0 / 3 * kPi * 2.7e-5 + kPi * 9e-5));
    builder.add_joint(JointKind::kBall, i, i == 0 ? SceneBuilder::kWorld : i - 1, Vec3(0, 0, -0.2 * i));
  }
  builder.add(Box{Vec3(0.4, 0.4, 0.4)}, Vec3(0, 0, -4.2), Quat::Identity(), load / 0.064);
  builder.add_joint(JointKind::kBall, 20, 19, Vec3(0, 0, -4));
  World world(builder);
  world.run(2);
  double worst = 0;
  for (std::size_t j = 0; j < world.model.scene().joints.size(); ++j) worst = std::max(worst, world.gap(j));
  return worst;
}

TEST(Joint, AChainHoldsAnyLoadWithFewSubsteps) {
  EXPECT_LT(gape_of_chain(1000, JointMethod::kChosen, 2), 1e-4);
  EXPECT_LT(gape_of_chain(1000, JointMethod::kChosen, 0), 1e-4);
  EXPECT_LT(gape_of_chain(1e6, JointMethod::kDirect, 2), 1e-4);
  // One joint after the other it gives way: that is what being solved as a whole is for.
  EXPECT_GT(gape_of_chain(1000, JointMethod::kIterated, 2), 0.02);
}

// Four bars in a ring, with hinges that say more than they need to: all of them keep the ring in its plane.
TEST(Joint, AClosedRingOfHingesStaysClosed) {
  SceneBuilder builder = awake("ring");
  const Vec3 places[4] = {{0.5, 0, 0}, {1, 0, 0.5}, {0.5, 0, 1}, {0, 0, 0.5}};
  for (int i = 0; i < 4; ++i) builder.add(i % 2 ? Box{Vec3(0.1, 0.1, 0.9)} : Box{Vec3(0.9, 0.1, 0.1)}, places[i]);
  const Vec3 corners[4] = {{1, 0, 0}, {1, 0, 1}, {0, 0, 1}, {0, 0, 0}};
  for (int i = 0; i < 4; ++i) builder.add_joint(JointKind::kHinge, i, (i + 1) % 4, corners[i], Vec3::UnitY());
  builder.add_joint(JointKind::kHinge, 2, SceneBuilder::kWorld, Vec3(0.5, 0, 1), Vec3::UnitY());
  builder.scene.bodies[0].linear_velocity = Vec3(2, 0, 0);
  World world(builder);
  double fastest = 0;
  for (int i = 0; i < 300; ++i) {
    world.stepper.step(world.set);
    for (std::size_t j = 0; j < 5; ++j) EXPECT_LT(world.gap(j), 5e-3) << "step " << i << ", joint " << j;
    for (const BodyState& body : world.set.bodies) fastest = std::max(fastest, body.v().norm());
    for (const BodyState& body : world.set.bodies) EXPECT_LT(std::abs(body.position[1]), 1e-3);
  }
  EXPECT_GT(fastest, 1);  // it did swing
  EXPECT_LT(fastest, 6);
  EXPECT_EQ(world.stepper.shares.joints_alone, 0u);
}

// Something as light as dust between the world and what is heavy: its rows look as if others implied them.
TEST(Joint, ADummyLinkCarriesWhatHangsOnIt) {
  SceneBuilder builder = awake("dummy");
  Body& dummy = builder.add(Sphere{0.0016}, Vec3::Zero());
  dummy.inertial.mass = 1e-3;
  dummy.inertial.inertia = 1e-9 * Mat3::Identity();
  builder.add(Box{Vec3(0.4, 0.4, 0.4)}, Vec3(0.3, 0, -0.3), Quat::Identity(), 100 / 0.064);
  builder.add_joint(JointKind::kFixed, 0, SceneBuilder::kWorld, Vec3::Zero());
  Joint& ball = builder.add_joint(JointKind::kBall, 0, 1, Vec3(0.3, 0, 0));
  ball.bodies_collide = false;
  World world(builder);
  world.run(2);
  EXPECT_LT(world.gap(1), 2e-3);
  EXPECT_NEAR(world.at(1).position[2], -0.3, 5e-3);
}

// As files have them, rounded: one pin is not quite parallel to the others, and one corner not quite closed.
TEST(Joint, ARingThatDoesNotQuiteCloseIsNotKicked) {
  for (const double misfit : {1e-5, 1e-4, 1e-3}) {
    SceneBuilder builder = awake("rounded ring");
    builder.scene.gravity = Vec3::Zero();
    const Vec3 places[4] = {{0.5, 0, 0}, {1, 0, 0.5}, {0.5, 0, 1}, {0, 0, 0.5}};
    for (int i = 0; i < 4; ++i) builder.add(i % 2 ? Box{Vec3(0.1, 0.1, 0.9)} : Box{Vec3(0.9, 0.1, 0.1)}, places[i]);
    const Vec3 corners[4] = {{1, 0, 0}, {1, 0, 1}, {0, 0, 1}, {0, 0, 0}};
    for (int i = 0; i < 4; ++i)
      builder.add_joint(JointKind::kHinge, i, (i + 1) % 4, corners[i], i == 2 ? Vec3(1e-3, 1, 0) : Vec3::UnitY());
    builder.scene.joints[1].frame_a.position.y() += misfit;
    World world(builder);
    double fastest = 0;
    for (int i = 0; i < 120; ++i) {
      world.stepper.step(world.set);
      for (const BodyState& body : world.set.bodies) fastest = std::max(fastest, body.v().norm());
    }
    EXPECT_LT(fastest, 0.5) << misfit;
    for (std::size_t j = 0; j < 4; ++j) EXPECT_LT(world.gap(j), 2 * misfit + 1e-5) << misfit;
  }
}

TEST(Joint, AMeshOfTooManyJointsIsIterated) {
  SceneBuilder builder = awake("cloth");
  constexpr int kEdge = 24;
  for (int i = 0; i < kEdge * kEdge; ++i) builder.add(Sphere{0.05}, Vec3(0.2 * (i % kEdge), 0, -0.2 * (i / kEdge)));
  for (int i = 0; i < kEdge * kEdge; ++i) {
    const Vec3 at(0.2 * (i % kEdge), 0, -0.2 * (i / kEdge));
    if (i % kEdge + 1 < kEdge) builder.add_joint(JointKind::kBall, i, i + 1, at + Vec3(0.1, 0, 0));
    if (i + kEdge < kEdge * kEdge) builder.add_joint(JointKind::kBall, i, i + kEdge, at - Vec3(0, 0, 0.1));
  }
  for (int i = 0; i < kEdge; ++i) builder.add_joint(JointKind::kBall, i, SceneBuilder::kWorld, Vec3(0.2 * i, 0, 0));
  World world(builder);
  world.run(1);
  EXPECT_EQ(world.stepper.shares.joints_together, 0u);
  EXPECT_GT(world.stepper.shares.joints_alone, 60u * world.model.scene().joints.size() / 2);
  EXPECT_GT(world.at(kEdge * kEdge - 1).position[2], -0.2 * (kEdge - 1) - 0.3);  // hangs together
}

TEST(Joint, AUniversalJointBendsBothWaysAndPassesTurnsOn) {
  // Two shafts in line along x, held up at their far ends by hinges; the second is bent by 20 degrees.
  SceneBuilder builder = awake("cardan");
  builder.scene.gravity = Vec3::Zero();
  builder.add(Box{Vec3(0.8, 0.1, 0.1)}, Vec3(-0.5, 0, 0));
  const Quat bend = rotation_of(Vec3(0, kPi / 9, 0));
  builder.add(Box{Vec3(0.8, 0.1, 0.1)}, bend * Vec3(0.5, 0, 0), bend);
  builder.add_joint(JointKind::kHinge, 0, SceneBuilder::kWorld, Vec3(-0.9, 0, 0), Vec3::UnitX()).motor =
      JointMotor{3, 1e3};
  builder.add_joint(JointKind::kHinge, 1, SceneBuilder::kWorld, bend * Vec3(0.9, 0, 0), bend * Vec3::UnitX());
  // One yoke across the first shaft, the other across the second: both across each other.
  Joint& joint = builder.add_joint(JointKind::kUniversal, 0, 1, Vec3::Zero(), Vec3::UnitX());
  joint.frame_a = frame_in(builder.scene.bodies[0].pose, universal_frame(Vec3::Zero(), Vec3::UnitY(), Vec3::UnitZ()));
  joint.frame_b =
      frame_in(builder.scene.bodies[1].pose, universal_frame(Vec3::Zero(), Vec3::UnitY(), bend * Vec3::UnitZ()));
  World world(builder);
  world.run(0.5);
  double first = 0, second = 0, least = 1e9, most = 0;
  for (int i = 0; i < 252; ++i) {  // two turns of 2.09 s
    world.stepper.step(world.set);
    first += std::abs(world.at(0).w().x()) / 60;
    const double ratio = world.at(1).w().norm() / world.at(0).w().norm();
    second += world.at(1).w().norm() / 60;
    least = std::min(least, ratio);
    most = std::max(most, ratio);
    EXPECT_LT(world.gap(2), 1e-3);
  }
  EXPECT_NEAR(first, 4 * kPi, 0.05);
  EXPECT_NEAR(second, first, 0.02);             // turn for turn ...
  EXPECT_NEAR(least, std::cos(kPi / 9), 0.02);  // ... but uneven, by the cosine of the bend either way
  EXPECT_NEAR(most, 1 / std::cos(kPi / 9), 0.02);
}

TEST(Joint, AHangingChainComesToRestSleepsAndIsWokenAsAWhole) {
  SceneBuilder builder("chain");
  for (int i = 0; i < 8; ++i) builder.add(Capsule{0.05, 0.1}, Vec3(0, 0, -0.1 - 0.2 * i));
  builder.add_joint(JointKind::kBall, 0, SceneBuilder::kWorld, Vec3::Zero());
  for (int i = 0; i < 7; ++i) builder.add_joint(JointKind::kBall, i, i + 1, Vec3(0, 0, -0.2 - 0.2 * i));
  Body& ball = builder.add(Sphere{0.2}, Vec3(-3, 0, -1.45));
  ball.linear_velocity = Vec3(1.2, 0, 2.2);
  builder.scene.gravity = Vec3(0, 0, -1.2);
  World world(builder);
  const auto asleep = [&] {
    int count = 0;
    for (std::size_t i = 0; i < 8; ++i) count += world.at(i).asleep();
    return count;
  };
  int most = 0;
  bool woken = false;
  for (int i = 0; i < 300; ++i) {
    world.stepper.step(world.set);
    most = std::max(most, asleep());
    EXPECT_TRUE(asleep() == 0 || asleep() == 8);
    woken = woken || (most == 8 && asleep() == 0);
  }
  EXPECT_EQ(most, 8);
  EXPECT_TRUE(woken) << "the ball missed: " << world.at(8).x().transpose();
}

}  // namespace
}  // namespace soda::physics::test::joints
