// soda-bench scaling: strong and weak scaling of a city. Two cores say how one world compares with two; beyond that a
// model of a cluster (cluster.h) runs the real protocol core of up to 1,024 worlds in virtual time, each piece of work at
// what it costs here and each message at what it costs over DDS here. Whole sessions of real processes check the model.
#include <algorithm>
#include <bit>
#include <cstdio>
#include <iterator>
#include <limits>
#include <optional>

#include "bench/cluster.h"
#include "bench/commands.h"
#include "bench/lone_core.h"
#include "bench/message_costs.h"
#include "bench/session_runs.h"
#include "common/scene/generators.h"

namespace soda::bench {
namespace {

constexpr double kGigabit = 125e6;  // bytes/s

struct Mode {
  const char* name;
  border::Sync sync;
  bool barrier;  // nobody begins a step before everybody has done the one before
};
constexpr Mode kAnticipative{"anticipative", border::Sync::kAnticipative, false},
    kConservative{"conservative", border::Sync::kConservative, false},
    kBarrier{"barrier", border::Sync::kConservative, true};
constexpr Mode kModes[] = {kAnticipative, kConservative, kBarrier};

struct Size {
  std::uint32_t bodies, bodies_per_world;  // of strong scaling, of weak scaling
  std::vector<WorldId> strong, weak;       // without those that both have
  Step steps;
};
const Size kFull{64000, 1000, {1, 2, 4, 16, 64, 256, 1024}, {1, 4, 16}, 60};
const Size kQuick{2000, 250, {1, 2, 4, 8}, {1, 2}, 20};

// What a run of the model says; times are s per step and world.
struct Outcome {
  double step = 0;  // from one step to the next
  std::array<double, kActivities> mean{};  // by Activity
  double busy_mean = 0, busy_max = 0;
  double bodies_max_over_mean = 0;
  double messages = 0, bytes = 0;  // per step and world
  double mixed_islands = 0;        // per step, in all
  double redone = 0;               // share of all results
  double sum_busy(WorldId worlds) const { return busy_mean * worlds; }
};

// A whole session of so many steps, from the scene to when the last of them is final everywhere. (Between two steps on
// the way those who run ahead would have done more, or less, than what lies between.)
class Run {
 public:
  Run(const Scene& scene, WorldId worlds, const Mode& mode, const Network& network, Step steps)
      : mode_(mode),
        latency_(network.latency),
        steps_(steps),
        cluster_(scene, bisect(scene, make_grid(scene), worlds),
                 {.last_step = steps, .sync = mode.sync, .window = kWindow}, network, costs_),
        final_(worlds, 0),
        front_(worlds, 0) {
    cluster_.worked = [this](WorldId w) { worked(w); };
    if (mode.barrier) order_all(1);
  }

  Outcome outcome() {
    cluster_.run();
    Outcome o;
    const auto steps = static_cast<double>(steps_);
    const double worlds = cluster_.worlds();
    o.step = cluster_.now() / steps;
    double bodies_max = 0, bodies = 0, redone = 0, computed = 0;
    for (WorldId w = 0; w < cluster_.worlds(); ++w) {
      const border::WorldCore& core = cluster_.core(w);
      const Cluster::Usage& usage = cluster_.usage(w);
      for (std::size_t a = 0; a < kActivities; ++a) o.mean[a] += usage.seconds[a] / steps / worlds;
      o.busy_mean += usage.busy() / steps / worlds;
      o.busy_max = std::max(o.busy_max, usage.busy() / steps);
      const auto own = static_cast<double>(core.own_bodies());
      bodies += own;
      bodies_max = std::max(bodies_max, own);
      o.messages += static_cast<double>(core.stats().messages_sent) / steps / worlds;
      o.bytes += static_cast<double>(core.stats().bytes_sent) / steps / worlds;
      o.mixed_islands += static_cast<double>(core.stats().mixed_islands) / steps;
      redone += static_cast<double>(bodies_redone(core));
      computed += static_cast<double>(bodies_computed(core));
    }
    o.bodies_max_over_mean = bodies_max / (bodies / worlds);
    o.redone = redone / computed;
    return o;
  }

 private:
  void worked(WorldId w) {
    if (mode_.barrier && pass(front_, w, cluster_.core(w).front(), limit_)) {
      // Word of it goes up a binary tree of all worlds, and down again.
      const int levels = static_cast<int>(std::bit_width(cluster_.worlds() - 1u));
      cluster_.at(cluster_.now() + 2 * levels * latency_, [this, next = limit_ + 1] { order_all(next); });
    }
    if (pass(final_, w, cluster_.core(w).final_step(), steps_)) cluster_.stop();
  }

  // Notes how far a world has got; whether all have now got to `goal`, and had not before.
  static bool pass(std::vector<Step>& reached, WorldId w, Step step, Step goal) {
    const bool before = std::exchange(reached[w], step) >= goal;
    return !before && step >= goal && *std::min_element(reached.begin(), reached.end()) >= goal;
  }

  void order_all(Step limit) {
    limit_ = limit;
    for (WorldId w = 0; w < cluster_.worlds(); ++w) cluster_.order(w, {limit, limit});
  }

  const Mode mode_;
  const double latency_;  // s
  const Step steps_;
  MeasuredCosts costs_;
  Cluster cluster_;
  std::vector<Step> final_, front_;  // by world
  Step limit_ = 0;                   // of the barrier
};

class Tables {
 public:
  explicit Tables(const Options& options)
      : table_(options, "scaling",
               "kind,mode,worlds,bodies,step_ms,speedup,efficiency,waiting_share,work_over_one_world,busy_max_over_mean,"
               "step_over_busy_max,receiving_ms,working_ms,telling_ms,network_ms,bodies_max_over_mean,"
               "messages_per_world_step,bytes_per_world_step,mixed_islands_per_step,latency_us") {}

  // `one`: the time of a step on one world, of all bodies (strong) or of as many as each has (weak).
  void add(const char* kind, const Mode& mode, WorldId worlds, std::uint32_t bodies, const Outcome& o, double one,
           const Network& network) {
    const bool strong = kind != std::string("weak");
    const double n = worlds, work_of_one = strong ? one : n * one;
    const double speedup = work_of_one / o.step, efficiency = speedup / n;
    table_.row(kind, mode.name, worlds, bodies, 1e3 * o.step, speedup, efficiency, 1 - o.busy_mean / o.step,
               o.sum_busy(worlds) / work_of_one, o.busy_max / o.busy_mean, o.step / o.busy_max, 1e3 * o.mean[0],
               1e3 * o.mean[1], 1e3 * o.mean[2], 1e3 * o.mean[3], o.bodies_max_over_mean, o.messages, o.bytes,
               o.mixed_islands, 1e6 * network.latency);
    std::printf(
        "%s %-12s %4u worlds of %5.0f bodies: %8.3f ms per step, %6.1f times one world, efficiency %.3f = 1 / (%.3f more "
        "work x %.3f uneven x %.3f waiting of the busiest); waiting %.0f %%\n",
        kind, mode.name, worlds, bodies / n, 1e3 * o.step, speedup, efficiency, o.sum_busy(worlds) / work_of_one,
        o.busy_max / o.busy_mean, o.step / o.busy_max, 100 * (1 - o.busy_mean / o.step));
    std::printf("   receiving %.2f working %.2f telling %.2f network %.2f ms; messages %.1f bytes %.0f mixed %.1f redone %.2f bodies max %.2f\n", 1e3 * o.mean[0],
               1e3 * o.mean[1], 1e3 * o.mean[2], 1e3 * o.mean[3], o.messages, o.bytes,
               o.mixed_islands, o.redone, o.bodies_max_over_mean);
    std::fflush(stdout);
  }
  void close() { table_.close(); }

 private:
  Csv table_;
};

Scene city(std::uint32_t bodies) {
  Scene scene = generate("city", bodies, 1);
  scene.sleeping = false;  // else it soon costs nothing
  return scene;
}

constexpr const char* kPicture = R"(
set multiplot layout 1,2
set grid
set logscale x 2
set xlabel 'worlds'
of(kind, mode, column_) = stringcolumn(1) eq kind && stringcolumn(2) eq mode ? column(column_) : NaN
set logscale y 2
set key top left
set ylabel 'times as fast as one world'
set title 'A city on a cluster (model): strong scaling'
plot x with lines dt 2 lc rgb '#909090' title 'ideal', \
  'scaling.csv' skip 1 using 3:(of('strong', 'anticipative', 6)) with linespoints lw 2 pt 7 lc rgb '#d1603d' title 'anticipative', \
  '' skip 1 using 3:(of('strong', 'conservative', 6)) with linespoints lw 2 pt 5 lc rgb '#3d7ea6' title 'conservative', \
  '' skip 1 using 3:(of('strong', 'barrier', 6)) with linespoints lw 2 pt 9 lc rgb '#6a994e' title 'a barrier in each step'
unset logscale y
set yrange [0:1.1]
set key bottom left
set ylabel 'efficiency'
set title 'strong (lines) and weak (points)'
plot 'scaling.csv' skip 1 using 3:(of('strong', 'anticipative', 7)) with lines lw 2 lc rgb '#d1603d' title 'anticipative', \
  '' skip 1 using 3:(of('strong', 'conservative', 7)) with lines lw 2 lc rgb '#3d7ea6' title 'conservative', \
  '' skip 1 using 3:(of('strong', 'barrier', 7)) with lines lw 2 lc rgb '#6a994e' title 'a barrier in each step', \
  '' skip 1 using 3:(of('weak', 'anticipative', 7)) with points pt 7 lc rgb '#d1603d' notitle, \
  '' skip 1 using 3:(of('weak', 'conservative', 7)) with points pt 5 lc rgb '#3d7ea6' notitle, \
  '' skip 1 using 3:(of('weak', 'barrier', 7)) with points pt 9 lc rgb '#6a994e' notitle
unset multiplot
)";

}  // namespace

void scaling(const Options& options, Headline& headline) {
  Size size = options.quick ? kQuick : kFull;
  if (const char* dev = std::getenv("SCALING_DEV")) size.strong = {1, static_cast<WorldId>(std::atoi(dev))}, size.weak={1}, size.bodies = std::atoi(std::getenv("SCALING_BODIES"));
  Network network = measure_messages(options.quick);
  network.bytes_per_second = kGigabit;
  headline.add("latency_us", 1e6 * network.latency);
  headline.add("send_us", 1e6 * network.send_seconds);
  headline.add("receive_us", 1e6 * network.receive_seconds);

  Tables tables(options);
  const Scene whole = city(size.bodies);
  // The same worlds with as many bodies each as in weak scaling are in both.
  const WorldId common = size.bodies / size.bodies_per_world;
  std::vector<std::pair<WorldId, Outcome>> compared;  // with real runs
  std::vector<std::pair<Mode, Outcome>> common_outcomes;
  double one = 0;
  for (const WorldId worlds : size.strong)
    for (const Mode& mode : kModes) {
      if (worlds == 1 && mode.sync == border::Sync::kConservative) continue;  // all the same
      const Outcome o = Run(whole, worlds, mode, network, size.steps).outcome();
      if (worlds == 1) one = o.step;
      tables.add("strong", mode, worlds, size.bodies, o, one, network);
      const std::string end = std::to_string(worlds) + (&mode == kModes ? "" : std::string("_") + mode.name);
      headline.add("city.efficiency_" + end, one / o.step / worlds);
      headline.add("city.waiting_share_" + end, 1 - o.busy_mean / o.step);
      if (worlds <= 4 && &mode == kModes) compared.emplace_back(worlds, o);
      if (worlds != common) continue;
      common_outcomes.emplace_back(mode, o);
      headline.add("city.more_work_" + end, o.sum_busy(worlds) / one);
      headline.add("city.uneven_" + end, o.busy_max / o.busy_mean);
      headline.add("city.busiest_waits_" + end, o.step / o.busy_max);
      Network slow = network;
      slow.latency *= 10;
      const Outcome late = Run(whole, worlds, mode, slow, size.steps).outcome();
      tables.add("strong, latency x 10", mode, worlds, size.bodies, late, one, slow);
      headline.add("city.efficiency_" + end + "_latency_x10", one / late.step / worlds);
    }

  double one_of_weak = 0;
  for (const WorldId worlds : size.weak) {
    const std::uint32_t bodies = worlds * size.bodies_per_world;
    const Scene scene = city(bodies);
    for (const Mode& mode : kModes) {
      if (worlds == 1 && mode.sync == border::Sync::kConservative) continue;
      const Outcome o = Run(scene, worlds, mode, network, size.steps).outcome();
      if (worlds == 1) one_of_weak = o.step;
      tables.add("weak", mode, worlds, bodies, o, one_of_weak, network);
      if (worlds == size.weak.back()) headline.add(std::string("weak.efficiency_") + std::to_string(worlds) + "_" + mode.name, one_of_weak / o.step);
    }
  }
  for (const auto& [mode, o] : common_outcomes) {
    tables.add("weak", mode, common, size.bodies, o, one_of_weak, network);
    headline.add("weak.efficiency_" + std::to_string(common) + "_" + mode.name, one_of_weak / o.step);
  }
  tables.close();

  const int rounds = options.rounds > 0 ? options.rounds : options.quick ? 1 : 3;
  Csv real_table(options, "scaling_real", "worlds,real_step_ms,model_step_ms,real_cpu_ms,model_busy_ms");
  const SessionRuns runs(whole);
  std::vector<std::vector<double>> wall(compared.size()), cpu(compared.size());
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < compared.size(); ++i) {
      const SessionRun real =
          runs.run("--worlds " + std::to_string(compared[i].first) + " --no-shm", size.steps);
      wall[i].push_back(real.wall / static_cast<double>(size.steps));
      cpu[i].push_back(real.cpu / static_cast<double>(size.steps));
    }
  for (std::size_t i = 0; i < compared.size(); ++i) {
    const auto& [worlds, o] = compared[i];
    const double busy = o.sum_busy(worlds);
    real_table.row(worlds, 1e3 * median(wall[i]), 1e3 * o.step, 1e3 * median(cpu[i]), 1e3 * busy);
    std::printf("%u real worlds: %.1f ms per step (model %.1f), %.1f ms of CPU (model %.1f)\n", worlds,
                1e3 * median(wall[i]), 1e3 * o.step, 1e3 * median(cpu[i]), 1e3 * busy);
    const std::string end = "_" + std::to_string(worlds);
    // More worlds than the cores at hand say nothing of the time.
    if (worlds <= 2) headline.add("model_over_real.step" + end, o.step / median(wall[i]));
    headline.add("model_over_real.cpu" + end, busy / median(cpu[i]));
  }
  real_table.close();
  plot(options, "scaling", kPicture, 1000, 440);
}

}  // namespace soda::bench
