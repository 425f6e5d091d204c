// Bodies with a prescribed motion, and which bodies collide.
#include <gtest/gtest.h>

#include <cmath>

#include "common/scene/scene_builder.h"
#include "physics_scenes.h"
#include "server/physics/actions.h"

namespace soda::physics::test::kinematic {
namespace {

TEST(Kinematic, FollowsItsFunctionOfTimeAndCarriesWhatLiesOnIt) {
  SceneBuilder builder("lift");
  Body& lift = builder.add(Box{Vec3(2, 2, 0.2)}, Vec3(0, 0, 1));
  lift.motion = PrescribedMotion{Vec3(0.2, 0, 0), Vec3(0, 0, 0.5), 0.25, 0.3, Vec3(0, 0, 0.1)};
  builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(0.1, 0, 1.35));
  builder.add(Sphere{0.2}, Vec3(-0.6, 0.6, 4));  // falls on it and moves it not
  const Scene scene = builder.finish();
  const Model model(scene);
  Stepper stepper(model);
  BodySet set = model.initial_state();
  std::size_t touched = 0;
  for (int n = 1; n <= 600; ++n) {
    stepper.step(set);
    const double t = n * scene.dt;
    const Vec3 x(0.2 * t, 0, 1 + 0.5 * (std::sin(2 * M_PI * 0.25 * t + 0.3) - std::sin(0.3)));
    EXPECT_LT((set.bodies[0].x() - x).norm(), 1e-12) << n;
    EXPECT_LT(set.bodies[0].q().angularDistance(Quat(Eigen::AngleAxisd(0.1 * t, Vec3::UnitZ()))), 1e-7);
    EXPECT_FALSE(set.bodies[0].asleep());
    for (const ContactRecord& record : set.contacts) touched += record.a == 1;
    const Vec3 crate = set.bodies[1].x() - x;
    ASSERT_NEAR(crate.z(), 0.35, 0.02) << n;
    ASSERT_LT(std::hypot(crate.x(), crate.y()), 0.3) << n;
  }
  EXPECT_GT(touched, 600u);
}

TEST(Kinematic, DoesNotDependOnWhenItIsLookedAt) {
  SceneBuilder builder("door");
  builder.add(Box{Vec3(2, 0.1, 2)}, Vec3(0, 0, 1)).motion =
      PrescribedMotion{Vec3::Zero(), Vec3::Zero(), 0, 0, Vec3(0, 0, 1.5)};
  for (int i = 0; i < 6; ++i) builder.add(Sphere{0.2}, Vec3(std::cos(i) * 0.8, std::sin(i) * 0.8, 0.2));
  builder.add_ground(50);
  const Model model(builder.finish());
  Stepper stepper(model);
  BodySet set = model.initial_state();
  for (int n = 0; n < 100; ++n) stepper.step(set);
  BodySet copy = set;
  Stepper fresh(model);
  for (int n = 0; n < 100; ++n) {
    stepper.step(set);
    fresh.step(copy);
    ASSERT_EQ(first_difference(set, copy), "");
  }
  double moved = 0;
  for (std::size_t i = 1; i < set.bodies.size(); ++i) moved = std::max(moved, set.bodies[i].x().norm());
  EXPECT_GT(moved, 1.5) << "the door did not push";
}

TEST(FixedRotation, NothingTurnsTheBody) {
  SceneBuilder builder("upright");
  const Box post{Vec3(0.3, 0.3, 1.5)};
  const Quat askew = rotation_of(Vec3(0, 0, 0.4));
  for (int i = 0; i < 2; ++i) {  // each is hit high up by a ball; the second falls over
    builder.add(post, Vec3(0, 3 * i, 0.75), askew).fixed_rotation = i == 0;
    builder.add(Sphere{0.2}, Vec3(-2, 3 * i + 0.05, 1.3)).linear_velocity = Vec3(8, 0, 0);
  }
  // One hangs on a rod by its corner, one leans on it by a hinge.
  builder.add(Box{Vec3(1, 1, 1)}, Vec3(10, 0, 4)).fixed_rotation = true;
  builder.add_rod(4, SceneBuilder::kWorld, Vec3(10.5, 0.5, 4.5), Vec3(11, 0.5, 6));
  builder.add(Box{Vec3(2, 0.2, 0.2)}, Vec3(11.5, 0, 4));
  builder.add_joint(JointKind::kHinge, 4, 5, Vec3(10.5, 0, 4), Vec3(0, 1, 0));
  builder.add_ground(50);
  const Model model(builder.finish());
  Stepper stepper(model);
  BodySet set = model.initial_state();
  const BodySet start = set;
  double hit = 0, fell = 0, hung = 0, folded = 0;
  for (int n = 0; n < 240; ++n) {
    if (n == 30) push(set.bodies[4], model, Vec3(300, 200, 100), Vec3(0.5, 0.5, 0.5));
    stepper.step(set);
    for (const std::size_t i : {0u, 4u}) {
      ASSERT_EQ(set.bodies[i].q().coeffs(), start.bodies[i].q().coeffs()) << n;
      ASSERT_TRUE(set.bodies[i].w().isZero(0)) << n;
    }
    hit = std::max(hit, set.bodies[0].v().x());
    fell = std::max(fell, set.bodies[2].q().angularDistance(askew));
    hung = std::max(hung, (set.bodies[4].x() - start.bodies[4].x()).norm());
    folded = std::max(folded, set.bodies[5].q().angularDistance(Quat::Identity()));
    const Vec3 corner = set.bodies[4].x() + Vec3::Constant(0.5), hook = set.bodies[5].q() * Vec3(-1, 0, 0);
    ASSERT_NEAR((corner - Vec3(11, 0.5, 6)).norm(), Vec3(0.5, 0, 1.5).norm(), 0.01) << n;
    ASSERT_LT((set.bodies[4].x() + Vec3(0.5, 0, 0) - set.bodies[5].x() - hook).norm(), 0.01) << n;
  }
  EXPECT_GT(hit, 0.3);
  EXPECT_GT(fell, 1) << "the same without: a post that is hit high up falls over";
  EXPECT_GT(hung, 0.3);
  EXPECT_GT(folded, 0.5);
  set_velocity(set.bodies[0], model, Vec3(1, 0, 0), Vec3(1, 2, 3));
  EXPECT_EQ(set.bodies[0].v(), Vec3(1, 0, 0));
  EXPECT_TRUE(set.bodies[0].w().isZero(0)) << "nor do people";
}

TEST(CollisionGroups, AdmitPairsWhereBothAgree) {
  const auto falls_through = [](std::uint32_t groups, std::uint32_t mask, std::uint32_t ground_mask) {
    SceneBuilder builder("groups");
    Body& ball = builder.add(Sphere{0.2}, Vec3(0, 0, 0.5));
    ball.collision_groups = groups;
    ball.collision_mask = mask;
    builder.add_ground(10).collision_mask = ground_mask;
    const Model model(builder.finish());
    Stepper stepper(model);
    BodySet set = model.initial_state();
    for (int n = 0; n < 60; ++n) stepper.step(set);
    return set.bodies[0].x().z() < -1;
  };
  EXPECT_FALSE(falls_through(1, 0xffffffff, 0xffffffff));
  EXPECT_FALSE(falls_through(2, 1, 2));
  EXPECT_TRUE(falls_through(2, 2, 2)) << "the ground is in group 1";
  EXPECT_TRUE(falls_through(2, 1, 1)) << "the ground does not want group 2";
  EXPECT_TRUE(falls_through(0, 0xffffffff, 0xffffffff));
}

}  // namespace
}  // namespace soda::physics::test::kinematic
