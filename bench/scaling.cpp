// soda-bench scaling: strong and weak scaling of a city. Two cores say how one world compares with two; beyond that a
// model of a cluster (cluster.h) runs the real protocol core of up to 1,024 worlds in virtual time, each piece of work
// at what it costs here and each message at what it costs over DDS here. Whole sessions of real processes check the
// model.
#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "bench/commands.h"
#include "bench/experiment.h"
#include "bench/lone_core.h"
#include "bench/message_costs.h"
#include "bench/session_runs.h"
#include "common/scene/generators.h"

namespace soda::bench {
namespace {

constexpr double kGigabit = 125e6;  // bytes/s

struct Size {
  std::uint32_t bodies, bodies_per_world;  // of strong scaling, of weak scaling
  std::vector<WorldId> strong, weak;       // without those that both have
  Step steps;
  WorldId common() const { return bodies / bodies_per_world; }
};
const Size kFull{64000, 1000, {1, 2, 4, 16, 64, 256, 1024}, {1, 4, 16}, 32};
const Size kQuick{2000, 250, {1, 2, 4, 8}, {1, 2}, 20};

class Tables {
 public:
  explicit Tables(const Options& options)
      : table_(options, "scaling",
               "kind,mode,worlds,bodies,step_ms,speedup,efficiency,waiting_share,more_work,uneven,busiest_waits,"
               "receiving_ms,working_ms,telling_ms,network_ms,pieces,redone_share,bodies_max_over_mean,messages,bytes,"
               "mixed_islands,alone_over_together") {}

  // `one`: the time of a step on one world, of all bodies or, in weak scaling, of as many as each has; s.
  void add(const std::string& kind, const Mode& mode, WorldId worlds, std::uint32_t bodies, const Outcome& o,
           double one) {
    const double n = worlds, work_of_one = kind == "weak" ? n * one : one;
    const double speedup = work_of_one / o.step, efficiency = speedup / n;
    const double more_work = o.busy_mean * n / work_of_one, uneven = o.busy_max / o.busy_mean;
    const double waits = o.step / o.busy_max, waiting = 1 - o.busy_mean / o.step;
    table_.row(kind, mode.name, worlds, bodies, 1e3 * o.step, speedup, efficiency, waiting, more_work, uneven, waits,
               1e3 * o.mean[0], 1e3 * o.mean[1], 1e3 * o.mean[2], 1e3 * o.mean[3], o.pieces, o.redone,
               o.bodies_max_over_mean, o.messages, o.bytes, o.mixed_islands, o.alone);
    std::printf("%-20s %-12s %5u %7.3f ms %7.1f x  efficiency %.3f = 1 / (%.2f x %.2f x %.2f), waiting %2.0f %%\n",
                kind.c_str(), mode.name, worlds, 1e3 * o.step, speedup, efficiency, more_work, uneven, waits,
                100 * waiting);
    std::printf("%39s %.2f receiving, %.2f working, %.2f telling, %.2f network; %.1f pieces of work, %.1f messages\n",
                "ms per step and world:", 1e3 * o.mean[0], 1e3 * o.mean[1], 1e3 * o.mean[2], 1e3 * o.mean[3], o.pieces,
                o.messages);
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

// On as many worlds as weak scaling ends with: of the same bodies.
using Common = std::vector<std::pair<Mode, Outcome>>;

std::string key(const std::string& what, WorldId worlds, const Mode& mode) {
  return what + "_" + std::to_string(worlds) +
         (mode.sync == border::Sync::kAnticipative ? "" : std::string("_") + mode.name);
}

// One world and many, measured one after the other: what others do on the machine, or its host, slows a large world
// down more than small ones.
struct Pair {
  Outcome one, many;
  double efficiency(WorldId worlds) const { return one.step / many.step / worlds; }
};

// Of several the one with the median efficiency.
const Pair& median_of(std::vector<Pair>& pairs) {
  const auto middle = pairs.begin() + (std::ssize(pairs) - 1) / 2;
  std::nth_element(pairs.begin(), middle, pairs.end(),
                   [](const Pair& l, const Pair& r) { return l.efficiency(1) < r.efficiency(1); });
  return *middle;
}

// What is measured on so many worlds.
struct Case {
  std::string kind, name;  // in the table; in the headline
  Mode mode;
  Network network;
};

std::vector<Case> cases(WorldId worlds, const Size& size, const Network& network) {
  std::vector<Case> all;
  for (const Mode& mode : kModes)
    if (worlds > 1 || mode.sync == border::Sync::kAnticipative)  // alone, all are the same
      all.push_back({"strong", "city.efficiency", mode, network});
  if (worlds != size.common()) return all;
  // What the answer depends on: a slow network, and a second core that takes messages from DDS.
  Network slow = network, relieved = network;
  slow.latency *= 10;
  relieved.receive = 0;
  for (const Mode& mode : kModes) {
    if (mode.barrier) continue;
    all.push_back({"strong latency x 10", "city.efficiency_latency_x10", mode, slow});
    all.push_back({"strong second core", "city.efficiency_second_core", mode, relieved});
  }
  return all;
}

// On each of these numbers of worlds, in so many rounds each.
void strong(const Scene& scene, const Size& size, const std::vector<WorldId>& numbers, const Network& network,
            const std::function<int(WorldId)>& rounds_of, Yardstick& yardstick, Tables& tables, Headline& headline,
            Common& common) {
  Experiment lone(scene, 1, size.steps, yardstick);
  for (const WorldId worlds : numbers) {
    const int rounds = rounds_of(worlds);
    Experiment experiment(scene, worlds, size.steps, yardstick);
    const std::vector<Case> measured = cases(worlds, size, network);
    std::vector<std::vector<Pair>> pairs(measured.size());
    for (int round = 0; round < rounds; ++round) {
      experiment.forget();
      Pair pair;
      for (std::size_t i = 0; i < measured.size(); ++i) {
        if (i % std::size(kModes) == 0) pair.one = lone.run(kAnticipative, network);
        pair.many = worlds == 1 ? pair.one : experiment.run(measured[i].mode, measured[i].network);
        pairs[i].push_back(pair);
      }
    }
    for (std::size_t i = 0; i < measured.size(); ++i) {
      const Case& c = measured[i];
      if (rounds > 1) {
        std::printf("%s %s %u, efficiency by round:", c.kind.c_str(), c.mode.name, worlds);
        for (const Pair& pair : pairs[i]) std::printf(" %.3f", pair.efficiency(worlds));
        std::printf("\n");
      }
      const Pair& pair = median_of(pairs[i]);
      const Outcome& o = pair.many;
      tables.add(c.kind, c.mode, worlds, size.bodies, o, pair.one.step);
      headline.add(key(c.name, worlds, c.mode), pair.efficiency(worlds));
      if (c.kind != "strong") continue;
      headline.add(key("city.waiting_share", worlds, c.mode), 1 - o.busy_mean / o.step);
      if (worlds != size.common()) continue;
      common.emplace_back(c.mode, o);
      headline.add(key("city.more_work", worlds, c.mode), o.busy_mean * worlds / pair.one.step);
      headline.add(key("city.uneven", worlds, c.mode), o.busy_max / o.busy_mean);
      headline.add(key("city.busiest_waits", worlds, c.mode), o.step / o.busy_max);
    }
  }
}

void weak(const Size& size, const Network& network, int rounds, Yardstick& yardstick, Tables& tables,
          Headline& headline, const Common& common) {
  double one = 0;
  for (const WorldId worlds : size.weak) {
    const std::uint32_t bodies = worlds * size.bodies_per_world;
    const Scene scene = city(bodies);
    Experiment experiment(scene, worlds, size.steps, yardstick);
    for (const Mode& mode : kModes) {
      if (worlds == 1 && mode.sync == border::Sync::kConservative) continue;
      const Outcome o = experiment.best(mode, network, rounds);
      if (worlds == 1) one = o.step;
      tables.add("weak", mode, worlds, bodies, o, one);
      headline.add(key("weak.efficiency", worlds, mode), one / o.step);
    }
  }
  for (const auto& [mode, o] : common) {
    tables.add("weak", mode, size.common(), size.bodies, o, one);
    headline.add(key("weak.efficiency", size.common(), mode), one / o.step);
  }
}

// The model against sessions of real processes, which share two cores and one memory. Both by what a long session takes
// more than a short one: so the start does not count, and the steps are the same (later ones cost something else). The
// short one is longer than the window, whose memory is then used again.
void check(const Scene& scene, const Size& size, const Network& network, const Options& options, Yardstick& yardstick,
           Headline& headline) {
  constexpr WorldId kWorlds[] = {1, 2, 4};
  constexpr std::size_t kCases = std::size(kWorlds);
  const int rounds = options.rounds > 0 ? options.rounds : options.quick ? 1 : 3;
  const Step settled = kWindow + size.steps;
  Csv table(options, "scaling_real", "worlds,real_step_ms,model_step_ms,real_cpu_ms,model_busy_ms");
  const SessionRuns runs(scene);
  std::vector<double> wall[kCases], cpu[kCases];
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < kCases; ++i) {
      const SessionRun step =
          runs.per_step("--no-shm --balance off --worlds " + std::to_string(kWorlds[i]), settled, size.steps);
      wall[i].push_back(step.wall);
      cpu[i].push_back(step.cpu);
    }
  for (std::size_t i = 0; i < kCases; ++i) {
    const WorldId worlds = kWorlds[i];
    const auto model = [&](Step steps) {
      return Experiment(scene, worlds, steps, yardstick).best(kAnticipative, network, rounds);
    };
    const Outcome less = model(settled), more = model(settled + size.steps);
    const auto each = [&](double Outcome::*of) {
      return (more.*of * static_cast<double>(settled + size.steps) - less.*of * static_cast<double>(settled)) /
             static_cast<double>(size.steps);
    };
    const double step = median(wall[i]), all_cpu = median(cpu[i]);
    const double model_step = each(&Outcome::step), busy = each(&Outcome::busy_mean) * worlds;
    table.row(worlds, 1e3 * step, 1e3 * model_step, 1e3 * all_cpu, 1e3 * busy);
    std::printf("%u real worlds: %.1f ms per step (model %.1f), %.1f ms of CPU (model %.1f)\n", worlds, 1e3 * step,
                1e3 * model_step, 1e3 * all_cpu, 1e3 * busy);
    const std::string end = "_" + std::to_string(worlds);
    // More worlds than there are cores say nothing of the time.
    if (worlds <= 2) headline.add("model_over_real.step" + end, model_step / step);
    headline.add("model_over_real.cpu" + end, busy / all_cpu);
    if (worlds == 2) headline.add("city.real_efficiency_2", median(wall[0]) / step / 2);
  }
}

constexpr const char* kPicture = R"(
set datafile missing NaN  # so that lines go on across other modes' rows
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
set yrange [0:*]
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
  const Size& size = options.quick ? kQuick : kFull;
  Network network = measure_messages(options.quick);
  network.bytes_per_second = kGigabit;
  headline.add("latency_us", 1e6 * network.latency);
  headline.add("send_us", 1e6 * network.send(0));
  headline.add("receive_us", 1e6 * network.receive(0));
  std::printf("efficiency = 1 / (more work than one world x busiest world over mean x what that one waits)\n");

  const int rounds = options.rounds > 0 ? options.rounds : options.quick ? 1 : 5;
  Yardstick yardstick;
  Tables tables(options);
  const Scene whole = city(size.bodies);
  Common common;
  if (!options.worlds.empty()) {
    strong(
        whole, size, {options.worlds.begin(), options.worlds.end()}, network, [&](WorldId) { return rounds; },
        yardstick, tables, headline, common);
    return tables.close();
  }
  // What is asked about is measured often, the rest of the curve once.
  strong(
      whole, size, size.strong, network, [&](WorldId worlds) { return worlds == size.common() ? rounds : 1; },
      yardstick, tables, headline, common);
  weak(size, network, 1, yardstick, tables, headline, common);
  tables.close();
  plot(options, "scaling", kPicture, 1000, 440);
  check(whole, size, network, options, yardstick, headline);
}

}  // namespace soda::bench
