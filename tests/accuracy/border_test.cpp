// A21: bodies exactly on borders. A22: bodies larger than cells. A23: trouble beside bodies at rest.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "common/grid.h"
#include "common/scene/scene_builder.h"
#include "server/physics/stepper.h"
#include "tests/simulation/scenario.h"
#include "tests/simulation/simulated_session.h"

namespace soda::test {
namespace {

// Eight cells that meet at the origin, each a world: pairs of balls meet on faces, edges and the corner.
Scene at_the_corner(double nudge) {
  SceneBuilder builder("corner");
  builder.scene.gravity = Vec3::Zero();
  builder.scene.territory_cell = 4;
  for (const double x : {-3.0, 3.0})
    for (const double y : {-3.0, 3.0})
      for (const double z : {-3.0, 3.0}) builder.add(Sphere{0.2}, Vec3(x, y, z));  // they make the grid
  const Vec3 places[] = {Vec3(nudge, 1, 1), Vec3(nudge, nudge, -1), Vec3(nudge, nudge, nudge), Vec3(1, nudge, 1)};
  for (const Vec3& place : places) {
    builder.add(Sphere{0.25}, place);  // rests with its centre on the border
    for (int axis = 0; axis < 3; ++axis) {
      Body& ball = builder.add(Sphere{0.25}, place + Vec3(Vec3::Unit(axis)));
      ball.linear_velocity = -2 * Vec3::Unit(axis);
      ball.restitution = 0.5;
    }
  }
  return builder.finish();
}

TEST(A21, BodiesOnBordersHaveOneOwnerAndTheBitsOfOneWorld) {
  constexpr double kUlp = std::numeric_limits<double>::denorm_min();
  for (const double nudge : {0.0, -0.0, kUlp, -kUlp, 1e-16, -1e-16}) {
    const Scene scene = at_the_corner(nudge);
    const Grid grid = make_grid(scene);
    ASSERT_EQ(grid.cells(), 8u);
    EXPECT_EQ(grid.origin + Vec3::Constant(grid.edge), Vec3::Zero()) << "the border is not where the balls are";
    std::vector<WorldId> owner(8);
    for (WorldId w = 0; w < 8; ++w) owner[w] = w;
    const auto expected = run_single(scene, 120);
    for (const std::uint64_t seed : {1u, 2u}) {
      NetworkSettings network;
      network.seed = seed;
      const auto got = run_session(scene, 8, 120, network, owner);
      ASSERT_EQ(got.failure, "");
      ASSERT_EQ(first_difference(expected, got.steps), "") << nudge;
      EXPECT_EQ(got.steps.front().bodies, scene.bodies.size());
      EXPECT_GT(got.total.mixed_islands, 0u);
      EXPECT_GT(got.total.arrived, 0u);
    }
  }
}

TEST(A22, APlankOverThreeCellsAndASlabOverNineHaveTheBitsOfOneWorld) {
  SceneBuilder builder("large");
  builder.scene.territory_cell = 2;
  builder.add_ground(100);
  for (int i = 0; i < 4; ++i) builder.add(Box{Vec3(0.4, 0.4, 1)}, Vec3(2 * i - 3, -5, 0.5));
  builder.add(Box{Vec3(6.6, 0.5, 0.2)}, Vec3(0, -5, 1.1));  // on four posts in four cells
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y) builder.add(Box{Vec3(0.4, 0.4, 0.4)}, Vec3(2.2 * x, 2.2 * y + 1, 0.2));
  builder.add(Box{Vec3(5.4, 5.4, 0.2)}, Vec3(0, 1, 0.9));  // falls on nine
  builder.add(Sphere{0.4}, Vec3(2.4, -5, 3));
  const Scene scene = builder.finish();
  const auto expected = run_single(scene, 150);
  for (const WorldId worlds : {2u, 4u, 8u}) {
    const auto got = run_session(scene, worlds, 150, {}, confetti(scene, worlds, worlds));
    ASSERT_EQ(got.failure, "");
    ASSERT_EQ(first_difference(expected, got.steps), "");
    EXPECT_GT(got.total.wide_bodies, 0u);
    EXPECT_GT(got.total.mixed_islands, 0u);
  }
}

// Five boxes at rest, and far from them what the door lets in though it is odd. (What it does not is in
// scene_bad_input.)
void add_bystanders(SceneBuilder& builder) {
  builder.scene.sleeping = false;
  for (int i = 0; i < 5; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(1.5 * i, 0, 0.5 + 0.01 * i));
  builder.add_ground(200);
}

TEST(A23, BystandersKeepTheirBits) {
  SceneBuilder calm("calm");
  add_bystanders(calm);
  const physics::Model alone(calm.finish());
  for (int trouble = 0; trouble < 4; ++trouble) {
    SceneBuilder builder("trouble");
    add_bystanders(builder);
    std::size_t added = 0;
    const auto add = [&](const Vec3& at) -> Body& {
      ++added;
      return builder.add(Box{Vec3(1, 1, 1)}, at);
    };
    if (trouble == 0)
      for (int i = 0; i < 10; ++i) add(Vec3(40, 40, 1));  // all in one place
    if (trouble == 1) add(Vec3(9e6, 9e6, 9e6)).linear_velocity = Vec3(100, 0, 0);
    if (trouble == 2) {
      add(Vec3(40, 40, 1.5)).inertial = with_mass(mass_of(Box{Vec3(1, 1, 1)}, 1), 1e-9);
      add(Vec3(40, 40, 0.5)).inertial = with_mass(mass_of(Box{Vec3(1, 1, 1)}, 1), 1e12);
    }
    if (trouble == 3) add(Vec3(40, 40, 0.2)).angular_velocity = Vec3(1e5, 0, 0);
    const physics::Model model(builder.finish());
    physics::Stepper expected(alone), stepper(model);
    BodySet reference = alone.initial_state(), set = model.initial_state();
    for (int t = 0; t < 180; ++t) {
      expected.step(reference);
      stepper.step(set);
      ASSERT_EQ(std::memcmp(reference.bodies.data(), set.bodies.data(), 5 * sizeof(BodyState)), 0)
          << "trouble " << trouble << ", step " << t;
      for (const BodyState& body : set.bodies)
        ASSERT_TRUE(std::isfinite(body.x().sum() + body.v().sum() + body.w().sum() + body.q().coeffs().sum()));
    }
    EXPECT_EQ(set.bodies.size(), 5 + added);
  }
}

}  // namespace
}  // namespace soda::test
