// soda-bench sync-groups and granularity: how many worlds hang together at a step (figures 6 and 7 of the paper that
// SODA comes from). Bodies move through a box at random; the scene is simulated as one, and looked at as if many worlds
// did.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "bench/commands.h"
#include "common/grid.h"
#include "common/scene/generators.h"
#include "common/scene/random.h"
#include "common/scene/scene_builder.h"
#include "common/territory.h"
#include "server/physics/stepper.h"

namespace soda::bench {
namespace {

constexpr int kClasses = 4;  // of sizes of groups
constexpr const char* kClassNames[kClasses] = {"1", "2-3", "4-7", "8+"};

// Worlds that must look at each other's bodies at a step, directly or by others: islands of worlds.
class Groups {
 public:
  explicit Groups(WorldId worlds) : worlds_(worlds) {}
  void join(WorldId a, WorldId b) { joined_.push_back({a, b}); }
  // How many worlds are in groups of each class.
  std::array<double, kClasses> worlds_by_class() const {
    physics::Islands groups;
    physics::IslandFinder().find(worlds_, joined_, groups);
    std::array<double, kClasses> count{};
    for (std::size_t k = 0; k < groups.size(); ++k) {
      const std::size_t n = groups.bodies_of(k).size();
      count[n == 1 ? 0 : n < 4 ? 1 : n < 8 ? 2 : 3] += static_cast<double>(n);
    }
    return count;
  }

 private:
  WorldId worlds_;
  std::vector<physics::Ends> joined_;
};

struct Space {
  const char* name;
  Vec3 size;    // m
  double edge;  // m, of the cubes
};
// The paper says 24,000 km3 and cubes of 100 cm3. With lengths of 100 cm and a space of 24,000 m3, its numbers of
// bodies synchronise as its figures show; so that is how it is read here. The others tell how much depends on that.
constexpr std::uint32_t kCounts[] = {25, 50, 100, 200, 300, 500, 1000, 2000};
const Space kSpaces[] = {{"cubes of 1 m in 24,000 m3", Vec3(40, 30, 20), 1},
                         {"cubes of 100 cm3 in 24,000 m3", Vec3(40, 30, 20), std::cbrt(1e-4)},
                         {"cubes of 2 m in 24,000 m3", Vec3(40, 30, 20), 2}};

// Closed, without gravity; bodies fly about and bounce. The first space is the generator's.
Scene gas(const Space& space, std::uint32_t bodies, std::uint64_t seed) {
  if (&space == kSpaces) {
    Scene scene = generate("cubes", bodies, seed);
    scene.sleeping = false;
    return scene;
  }
  SceneBuilder builder("gas");
  builder.scene.sleeping = false;
  builder.scene.gravity = Vec3::Zero();
  builder.scene.max_speed = 20;
  // Fine cells: borders are as thin as the bodies allow.
  builder.scene.territory_cell =
      std::max(1.2 * std::sqrt(3.0) * space.edge + 0.1, builder.scene.max_speed * builder.scene.dt);
  Random random(seed);
  const Vec3 half = 0.5 * space.size;
  for (std::uint32_t i = 0; i < bodies; ++i) {
    const Vec3 room = half - Vec3::Constant(space.edge);
    Body& body = builder.add(Box{Vec3::Constant(space.edge)}, random.between(-room, room), random.orientation());
    body.linear_velocity = random.between(Vec3::Constant(-3), Vec3::Constant(3));
    body.restitution = 1;
    body.friction = 0;
  }
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      Vec3 size = space.size + Vec3::Constant(4), at = Vec3::Zero();
      size[axis] = 2;
      at[axis] = side * (half[axis] + 1);
      builder.add_static(Box{size}, at);
    }
  return builder.finish();
}

struct Shares {
  std::array<double, kClasses> border{}, islands{};  // share of the worlds in groups of each class
};

// By bodies that lie across a border (the paper's synchronisation), and by islands of several worlds' bodies (ours).
Shares watch(const Scene& scene, WorldId worlds, Step steps) {
  const physics::Model model(scene);
  physics::Stepper stepper(model);
  BodySet set = model.initial_state();
  const TerritoryMap map = bisect(scene, make_grid(scene), worlds);
  Shares sum;
  std::vector<physics::Ends> ends;
  physics::Islands islands;
  for (Step step = 0; step < steps; ++step) {
    stepper.step(set);
    Groups border(worlds), mixed(worlds);
    for (const BodyState& body : set.bodies) {
      const Aabb box = physics::reach_box(body, model);
      const Cell low = map.grid.cell_of(box.min), high = map.grid.cell_of(box.max);
      const WorldId owner = map.owner_of(body.x());
      for (std::int32_t z = low[2]; z <= high[2]; ++z)
        for (std::int32_t y = low[1]; y <= high[1]; ++y)
          for (std::int32_t x = low[0]; x <= high[0]; ++x) border.join(owner, map.owner[map.grid.index({x, y, z})]);
    }
    stepper.find_islands(set.bodies, set.contacts, ends, islands);
    for (std::size_t k = 0; k < islands.size(); ++k) {
      const auto members = islands.bodies_of(k);
      for (const std::uint32_t i : members)
        mixed.join(map.owner_of(set.bodies[members[0]].x()), map.owner_of(set.bodies[i].x()));
    }
    const auto b = border.worlds_by_class(), m = mixed.worlds_by_class();
    for (int c = 0; c < kClasses; ++c) {
      sum.border[c] += b[c] / static_cast<double>(worlds) / static_cast<double>(steps);
      sum.islands[c] += m[c] / static_cast<double>(worlds) / static_cast<double>(steps);
    }
  }
  return sum;
}

Shares mean_of(const Space& space, std::uint32_t bodies, WorldId worlds, const Options& options) {
  const int runs = options.quick ? 1 : 5;
  const Step steps = options.quick ? 60 : 600;  // 10 s
  Shares mean;
  for (int run = 0; run < runs; ++run) {
    const Shares one = watch(gas(space, bodies, static_cast<std::uint64_t>(run) + 1), worlds, steps);
    for (int c = 0; c < kClasses; ++c) {
      mean.border[c] += one.border[c] / runs;
      mean.islands[c] += one.islands[c] / runs;
    }
  }
  return mean;
}

void tell(const char* what, const std::array<double, kClasses>& shares) {
  std::printf("  %s", what);
  for (int c = 0; c < kClasses; ++c) std::printf("  %s: %3.0f %%", kClassNames[c], 100 * shares[c]);
}

constexpr const char* kHeader =
    "space,bodies,worlds,border_1,border_2,border_4,border_8,island_1,island_2,island_4,island_8";

void write(Csv& table, const char* space, std::uint32_t bodies, WorldId worlds, const Shares& s) {
  table.row(space, bodies, worlds, s.border[0], s.border[1], s.border[2], s.border[3], s.islands[0], s.islands[1],
            s.islands[2], s.islands[3]);
  std::printf("%5u bodies, %3u worlds", bodies, worlds);
  tell("by borders", s.border);
  tell("by islands", s.islands);
  std::printf("\n");
  std::fflush(stdout);
}

// Filled, one above the other: groups of one, two or three, and so on.
std::string stacked(const std::string& file, const std::string& filter, int x, const std::string& xlabel) {
  const auto part = [&](int first, const char* title) {
    std::string text = "set title '" + std::string(title) + "'\nplot ";
    const char* colours[] = {"#6a994e", "#e9b44c", "#d1603d", "#8e3b46"};
    for (int c = 3; c >= 0; --c) {
      std::string sum;
      for (int k = 0; k <= c; ++k) sum += (k ? "+" : "") + std::string("$") + std::to_string(first + k);
      text += "'" + file + "' skip 1 using " + std::to_string(x) + ":(" + filter + " ? 100*(" + sum +
              ") : NaN) with filledcurves x1 lc rgb '" + colours[c] + "' title 'groups of " + kClassNames[c] + "'" +
              (c ? ", " : "\n");
    }
    return text;
  };
  return "set multiplot layout 1,2\nset logscale x 2\nset yrange [0:100]\nset ylabel 'worlds (%)'\nset xlabel '" +
         xlabel + "'\nset key bottom left opaque\nset grid front\n" + part(4, "by bodies across borders (the paper)") +
         part(8, "by islands of several worlds (SODA)") + "unset multiplot\n";
}

}  // namespace

void sync_groups(const Options& options, Headline& headline) {
  Csv table(options, "sync_groups", kHeader);
  constexpr WorldId kWorlds = 12;
  for (const Space& space : kSpaces) {
    std::printf("%s, %u worlds\n", space.name, kWorlds);
    for (const std::uint32_t bodies : kCounts) {
      if (options.quick && bodies > 200) continue;
      if (bodies * std::pow(space.edge, 3) > 0.3 * space.size.prod()) continue;  // would not fit
      const Shares s = mean_of(space, bodies, kWorlds, options);
      std::string column = space.name;
      std::replace(column.begin(), column.end(), ',', '.');
      write(table, column.c_str(), bodies, kWorlds, s);
      if (&space == kSpaces && (bodies == 100 || bodies == 500)) {
        headline.add("alone_by_borders_" + std::to_string(bodies), s.border[0]);
        headline.add("alone_by_islands_" + std::to_string(bodies), s.islands[0]);
      }
    }
  }
  table.close();
  plot(options, "sync_groups",
       stacked("sync_groups.csv", "stringcolumn(1) eq 'cubes of 1 m in 24.000 m3'", 2, "bodies on 12 worlds"), 1000,
       420);
}

void granularity(const Options& options, Headline& headline) {
  Csv table(options, "granularity", kHeader);
  constexpr std::uint32_t kBodies = 500;
  for (const WorldId worlds : {1u, 2u, 4u, 8u, 12u, 16u, 25u, 50u, 75u, 100u}) {
    if (options.quick && worlds > 8) continue;
    const Shares s = mean_of(kSpaces[0], kBodies, worlds, options);
    write(table, "cubes of 1 m in 24.000 m3", kBodies, worlds, s);
    headline.add("alone_by_borders_on_" + std::to_string(worlds), s.border[0]);
    headline.add("alone_by_islands_on_" + std::to_string(worlds), s.islands[0]);
  }
  table.close();
  plot(options, "granularity", stacked("granularity.csv", "1", 3, "worlds for 500 bodies"), 1000, 420);
}

}  // namespace soda::bench
