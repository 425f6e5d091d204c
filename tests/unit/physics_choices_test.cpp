// What an island gets of the step: more where it needs more, and the same however it is looked at.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "common/scene/random.h"
#include "common/scene/scene_builder.h"
#include "physics_scenes.h"
#include "server/physics/skyline.h"

namespace soda::physics::test::choices {
namespace {

struct World {
  explicit World(SceneBuilder& builder) : model(builder.finish()), stepper(model), set(model.initial_state()) {}
  void steps(int count) {
    for (int i = 0; i < count; ++i) stepper.step(set);
  }
  // Takes all but the first bodies away, and goes on.
  void leave(std::size_t count) {
    set.bodies.resize(count);
    std::erase_if(set.contacts, [&](const ContactRecord& r) {
      return r.a > set.bodies.back().id || (!r.with_static() && r.b > set.bodies.back().id);
    });
    steps(20);
  }
  // Sub-steps of the one island that the last step solved.
  std::uint32_t substeps() {
    stepper.shares = {};
    stepper.step(set);
    std::uint32_t found = 0;
    for (std::size_t k = 0; k < stepper.shares.solved.size(); ++k) {
      if (stepper.shares.solved[k].islands == 0) continue;
      EXPECT_EQ(found, 0u) << "more than one kind";
      EXPECT_EQ(stepper.shares.solved[k].islands, 1u);
      found = 1u << k;
    }
    return found;
  }
  Model model;
  Stepper stepper;
  BodySet set;
};

SceneBuilder on_ground() {
  SceneBuilder builder("choices");
  builder.scene.sleeping = false;
  builder.add_ground(200);
  return builder;
}

std::uint32_t of_stack(int count, double rate = 60, double edge = 1) {
  SceneBuilder builder = on_ground();
  builder.scene.dt = 1 / rate;
  for (int i = 0; i < count; ++i) builder.add(Box{Vec3(edge, edge, edge)}, Vec3(0, 0, (i + 0.5) * edge));
  World world(builder);
  world.steps(20);
  return world.substeps();
}

TEST(Choices, StacksGetSubstepsByTheirHeightSizeAndStep) {
  EXPECT_EQ(of_stack(1), 2u);
  EXPECT_EQ(of_stack(4), 2u);
  EXPECT_EQ(of_stack(10), 4u);
  EXPECT_EQ(of_stack(40), 8u);
  EXPECT_EQ(of_stack(40, 240), 2u);
  EXPECT_EQ(of_stack(10, 30), 8u);
  EXPECT_EQ(of_stack(10, 60, 0.05), 8u);  // small things must not give by much
}

TEST(Choices, HeavyOnLightGetsMoreThanLightOnHeavy) {
  const auto of = [](double below, double above) {
    SceneBuilder builder = on_ground();
    for (int i = 0; i < 4; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, i + 0.5), Quat::Identity(), below);
    builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, 4.5), Quat::Identity(), above);
    World world(builder);
    world.steps(20);
    return world.substeps();
  };
  EXPECT_EQ(of(1, 1), 4u);
  EXPECT_EQ(of(1, 1000), 32u);
  EXPECT_EQ(of(1000, 1), 4u);
}

TEST(Choices, ASceneMayFixThem) {
  SceneBuilder builder = on_ground();
  builder.scene.substeps = 8;
  for (int i = 0; i < 2; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, i + 0.5));
  World world(builder);
  world.steps(5);
  EXPECT_EQ(world.substeps(), 8u);
  for (const BodyState& body : world.set.bodies) EXPECT_EQ(body.stiffness(), 0u);
}

TEST(Choices, FlightCostsNothingMoreUnlessItTumbles) {
  SceneBuilder builder("flight");
  builder.add(Box{Vec3(1, 1, 1)}, Vec3::Zero()).angular_velocity = Vec3(30, 0, 0);
  builder.add(Box{Vec3(1, 2, 3)}, Vec3(10, 0, 0)).angular_velocity = Vec3(30, 1, 0);
  World world(builder);
  world.steps(10);
  EXPECT_EQ(world.stepper.shares.flights.islands, 20u);
  EXPECT_EQ(world.stepper.shares.turning_flights, 10u);
  for (const ModelShare& share : world.stepper.shares.solved) EXPECT_EQ(share.islands, 0u);
}

TEST(Choices, WhatTurnsFastOrMeetsFastGetsMoreForAsLong) {
  SceneBuilder builder = on_ground();
  builder.add(Box{Vec3(1, 1, 0.2)}, Vec3(0, 0, 0.1)).angular_velocity = Vec3(0, 0, 60);
  World world(builder);
  world.steps(1);
  EXPECT_EQ(world.substeps(), 4u);
  EXPECT_EQ(world.set.bodies[0].stiffness(), 1u);  // but not stiffer contacts
  world.steps(300);
  EXPECT_EQ(world.substeps(), 2u);
}

TEST(Choices, StiffnessIsRememberedUntilFarLessWouldDo) {
  SceneBuilder builder = on_ground();
  for (int i = 0; i < 17; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, i + 0.5));
  World world(builder);
  world.steps(20);
  EXPECT_EQ(world.substeps(), 8u);
  world.leave(15);  // alone, these would get 4
  EXPECT_EQ(world.substeps(), 8u);
  EXPECT_EQ(of_stack(15), 4u);
  world.leave(8);
  EXPECT_EQ(world.substeps(), 4u);
  for (const BodyState& body : world.set.bodies) EXPECT_EQ(body.stiffness(), 2u);
}

// Many side by side bear each other up: as stiff as the stack that they are as high as, for half of its sub-steps.
TEST(Choices, AHeapGetsHalfOfTheSubstepsOfAStack) {
  const auto of = [](int across, std::size_t left) {
    SceneBuilder builder = on_ground();
    for (int i = 0; i < across; ++i)
      for (int k = 0; k < 10; ++k) builder.add(Box{Vec3(1, 1, 1)}, Vec3(0.999 * i, 0, k + 0.5));
    World world(builder);
    world.steps(20);
    world.leave(10 * left);
    const std::uint32_t substeps = world.substeps();
    EXPECT_EQ(world.set.bodies[0].stiffness(), 2u);
    return substeps;
  };
  EXPECT_EQ(of(1, 1), 4u);
  EXPECT_EQ(of(8, 8), 4u);
  EXPECT_EQ(of(9, 9), 2u);
  EXPECT_EQ(of(9, 5), 2u) << "it was one";
  EXPECT_EQ(of(9, 4), 4u);
}

// With contacts fully as stiff as the stack's they would swing against each other for a quarter of a minute.
TEST(Choices, AHeapOfBoxesComesToRest) {
  SceneBuilder builder = on_ground();
  Random random(18);
  for (int i = 0; i < 384; ++i)
    builder.add(Box{Vec3::Constant(0.2)}, 0.23 * Vec3(i % 8 - 3.5, i / 8 % 8 - 3.5, i / 64) + Vec3(0, 0, 0.15) +
                                              random.between(Vec3::Constant(-0.01), Vec3::Constant(0.01)));
  for (const double side : {-1.5, 1.5}) {
    builder.add_static(Box{Vec3(1, 4, 4)}, Vec3(side, 0, 2));
    builder.add_static(Box{Vec3(4, 1, 4)}, Vec3(0, side, 2));
  }
  World world(builder);
  world.steps(300);
  EXPECT_GT(world.stepper.shares.solved[1].bodies, 300u * 300u);
  EXPECT_EQ(world.set.bodies[0].stiffness(), 2u);
  double fastest = 0;
  for (const BodyState& body : world.set.bodies) fastest = std::max(fastest, body.v().norm());
  EXPECT_LT(fastest, 0.02);
}

// Sub-steps that change from step to step: the impulses that contacts carry follow.
TEST(Choices, ATowerStandsWhileItsSubstepsChange) {
  SceneBuilder builder = on_ground();
  for (int i = 0; i < 10; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, i + 0.5));
  // A disk that spins on the topmost, faster and slower.
  builder.add(Cylinder{0.4, 0.2}, Vec3(0, 0, 10.1)).friction = 0;
  World world(builder);
  std::uint32_t seen = 0, changes = 0, last = 0;
  for (int i = 0; i < 600; ++i) {
    world.set.bodies[10].set_w(Vec3(0, 0, i % 40 < 20 ? 1 : 200));
    const std::uint32_t now = world.substeps();
    seen |= now;
    changes += last != 0 && now != last;
    last = now;
  }
  EXPECT_EQ(seen, 4u | 16u);
  EXPECT_GT(changes, 25u);
  for (std::size_t i = 0; i < 10; ++i) {
    const Vec3 x = world.set.bodies[i].x();
    EXPECT_LT(std::hypot(x.x(), x.y()), 0.005) << i;
    EXPECT_NEAR(x.z(), static_cast<double>(i) + 0.5, 0.03) << i;
  }
}

TEST(Choices, APendulumKeepsItsEnergyAtAnyStep) {
  for (const double rate : {30.0, 60.0, 120.0}) {
    SceneBuilder builder("pendulum");
    builder.scene.sleeping = false;
    builder.scene.dt = 1 / rate;
    builder.add(Box{Vec3(0.2, 0.2, 0.2)}, Vec3(1, 0, 0));
    builder.add_joint(JointKind::kBall, 0, SceneBuilder::kWorld, Vec3::Zero());
    World world(builder);
    const BodyModel& body = *world.model.find(1);
    double worst = 0;
    for (int i = 0; i < 10 * rate; ++i) {
      world.steps(1);
      const BodyState& s = world.set.bodies[0];
      const double energy = 0.5 * body.mass * s.v().squaredNorm() + 0.5 * body.inertia(0, 0) * s.w().squaredNorm() +
                            body.mass * 9.81 * s.position[2];
      worst = std::max(worst, std::abs(energy) / (body.mass * 9.81));
    }
    EXPECT_LT(worst, 0.01) << rate;
  }
}

TEST(Skyline, SolvesWhatEigenSolves) {
  Random random(5);
  for (int n : {1, 2, 7, 30}) {
    // A matrix whose rows begin anywhere, made positive by its diagonal.
    Skyline skyline;
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(n, n);
    for (int i = 0; i < n; ++i) {
      const int first = static_cast<int>(random.between(0, i + 0.999));
      skyline.add_row(static_cast<std::uint32_t>(first));
      for (int j = first; j < i; ++j) dense(i, j) = dense(j, i) = random.between(-1, 1);
      dense(i, i) = n;
    }
    skyline.zero(0, skyline.size());
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j)
        if (dense(i, j) != 0) skyline.at(static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(j)) = dense(i, j);
    skyline.factor(0, skyline.size());
    Eigen::VectorXd right(n);
    for (int i = 0; i < n; ++i) right[i] = random.between(-1, 1);
    Eigen::VectorXd x = right;
    skyline.solve(0, skyline.size(), std::span(x.data(), static_cast<std::size_t>(n)));
    EXPECT_LT((dense * x - right).norm(), 1e-12 * n) << n;
    const Eigen::VectorXd reference = dense.ldlt().solve(right);
    EXPECT_LT((x - reference).norm(), 1e-12 * n) << n;
  }
}

TEST(Skyline, LeavesOutWhatIsSaidTwice) {
  // Rows 0 and 1 say the same; the third stands alone.
  Skyline skyline;
  for (const std::uint32_t first : {0u, 0u, 2u}) skyline.add_row(first);
  skyline.zero(0, 3);
  skyline.at(0, 0) = skyline.at(1, 0) = skyline.at(1, 1) = 2;
  skyline.at(2, 2) = 4;
  skyline.factor(0, 3);
  double x[3] = {1, 1, 1};
  skyline.solve(0, 3, x);
  EXPECT_DOUBLE_EQ(2 * (x[0] + x[1]), 1);
  EXPECT_EQ(x[1], 0);
  EXPECT_DOUBLE_EQ(x[2], 0.25);
}

}  // namespace
}  // namespace soda::physics::test::choices
