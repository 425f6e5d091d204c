// Generated scenes: as many bodies as asked for, sound, and the same bytes for the same seed.
#include <gtest/gtest.h>

#include "common/grid.h"
#include "common/scene/extent.h"
#include "common/scene/generators.h"
#include "common/scene/random.h"
#include "common/scene/scene_file.h"

namespace soda {
namespace {

class SceneGenerator : public ::testing::TestWithParam<std::string> {};

TEST_P(SceneGenerator, MakesAsManyBodiesAsAsked) {
  for (std::uint32_t n : {1u, 2u, 7u, 8u, 27u, 28u, 100u, 1001u}) {
    const Scene scene = generate(GetParam(), n, 3);
    std::uint32_t dynamic = 0;
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
      EXPECT_EQ(scene.bodies[i].id, i + 1);
      EXPECT_EQ(scene.bodies[i].is_static, i >= n);
      dynamic += !scene.bodies[i].is_static;
    }
    EXPECT_EQ(dynamic, n);
  }
}

TEST_P(SceneGenerator, SameSeedSameBytes) {
  const std::string first = encode_scene(generate(GetParam(), 200, 11));
  EXPECT_EQ(first, encode_scene(generate(GetParam(), 200, 11)));
  const bool seeded = GetParam() != "towers" && GetParam() != "dominoes";
  EXPECT_EQ(first != encode_scene(generate(GetParam(), 200, 12)), seeded);
}

// Bodies start at most touching: bounding boxes of bodies that are not turned, spheres inside of those that are.
TEST_P(SceneGenerator, StartsWithoutOverlap) {
  const Scene scene = generate(GetParam(), 500, 5);
  struct Core {
    Aabb box;
    bool is_static;
  };
  std::vector<Core> cores;
  for (const Body& body : scene.bodies) {
    Aabb box = *extent_of(scene, body);
    if (body.pose.orientation.coeffs() != Quat::Identity().coeffs()) {
      const auto* shape = std::get_if<Box>(&scene.geometries[body.shapes[0].geometry]);
      const Vec3 half = Vec3::Constant(shape ? 0.5 * shape->size.minCoeff() / std::sqrt(3.0) : 0);
      box = Aabb{body.pose.position - half, body.pose.position + half};
    }
    const Vec3 slack = Vec3::Constant(1e-9);
    cores.push_back({Aabb{box.min + slack, box.max - slack}, body.is_static});
  }
  for (std::size_t i = 0; i < cores.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_FALSE(cores[i].box.overlaps(cores[j].box) && !(cores[i].is_static && cores[j].is_static))
          << i + 1 << " and " << j + 1;
}

TEST_P(SceneGenerator, AllStandOnOrAboveTheGround) {
  const Scene scene = generate(GetParam(), 500, 5);
  const Body* ground = nullptr;
  for (const Body& body : scene.bodies)
    if (body.name == "ground") ground = &body;
  if (!ground) return;  // scenes without gravity
  const Aabb base = *extent_of(scene, *ground);
  EXPECT_EQ(base.max.z(), 0);
  for (const Body& body : scene.bodies) {
    if (body.is_static) continue;
    const Aabb box = *extent_of(scene, body);
    EXPECT_GE(box.min.z(), 0) << label_of(body);
    for (int axis = 0; axis < 2; ++axis) {
      EXPECT_GT(box.min[axis], base.min[axis] + 10);
      EXPECT_LT(box.max[axis], base.max[axis] - 10);
    }
  }
}

// The odd large body makes territories coarse: none here.
TEST_P(SceneGenerator, CellsFitTheBodies) {
  const Scene scene = generate(GetParam(), 2000, 5);
  const Grid grid = make_grid(scene);
  EXPECT_LT(grid.edge, 4);
  EXPECT_GT(grid.cells(), 20u);
}

INSTANTIATE_TEST_SUITE_P(Scene, SceneGenerator, ::testing::ValuesIn([] {
                           std::vector<std::string> names;
                           for (const Generator& g : generators()) names.push_back(g.name);
                           return names;
                         }()),
                         [](const auto& test) { return test.param; });

TEST(SceneGenerators, UnknownNameListsThoseThereAre) {
  try {
    generate("castle", 10, 1);
    FAIL() << "accepted";
  } catch (const std::invalid_argument& e) {
    for (const Generator& g : generators()) EXPECT_NE(std::string(e.what()).find(g.name), std::string::npos);
  }
  EXPECT_THROW(generate("cubes", 0, 1), std::invalid_argument);
  EXPECT_THROW(generate("cubes", kMaxGenerated + 1, 1), std::invalid_argument);
}

// The numbers are part of every generated scene, so they must never change. First values of xoshiro256++ seeded by
// splitmix64.
TEST(SceneGenerators, RandomNumbersAreThoseOfThePaper) {
  Random random(0);
  EXPECT_EQ(random.bits(), 0x53175d61490b23dfu);
  EXPECT_EQ(random.bits(), 0x61da6f3dc380d507u);
  EXPECT_EQ(random.bits(), 0x5c0fdf91ec9a7bfcu);
  for (int i = 0; i < 1000; ++i) {
    const double u = random.unit();
    EXPECT_TRUE(u >= 0 && u < 1);
    EXPECT_LT(random.below(7), 7u);
    EXPECT_NEAR(random.orientation().norm(), 1, 1e-15);
    EXPECT_NEAR(random.direction().norm(), 1, 1e-15);
  }
}

TEST(SceneGenerators, CrowdWalksAcrossTheCity) {
  const Scene scene = generate("city", 400, 2);
  std::size_t driven = 0, along_x = 0;
  for (const Body& body : scene.bodies) {
    if (!body.drive) continue;
    ++driven;
    along_x += body.drive->velocity.x() != 0;
    ASSERT_TRUE(body.drive->bounds);
    for (int axis = 0; axis < 2; ++axis) {
      EXPECT_GT(body.pose.position[axis], body.drive->bounds->min[axis]);
      EXPECT_LT(body.pose.position[axis], body.drive->bounds->max[axis]);
    }
    EXPECT_NEAR(body.drive->velocity.norm(), 1.4, 0.3);
  }
  EXPECT_EQ(driven, 200u);
  EXPECT_GT(along_x, 50u);
  EXPECT_LT(along_x, 150u);
}

TEST(SceneGenerators, CountsUpToTheLargestSceneAreExact) {
  const Scene scene = generate("cubes", 8000, 1);
  EXPECT_EQ(scene.bodies.size(), 8006u);
}

}  // namespace
}  // namespace soda
