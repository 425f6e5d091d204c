#include "bench/accuracy/distribution.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "bench/accuracy/measures.h"
#include "common/grid.h"
#include "common/scene/generators.h"
#include "common/territory.h"
#include "server/physics/stepper.h"
#include "tests/simulation/scenario.h"
#include "tests/simulation/simulated_session.h"

namespace soda::bench {
namespace {

test::SessionResult on_worlds(const Scene& scene, WorldId worlds, Step steps, std::uint64_t seed,
                              const std::vector<WorldId>& owner) {
  test::NetworkSettings network;
  network.seed = seed;
  network.loss_share = 0.02;
  test::SessionResult result = test::run_session(scene, worlds, steps, network, owner);
  if (!result.failure.empty()) throw std::runtime_error(scene.name + ": " + result.failure);
  return result;
}

// Mean and its standard error.
class Mean {
 public:
  void add(double x) { sum_ += x, squares_ += x * x, ++count_; }
  double mean() const { return count_ > 0 ? sum_ / count_ : 0; }
  double error() const {
    return count_ > 1 ? std::sqrt(std::max(0.0, squares_ / count_ - mean() * mean()) / (count_ - 1)) : 0;
  }

 private:
  double sum_ = 0, squares_ = 0, count_ = 0;
};

// What is watched of bodies near borders, and of the others: means over a run.
struct Place {
  Mean contacts, speed, load;
};

struct Run {
  double momentum = 0, angular = 0;  // largest change, relative to the sum of the bodies' own
  double energy_rise = 0;            // of one step, relative
  double rise_at_crossings = 0;      // the same, of steps in which bodies crossed borders
  std::uint64_t crossings = 0;
  Place near, inside;
};

Run watch(const Scene& scene, const std::vector<WorldId>& owner, Step steps) {
  const physics::Model model(scene);
  physics::Stepper stepper(model);
  BodySet set = model.initial_state();
  const Mechanics mechanics(scene);
  const Grid grid = make_grid(scene);
  const auto owner_of = [&](const BodyState& b) { return owner[grid.index(grid.cell_of(b.x()))]; };
  const auto is_near = [&](const BodyState& b) {  // some other world's cell within half an edge
    for (int corner = 0; corner < 8; ++corner) {
      BodyState moved = b;
      moved.set_x(b.x() + 0.5 * grid.edge * Vec3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1));
      if (owner_of(moved) != owner_of(b)) return true;
    }
    return false;
  };
  Run run;
  double scale = 0, turning = 0;
  for (std::size_t i = 0; i < set.bodies.size(); ++i) {
    const Vec3 p = mechanics.mass(i) * set.bodies[i].v();
    scale += p.norm();
    turning += set.bodies[i].x().cross(p).norm();
  }
  const Vec3 p0 = mechanics.momentum(set.bodies), l0 = mechanics.angular_momentum(set.bodies);
  const double e0 = mechanics.energy(set.bodies);
  double before = e0;
  std::vector<WorldId> owners;
  for (const BodyState& b : set.bodies) owners.push_back(owner_of(b));
  for (Step t = 0; t < steps; ++t) {
    stepper.step(set);
    bool crossed = false;
    std::vector<double> contacts(set.bodies.size()), load(set.bodies.size());
    for (const ContactRecord& record : set.contacts) {
      if (record.with_static()) continue;  // walls are where they are
      double impulse = 0;
      for (std::uint32_t k = 0; k < record.count; ++k) impulse += record.points[k].impulse;
      for (const BodyId id : {record.a, record.b}) {
        const auto at = std::lower_bound(set.bodies.begin(), set.bodies.end(), id,
                                         [](const BodyState& b, BodyId wanted) { return b.id < wanted; });
        if (at == set.bodies.end() || at->id != id) continue;
        contacts[static_cast<std::size_t>(at - set.bodies.begin())] += 1;
        load[static_cast<std::size_t>(at - set.bodies.begin())] += impulse;
      }
    }
    for (std::size_t i = 0; i < set.bodies.size(); ++i) {
      const WorldId now = owner_of(set.bodies[i]);
      if (now != owners[i]) ++run.crossings, crossed = true;
      owners[i] = now;
      Place& place = is_near(set.bodies[i]) ? run.near : run.inside;
      place.contacts.add(contacts[i]);
      place.speed.add(set.bodies[i].v().norm());
      place.load.add(load[i]);
    }
    const double energy = mechanics.energy(set.bodies);
    run.energy_rise = std::max(run.energy_rise, (energy - before) / e0);
    if (crossed) run.rise_at_crossings = std::max(run.rise_at_crossings, (energy - before) / e0);
    before = energy;
    run.momentum = std::max(run.momentum, (mechanics.momentum(set.bodies) - p0).norm() / scale);
    run.angular = std::max(run.angular, (mechanics.angular_momentum(set.bodies) - l0).norm() / turning);
  }
  return run;
}

}  // namespace

void compare_worlds(const std::vector<Case>& cases, const std::vector<unsigned>& worlds, Headline& headline) {
  std::printf("%-16s %7s %7s %9s %9s %9s\n", "case", "worlds", "steps", "mixed", "crossed", "bits");
  for (const Case& c : cases)
    for (const Variant& variant : c.variants) {
      Scene scene = variant.scene(1.0 / 60);
      scene.dt = 1.0 / 60;
      scene.substeps = 4;
      scene.sleeping = false;
      scene.territory_cell = std::max(scene.max_speed * scene.dt, 0.5);
      const Step steps = std::min<Step>(std::lround(variant.seconds * 60), 300);
      const auto expected = test::run_single(scene, steps);
      for (const unsigned n : worlds) {
        const std::string name = std::string(c.id) + "." + variant.name;
        if (make_grid(scene).cells() < n) {
          std::printf("%-16s %7u  fewer cells than worlds\n", name.c_str(), n);
          continue;
        }
        const auto got = on_worlds(scene, n, steps, n, test::confetti(scene, n, n));
        const std::string difference = test::first_difference(expected, got.steps);
        if (!difference.empty()) throw std::runtime_error(name + " on " + std::to_string(n) + " worlds: " + difference);
        std::printf("%-16s %7u %7lld %9llu %9llu %9s\n", name.c_str(), n, static_cast<long long>(steps),
                    static_cast<unsigned long long>(got.total.mixed_islands),
                    static_cast<unsigned long long>(got.total.arrived), "equal");
        std::fflush(stdout);
        headline.add(name + ".equal_" + std::to_string(n), 1);
      }
    }
}

void distribution(const Options& options, Headline& headline) {
  const int seeds = options.quick ? 3 : 30;
  const Step steps = options.quick ? 60 : 240;
  constexpr WorldId kWorlds = 8;
  Csv table(options, "accuracy_distribution",
            "seed,equal,crossings,momentum,angular,energy_rise,energy_rise_at_crossings,contacts_near,"
            "contacts_inside,speed_near,speed_inside,load_near,load_inside");
  double momentum = 0, angular = 0, rise = 0, rise_crossing = 0;
  std::uint64_t crossings = 0, mixed = 0;
  Mean contacts, speed, load;  // near less inside, over seeds
  Mean inside_contacts, inside_speed, inside_load;
  for (int seed = 1; seed <= seeds; ++seed) {
    // Bunches that meet where borders do: what conservation laws say. A room full of cubes, alike everywhere: whether
    // anything is different near borders.
    const Scene bunches = generate("cluster", 216, static_cast<std::uint64_t>(seed));
    const Scene room = generate("cubes", 500, static_cast<std::uint64_t>(seed));
    const auto dealt = test::confetti(bunches, kWorlds, static_cast<std::uint64_t>(seed));
    const auto halved = bisect(room, make_grid(room), kWorlds).owner;
    for (const auto& [scene, owner] : {std::pair(&bunches, &dealt), std::pair(&room, &halved)}) {
      const auto got = on_worlds(*scene, kWorlds, steps, static_cast<std::uint64_t>(seed), *owner);
      const std::string difference = test::first_difference(test::run_single(*scene, steps), got.steps);
      if (!difference.empty())
        throw std::runtime_error(scene->name + ", seed " + std::to_string(seed) + ": " + difference);
      mixed += got.total.mixed_islands;
    }
    Run run = watch(bunches, dealt, steps);
    const Run in_room = watch(room, halved, steps);
    run.near = in_room.near;
    run.inside = in_room.inside;
    run.crossings += in_room.crossings;
    table.row(seed, 1, run.crossings, run.momentum, run.angular, run.energy_rise, run.rise_at_crossings,
              run.near.contacts.mean(), run.inside.contacts.mean(), run.near.speed.mean(), run.inside.speed.mean(),
              run.near.load.mean(), run.inside.load.mean());
    momentum = std::max(momentum, run.momentum);
    angular = std::max(angular, run.angular);
    rise = std::max(rise, run.energy_rise);
    rise_crossing = std::max(rise_crossing, run.rise_at_crossings);
    crossings += run.crossings;
    contacts.add(run.near.contacts.mean() - run.inside.contacts.mean());
    speed.add(run.near.speed.mean() - run.inside.speed.mean());
    load.add(run.near.load.mean() - run.inside.load.mean());
    inside_contacts.add(run.inside.contacts.mean());
    inside_speed.add(run.inside.speed.mean());
    inside_load.add(run.inside.load.mean());
    std::printf("seed %d of %d: equal bits on %u worlds, %llu crossings\n", seed, seeds, kWorlds,
                static_cast<unsigned long long>(run.crossings));
    std::fflush(stdout);
  }
  std::printf(
      "\n%d seeds, %llu crossings: largest change of momentum %.2g, of angular momentum %.2g; largest rise of energy "
      "in "
      "a step %.2g, in one with crossings %.2g (all relative)\n",
      seeds, static_cast<unsigned long long>(crossings), momentum, angular, rise, rise_crossing);
  const auto print = [](const char* what, const Mean& difference, const Mean& inside) {
    std::printf("%-28s inside %9.4g, near borders differs by %9.2g +- %.2g\n", what, inside.mean(), difference.mean(),
                difference.error());
  };
  print("contacts of a body", contacts, inside_contacts);
  print("speed, m/s", speed, inside_speed);
  print("contact impulse, N s", load, inside_load);
  headline.add("distribution.seeds_equal", seeds);
  headline.add("distribution.crossings", static_cast<double>(crossings));
  headline.add("distribution.mixed_islands", static_cast<double>(mixed));
  headline.add("distribution.momentum", momentum);
  headline.add("distribution.angular_momentum", angular);
  headline.add("distribution.energy_rise", rise);
  headline.add("distribution.energy_rise_at_crossings", rise_crossing);
  headline.add("distribution.contacts_near_minus_inside", contacts.mean());
  headline.add("distribution.contacts_standard_error", contacts.error());
  headline.add("distribution.speed_near_minus_inside", speed.mean());
  headline.add("distribution.speed_standard_error", speed.error());
}

}  // namespace soda::bench
