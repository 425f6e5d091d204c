// soda-bench resilience: how long a world with a full window stays on time when its load grows at once (figure 8 of the
// paper that SODA comes from): by the formula, by the protocol's core in virtual time, and in real time.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <thread>

#include "bench/cluster.h"
#include "bench/commands.h"
#include "common/anticipation.h"
#include "common/run_settings.h"
#include "common/scene/scene_builder.h"
#include "server/physics/stepper.h"

namespace soda::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr Step kEntries = 48;     // the window, as in the paper
constexpr double kRate = 60;      // steps and frames per second
constexpr Step kMostSteps = 600;  // looked at: what is later on time is called never late

// Everything in contact with everything, again in each step, as in the paper: bodies are put back to where they were.
class Knot {
 public:
  explicit Knot(std::uint32_t bodies) : model_(scene(bodies)), stepper_(model_), start_(model_.initial_state()) {}
  void step() {
    BodySet set = start_;
    stepper_.step(set);
  }

 private:
  static Scene scene(std::uint32_t bodies) {
    SceneBuilder builder("knot");
    builder.scene.sleeping = false;
    builder.scene.gravity = Vec3::Zero();
    for (std::uint32_t i = 0; i < bodies; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(1e-4 * i, 0, 0));
    return builder.finish();
  }
  physics::Model model_;
  physics::Stepper stepper_;
  BodySet start_;
};

double seconds_per_step(std::uint32_t bodies) {
  Knot knot(bodies);
  knot.step();
  return time_of([&] { knot.step(); }, 7);
}

// So many bodies that a step takes about `seconds`.
std::uint32_t bodies_for(double seconds) {
  std::uint32_t low = 2, high = 4;
  while (seconds_per_step(high) < seconds && high < 4096) low = high, high *= 2;
  while (high - low > std::max(1u, low / 64)) {
    const std::uint32_t middle = (low + high) / 2;
    (seconds_per_step(middle) < seconds ? low : high) = middle;
  }
  return high;
}

struct Lasted {
  Step steps = 0;   // shown on time
  double cost = 0;  // s per step, mean
};

// So much for each step, however many bodies there are: known when it is begun.
class StepCosts final : public Costs {
 public:
  double per_step = 0;  // s
  void begin(const border::WorldCore& core) override { clock_ = core.clock(); }
  double spent(WorldId, const border::WorldCore& core, Activity activity, double) override {
    return activity == Activity::kWorking && core.clock() > clock_ ? per_step : 0;
  }

 private:
  Step clock_ = 0;
};

// A core of one world with a full window, whose steps cost so much from then on. Time is virtual.
Step lasts_in_core(double cost) {
  SceneBuilder builder("anything");
  builder.add(Box{Vec3(1, 1, 1)}, Vec3::Zero());
  const Scene scene = builder.finish();
  StepCosts costs;
  Cluster cluster(scene, bisect(scene, make_grid(scene), 1),
                  {.last_step = kMostSteps + 2 * kEntries, .window = kEntries, .actions = true}, {}, costs);
  Step there = 0;  // the newest step that is paid for
  cluster.worked = [&](WorldId) { there = std::min(cluster.core(0).clock(), cluster.core(0).front()); };
  Step shown = 0;
  const auto order = [&] { cluster.order(0, {shown + kEntries, shown + kDefaultLead}); };
  std::function<void()> frame = [&] {
    if (there <= shown || ++shown == kMostSteps) return cluster.stop();
    order();
    cluster.at(static_cast<double>(shown + 1) / kRate, frame);
  };
  order();  // the window is filled at time 0, for nothing
  cluster.at(0.5 / kRate, [&] { costs.per_step = cost; });
  cluster.at(1 / kRate, frame);
  cluster.run();
  return shown;
}

// One world that has all bodies, in a square with three idle neighbours; `cost` as above is for all of them together.
struct Balanced {
  Step steps = 0;  // shown on time, of kMostSteps
  std::uint64_t transfers = 0, cells = 0;
};
Balanced lasts_with_neighbours(double cost, bool balance) {
  constexpr int kAcross = 20;
  SceneBuilder builder("one of four");
  builder.scene.sleeping = false;
  builder.scene.gravity = Vec3::Zero();
  builder.scene.max_speed = 60;
  builder.scene.territory_cell = 2;
  for (int i = 0; i < kAcross; ++i)
    for (int k = 0; k < kAcross; ++k)
      builder.add(Sphere{0.25}, Vec3(i + 0.5, k + 0.5, 0)).angular_velocity =
          Vec3(0, 0, 1);  // what is still costs nothing
  for (const Vec3& corner : {Vec3(-20, -20, 0), Vec3(-20, 20, 0), Vec3(20, -20, 0)}) builder.add(Sphere{0.25}, corner);
  const Scene scene = builder.finish();
  TerritoryMap map{make_grid(scene), 4, {}};
  for (std::size_t cell = 0; cell < map.grid.cells(); ++cell) {
    const auto x = static_cast<std::int32_t>(cell % map.grid.size[0]);
    const auto y = static_cast<std::int32_t>(cell / map.grid.size[0]) % map.grid.size[1];
    map.owner.push_back((2 * x < map.grid.size[0] ? 1u : 0u) + (2 * y < map.grid.size[1] ? 2u : 0u));
  }
  BodyCosts costs;
  Network network;
  network.latency = 1e-3;
  Cluster cluster(scene, map,
                  {.last_step = kMostSteps + 2 * kEntries, .window = kEntries, .balance = balance, .actions = true},
                  network, costs);
  cluster.pace.budget = 1 / kRate;
  std::array<Step, 4> there{};  // newest steps that are paid for
  cluster.worked = [&](WorldId w) { there[w] = std::min(cluster.core(w).clock(), cluster.core(w).front()); };
  Step shown = 0;
  const auto order = [&] {
    cluster.pace.displayed = shown;
    for (WorldId w = 0; w < 4; ++w) cluster.order(w, {shown + kEntries, shown + kDefaultLead});
  };
  std::function<void()> frame = [&] {
    if (*std::min_element(there.begin(), there.end()) <= shown || ++shown == kMostSteps) return cluster.stop();
    order();
    cluster.at(0.5 + static_cast<double>(shown + 1) / kRate, frame);
  };
  order();
  cluster.at(0.5,
             [&] { costs.per_body = cost / static_cast<double>(cluster.core(0).own_bodies()); });  // windows are full
  cluster.at(0.5 + 1 / kRate, frame);
  cluster.run();
  Balanced result{shown, 0, 0};
  for (WorldId w = 0; w < 4; ++w) {
    result.transfers += cluster.core(w).stats().transfers;
    result.cells += cluster.core(w).stats().cells_given;
  }
  return result;
}

Lasted lasts_in_real_time(std::uint32_t bodies, Step most) {
  Knot knot(bodies);
  knot.step();
  Step computed = kEntries, shown = 0;
  const auto begin = Clock::now();
  const auto passed = [&] { return std::chrono::duration<double>(Clock::now() - begin).count(); };
  double busy = 0;
  Step steps = 0;
  for (;;) {
    // Frames that have become due.
    const Step due = static_cast<Step>(passed() * kRate);
    if (due > computed || due >= most)
      return {std::min(computed, due), steps > 0 ? busy / static_cast<double>(steps) : 0};
    shown = due;
    if (computed - shown >= kEntries) {
      std::this_thread::sleep_until(begin + std::chrono::duration_cast<Clock::duration>(
                                                std::chrono::duration<double>(static_cast<double>(shown + 1) / kRate)));
      continue;
    }
    const double before = passed();
    knot.step();
    busy += passed() - before;
    ++steps;
    ++computed;
  }
}

constexpr const char* kPicture = R"(
set grid
set key top right
set xrange [0:325]
set xlabel 'additional load (%)'
set ylabel 'steps on time'
set yrange [0:*]
set title 'A world with 48 steps computed ahead at 60 steps/s, whose load grows at once'
plot 'resilience.csv' skip 1 using 1:2 with lines lw 2 lc rgb '#909090' title '48 / (1 - budget / cost)', \
  '' skip 1 using 1:3 with points pt 7 lc rgb '#d1603d' title 'protocol core, virtual time', \
  '' skip 1 using 4:5 with points pt 6 ps 1.4 lc rgb '#3d7ea6' title 'real time', \
  '' skip 1 using 1:7 with linespoints pt 5 lc rgb '#6a994e' title 'with balancing, three idle neighbours (600: none missed)'
)";

}  // namespace

void resilience(const Options& options, Headline& headline) {
  Csv table(options, "resilience",
            "load_percent,limit_steps,core_steps,real_load_percent,real_steps,alone_of_four,balanced_steps,transfers");
  const double budget = 1 / kRate;
  std::printf("%10s %12s %12s %26s %26s\n", "load", "limit", "core", "balanced (transfers)", "real time (load, steps)");
  for (int percent = 25; percent <= 300; percent += 25) {
    const double cost = budget * (1 + percent / 100.0);
    const double limit = steps_on_time(kEntries, budget, cost);
    const Step core = lasts_in_core(cost);
    const Balanced alone = lasts_with_neighbours(cost, false), balanced = lasts_with_neighbours(cost, true);
    Lasted real;
    std::uint32_t bodies = 0;
    if (!options.quick) {
      bodies = bodies_for(cost);
      real = lasts_in_real_time(bodies, kMostSteps);
    }
    const double real_percent = 100 * (real.cost / budget - 1);
    std::printf("%8d %% %12.1f %12lld %19lld (%4llu)", percent, limit, static_cast<long long>(core),
                static_cast<long long>(balanced.steps), static_cast<unsigned long long>(balanced.transfers));
    if (bodies > 0) std::printf(" %12.0f %% %8lld", real_percent, static_cast<long long>(real.steps));
    std::printf("\n");
    std::fflush(stdout);
    table.row(percent, limit, core, real_percent, real.steps, alone.steps, balanced.steps, balanced.transfers);
    if (percent == 150) {
      headline.add("limit_at_150", limit);
      headline.add("steps_at_150", static_cast<double>(core));
      headline.add("alone_of_four_at_150", static_cast<double>(alone.steps));
      headline.add("balanced_at_150", static_cast<double>(balanced.steps));
      headline.add("balanced_missed_none_at_150", balanced.steps == kMostSteps);
      headline.add("balanced_transfers_at_150", static_cast<double>(balanced.transfers));
      if (bodies > 0) {
        headline.add("real_load_percent", real_percent);
        headline.add("real_steps", static_cast<double>(real.steps));
        headline.add("real_limit", steps_on_time(kEntries, budget, real.cost));
      }
    }
  }
  table.close();
  plot(options, "resilience", kPicture);
}

}  // namespace soda::bench
