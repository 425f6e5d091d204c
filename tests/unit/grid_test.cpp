// The territory grid and its division among worlds.
#include "common/grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <set>

#include "common/scene/generators.h"
#include "common/scene/random.h"
#include "common/scene/scene_builder.h"
#include "common/territory.h"

namespace soda {
namespace {

TEST(Grid, EveryPlaceHasOneCellAlsoOutsideAndWhereItIsNotANumber) {
  Grid grid;
  grid.origin = Vec3(-3, 2, 0);
  grid.edge = 0.5;
  grid.size = {4, 5, 6};
  EXPECT_EQ(grid.cells(), 120u);
  EXPECT_EQ(grid.cell_of(Vec3(-3, 2, 0)), (Cell{0, 0, 0}));
  EXPECT_EQ(grid.cell_of(Vec3(-2.5, 2.49, 2.99)), (Cell{1, 0, 5}));
  EXPECT_EQ(grid.cell_of(Vec3(1e12, -1e12, 1.2)), (Cell{3, 0, 2}));
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(grid.cell_of(Vec3(inf, -inf, std::nan(""))), (Cell{3, 0, 0}));
  EXPECT_EQ(grid.cell_of(Vec3(-0.0, 0.0, -0.0))[2], 0);
  std::set<std::size_t> seen;
  for (std::int32_t z = 0; z < 6; ++z)
    for (std::int32_t y = 0; y < 5; ++y)
      for (std::int32_t x = 0; x < 4; ++x) seen.insert(grid.index({x, y, z}));
  EXPECT_EQ(seen.size(), grid.cells());
  EXPECT_EQ(*seen.rbegin(), grid.cells() - 1);
}

TEST(Grid, HoldsTheSceneAndItsSpeeds) {
  for (const char* name : {"piles", "heap", "city", "dominoes", "cluster"}) {
    Scene scene = generate(name, 300, 1);
    const Grid grid = make_grid(scene);
    EXPECT_GE(grid.edge, scene.max_speed * scene.dt) << name;
    EXPECT_GT(grid.cells(), 1u) << name;
    EXPECT_LE(grid.cells(), kMaxCells) << name;
    for (const Body& body : scene.bodies) {
      if (body.is_static) continue;
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_GE(body.pose.position[axis], grid.origin[axis] - 1e-9) << name;
        EXPECT_LE(body.pose.position[axis], grid.origin[axis] + grid.size[axis] * grid.edge + 1e-9) << name;
      }
    }
    scene.territory_cell = 7.5;
    EXPECT_EQ(make_grid(scene).edge, 7.5) << name;
  }
}

TEST(Grid, GrowsItsCellsWhereBodiesAreSpreadWide) {
  Scene scene = generate("piles", 54, 1);
  scene.bodies[0].pose.position = Vec3(-1e6, 0, 0);
  scene.bodies[1].pose.position = Vec3(0, 1e6, 1e6);
  EXPECT_LE(make_grid(scene).cells(), kMaxCells);
}

TEST(Grid, TheLargestOrdinaryRadiusLeavesTheFewWideBodiesOut) {
  EXPECT_EQ(largest_ordinary_radius({1, 1, 1, 2, 3.9, 50}), 3.9);
  EXPECT_EQ(largest_ordinary_radius({1}), 1);
  EXPECT_EQ(largest_ordinary_radius({5, 5, 5}), 5);
}

// Whether the cells of a world hang together over faces.
bool connected(const TerritoryMap& map, WorldId world) {
  const auto& size = map.grid.size;
  std::vector<bool> seen(map.owner.size(), false);
  std::queue<Cell> open;
  std::size_t own = 0, reached = 0;
  for (std::int32_t z = 0; z < size[2]; ++z)
    for (std::int32_t y = 0; y < size[1]; ++y)
      for (std::int32_t x = 0; x < size[0]; ++x)
        if (map.owner[map.grid.index({x, y, z})] == world && own++ == 0) {
          open.push({x, y, z});
          seen[map.grid.index({x, y, z})] = true;
        }
  while (!open.empty()) {
    const Cell c = open.front();
    open.pop();
    ++reached;
    for (int axis = 0; axis < 3; ++axis)
      for (int step : {-1, 1}) {
        Cell n = c;
        n[axis] += step;
        if (n[axis] < 0 || n[axis] >= size[axis]) continue;
        const std::size_t i = map.grid.index(n);
        if (seen[i] || map.owner[i] != world) continue;
        seen[i] = true;
        open.push(n);
      }
  }
  return own > 0 && reached == own;
}

TEST(Territories, AreConnectedBalancedAndComplete) {
  const Scene scene = generate("piles", 64 * 27, 3);
  const Grid grid = make_grid(scene);
  for (const WorldId worlds : {1u, 2u, 3u, 4u, 7u, 8u, 16u}) {
    const TerritoryMap map = bisect(scene, grid, worlds);
    ASSERT_EQ(map.owner.size(), grid.cells());
    std::vector<std::size_t> bodies(worlds, 0);
    for (const WorldId owner : map.owner) ASSERT_LT(owner, worlds);
    for (const Body& body : scene.bodies)
      if (!body.is_static) ++bodies[map.owner_of(body.pose.position + body.pose.orientation * body.inertial.centre)];
    for (WorldId w = 0; w < worlds; ++w) {
      EXPECT_TRUE(connected(map, w)) << worlds << " worlds, world " << w;
      EXPECT_GT(bodies[w], scene.bodies.size() / worlds / 2) << worlds << " worlds, world " << w;
      EXPECT_LT(bodies[w], 2 * scene.bodies.size() / worlds + 1) << worlds << " worlds, world " << w;
    }
  }
}

// Whole slices of cells are coarse: a part of a row goes over where that is worth it.
TEST(Territories, AreEvenThoughCellsAreCoarse) {
  const Scene scene = generate("city", 16000, 1);
  const Grid grid = make_grid(scene);
  constexpr WorldId kWorlds = 16;
  const auto bodies_of = [&](const TerritoryMap& map) {
    std::vector<double> bodies(kWorlds, 0);
    for (const Body& body : scene.bodies)
      if (!body.is_static) ++bodies[map.owner_of(body.pose.position)];
    return bodies;
  };
  const TerritoryMap even = bisect(scene, grid, kWorlds, 0);
  const std::vector<double> bodies = bodies_of(even);
  for (WorldId w = 0; w < kWorlds; ++w) {
    EXPECT_TRUE(connected(even, w)) << "world " << w;
    EXPECT_NEAR(bodies[w], 1000, 40) << "world " << w;  // two columns of cells with a stack in each
  }

  // Who has others on all sides has fewer bodies, for borders cost something.
  const std::vector<double> fewer = bodies_of(bisect(scene, grid, kWorlds));
  const TerritoryMap map = bisect(scene, grid, kWorlds);
  const auto at = [&](double x, double y) {
    return fewer[map.owner_of(grid.origin + grid.edge * Vec3(x * grid.size[0], y * grid.size[1], 0.5))];
  };
  const double corners = at(0.1, 0.1) + at(0.1, 0.9) + at(0.9, 0.1) + at(0.9, 0.9);
  const double middle = at(0.4, 0.4) + at(0.4, 0.6) + at(0.6, 0.4) + at(0.6, 0.6);
  EXPECT_GT(corners, middle + 4 * 1.5 * kBorderBodies) << corners << " and " << middle;
}

// Bodies in clumps, and not many more cells than worlds. (Where a clump has most of the work and few cells, cuts may
// find none for some world: then they say so.)
TEST(Territories, LeaveCellsForEverybody) {
  int uneven = 0, refused = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    Random random(seed);
    SceneBuilder builder("clumps");
    Grid grid;
    grid.size = {static_cast<std::int32_t>(4 + random.below(30)), static_cast<std::int32_t>(4 + random.below(30)),
                 static_cast<std::int32_t>(1 + random.below(3))};
    const Vec3 size(grid.size[0], grid.size[1], grid.size[2]);
    std::vector<Vec3> clumps;
    for (int i = 0; i < 6; ++i) clumps.push_back(random.between(Vec3::Zero(), size));
    const std::uint32_t bodies = 20 + random.below(800);
    for (std::uint32_t i = 0; i < bodies; ++i)
      builder.add(Sphere{0.1}, clumps[random.below(6)] + random.between(Vec3::Constant(-1), Vec3::Constant(1)));
    const auto worlds = static_cast<WorldId>(std::max<std::size_t>(2, grid.cells() / (6 + random.below(20))));
    TerritoryMap map;
    try {
      map = bisect(builder.finish(), grid, worlds);
    } catch (const std::invalid_argument&) {
      ++refused;
      continue;
    }
    for (WorldId w = 0; w < worlds; ++w)
      ASSERT_TRUE(connected(map, w)) << "seed " << seed << ": world " << w << " of " << worlds;
    // Not all are boxes.
    for (WorldId w = 0; w < worlds && uneven < 100; ++w) {
      Cell low = grid.size, high{-1, -1, -1};
      std::int32_t cells = 0;
      for (std::int32_t z = 0; z < grid.size[2]; ++z)
        for (std::int32_t y = 0; y < grid.size[1]; ++y)
          for (std::int32_t x = 0; x < grid.size[0]; ++x) {
            const Cell c{x, y, z};
            if (map.owner[grid.index(c)] != w) continue;
            ++cells;
            for (std::size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], c[a]), high[a] = std::max(high[a], c[a]);
          }
      uneven += cells < (high[0] - low[0] + 1) * (high[1] - low[1] + 1) * (high[2] - low[2] + 1);
    }
  }
  EXPECT_EQ(uneven, 100);
  EXPECT_LT(refused, 15);
  RecordProperty("refused", refused);
}

TEST(Territories, AreAPureFunctionOfTheirArguments) {
  const Scene scene = generate("city", 500, 4);
  const Grid grid = make_grid(scene);
  EXPECT_EQ(bisect(scene, grid, 5).owner, bisect(generate("city", 500, 4), make_grid(scene), 5).owner);
}

TEST(Territories, GiveLessSpaceWhereThereIsMuchToTouch) {
  // Evenly spread bodies; pillars stand on the left.
  SceneBuilder builder("pillars");
  for (int x = 0; x < 40; ++x)
    for (int y = 0; y < 10; ++y) builder.add(Sphere{0.3}, Vec3(2 * x, 2 * y, 0.3));
  const auto cut = [](const Scene& scene) {
    const TerritoryMap map = bisect(scene, make_grid(scene), 2);
    return std::count(map.owner.begin(), map.owner.end(), map.owner[0]);
  };
  SceneBuilder plain = builder;
  for (int x = 0; x < 20; ++x)
    for (int y = 0; y < 10; ++y)
      for (int z = 0; z < 3; ++z) builder.add_static(Box{Vec3(0.3, 0.3, 0.3)}, Vec3(2 * x + 1, 2 * y + 1, 0.3 * z));
  builder.add_ground(500);  // is everywhere
  EXPECT_LT(cut(builder.finish()), cut(plain.finish()));
}

TEST(Territories, ByHandGoToTheLastOrTheNearest) {
  Scene scene = generate("piles", 300, 3);
  const Grid grid = make_grid(scene);
  const Vec3 low = grid.origin, high = grid.origin + grid.edge * Vec3(grid.size[0], grid.size[1], grid.size[2]);
  const Vec3 middle = 0.5 * (low + high);
  // World 1 has the right half, world 2 a part of it; nobody is given the far left, which the nearest gets.
  scene.territories = {{0, {Vec3(middle.x() - 2 * grid.edge, low.y(), low.z()), Vec3(middle.x(), high.y(), high.z())}},
                       {1, {Vec3(middle.x(), low.y(), low.z()), high}},
                       {2, {Vec3(middle.x(), low.y(), low.z()), Vec3(high.x(), middle.y(), high.z())}}};
  const TerritoryMap map = initial_territories(scene, grid, 3);
  const double e = 0.1 * grid.edge;
  EXPECT_EQ(map.owner_of(low + Vec3(e, e, e)), 0u);
  EXPECT_EQ(map.owner_of(Vec3(high.x() - e, high.y() - e, low.z() + e)), 1u);
  EXPECT_EQ(map.owner_of(Vec3(high.x() - e, low.y() + e, low.z() + e)), 2u);
  EXPECT_THROW(initial_territories(scene, grid, 2), std::invalid_argument);
  EXPECT_NO_THROW(initial_territories(scene, grid, 1));
  scene.territories[2].region = {high + Vec3(1, 1, 1), high + Vec3(2, 2, 2)};
  EXPECT_THROW(initial_territories(scene, grid, 3), std::invalid_argument);
}

TEST(Territories, EveryWorldHasACellOrAnErrorIsThrown) {
  Scene scene = generate("towers", 20, 1);  // few bodies, all at one side of a wide grid
  scene.bodies[0].pose.position.x() += 60;
  const Grid grid = make_grid(scene);
  const TerritoryMap map = bisect(scene, grid, 12);
  std::set<WorldId> owners(map.owner.begin(), map.owner.end());
  EXPECT_EQ(owners.size(), 12u);
  EXPECT_THROW(bisect(scene, grid, 0), std::invalid_argument);
  EXPECT_THROW(bisect(scene, grid, static_cast<WorldId>(grid.cells() + 1)), std::invalid_argument);
}

}  // namespace
}  // namespace soda
