// `soda-bench worlds`: the same scene on one world and on two, as whole runs of `soda run` over DDS, and on one world
// without network. Rounds are interleaved; the median of each is compared.
#include <cstdio>
#include <map>

#include "bench/commands.h"
#include "bench/session_runs.h"
#include "common/scene/generators.h"

namespace soda::bench {
namespace {

struct Run {
  const char* name;
  const char* arguments;
};
constexpr Run kRuns[] = {
    {"single", "--sync single"},
    {"1", "--worlds 1"},
    {"2", "--worlds 2"},
    {"2 cons.", "--worlds 2 --sync conservative"},
};

struct Case {
  const char* scene;
  std::uint32_t bodies;
  int steps;
};
constexpr Case kCases[] = {{"piles", 1728, 600}, {"city", 8000, 240}};

constexpr const char* kPicture = R"(
set key top left
set style data boxes
set boxwidth 0.8
set style fill solid 0.8
set yrange [0:*]
set ylabel 'steps/s relative to one world'
set grid ytics
set bmargin 4
set title 'One world and two, over DDS (sleeping off; two cores)'
plot 'worlds.csv' skip 1 using 0:5:xtic(stringcolumn(1)."\n".stringcolumn(2)) lc rgb '#d1603d' notitle
)";

}  // namespace

void worlds(const Options& options, Headline& headline) {
  const int rounds = options.rounds > 0 ? options.rounds : options.quick ? 1 : 5;
  Csv table(options, "worlds",
            "scene,run,steps_per_second,cpu_seconds,over_one_world,waiting_share,mixed_islands_per_step");
  for (const Case& c : kCases) {
    Scene scene = generate(c.scene, c.bodies, 1);
    scene.sleeping = false;  // else the scenes soon cost nothing
    const SessionRuns runs(scene);
    const int steps = options.quick ? c.steps / 6 : c.steps;
    std::map<std::string, std::vector<double>> speed, cpu, waiting, mixed;
    for (int round = 0; round < rounds; ++round)
      for (const Run& r : kRuns) {
        std::printf("\r%s: round %d of %d, %-14s", c.scene, round + 1, rounds, r.name);
        std::fflush(stdout);
        const SessionRun result = runs.run(r.arguments, steps);
        speed[r.name].push_back(steps / result.wall);
        cpu[r.name].push_back(result.cpu);
        waiting[r.name].push_back(result.waiting / result.wall);
        mixed[r.name].push_back(result.mixed_islands / steps);
      }
    const double one = median(speed["1"]);
    for (const Run& r : kRuns)
      table.row(c.scene, r.name, median(speed[r.name]), median(cpu[r.name]), median(speed[r.name]) / one,
                median(waiting[r.name]), median(mixed[r.name]));
    const std::string name = c.scene;
    headline.add(name + ".steps_per_second_single", median(speed["single"]));
    headline.add(name + ".steps_per_second_1_world", one);
    headline.add(name + ".steps_per_second_2_worlds", median(speed["2"]));
    headline.add(name + ".speedup_2_worlds", median(speed["2"]) / one);
    headline.add(name + ".speedup_2_worlds_conservative", median(speed["2 cons."]) / one);
    headline.add(name + ".cpu_2_worlds_over_1", median(cpu["2"]) / median(cpu["1"]));
    std::printf(
        "\r%-7s %5u bodies, %d steps: two worlds %.2f times as fast as one (conservative %.2f; CPU time %.2f "
        "times)\n",
        c.scene, c.bodies, steps, median(speed["2"]) / one, median(speed["2 cons."]) / one,
        median(cpu["2"]) / median(cpu["1"]));
  }
  table.close();
  plot(options, "worlds", kPicture);
}

}  // namespace soda::bench
