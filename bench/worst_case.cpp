// `soda-bench worst-case`: everything in contact with everything, the case that the paper names as its worst: one
// island that reaches through all worlds. Each of them solves all of it, so that more worlds can gain nothing; this
// tells what they lose. Whole runs of `soda run` over DDS, in interleaved rounds.
#include <cstdio>
#include <map>

#include "bench/commands.h"
#include "bench/session_runs.h"
#include "common/scene/scene_builder.h"

namespace soda::bench {
namespace {

constexpr int kHigh = 4;
constexpr int kAcross[] = {10, 15, 20};
constexpr unsigned kWorlds[] = {1, 2, 4};
constexpr Step kSettled = 60, kSteps = 120;  // without the start, and the first use of the window's memory

// A block of cubes, each pressed a little against its neighbours.
Scene block(int across) {
  constexpr double kEdge = 0.5, kPitch = 0.999 * kEdge;
  SceneBuilder builder("block");
  builder.scene.sleeping = false;
  for (int k = 0; k < kHigh; ++k)
    for (int i = 0; i < across; ++i)
      for (int j = 0; j < across; ++j)
        builder.add(Box{Vec3::Constant(kEdge)},
                    Vec3(kPitch * (i - 0.5 * across), kPitch * (j - 0.5 * across), kPitch * (k + 0.5)));
  builder.add_ground(200);
  return builder.finish();
}

constexpr const char* kPicture = R"(
set datafile missing NaN  # so that lines go on across the rows of other worlds
set key below
set xlabel 'bodies in one island'
set ylabel 'against one world'
set yrange [0:*]
set grid
set title 'Everything in contact with everything (two cores)'
of(worlds, column_) = column(2) == worlds ? column(column_) : NaN
plot 'worst_case.csv' skip 1 using 1:(of(2, 5)) with linespoints lw 2 pt 7 lc rgb '#d1603d' title '2 worlds: time of a step', \
  '' skip 1 using 1:(of(2, 6)) with linespoints lw 2 dt 2 pt 7 lc rgb '#d1603d' title '2 worlds: CPU time of all', \
  '' skip 1 using 1:(of(4, 5)) with linespoints lw 2 pt 5 lc rgb '#3d7ea6' title '4 worlds: time of a step', \
  '' skip 1 using 1:(of(4, 6)) with linespoints lw 2 dt 2 pt 5 lc rgb '#3d7ea6' title '4 worlds: CPU time of all'
)";

struct Measured {
  std::vector<double> wall, cpu, mixed, bytes;  // per step
};

}  // namespace

void worst_case(const Options& options, Headline& headline) {
  const int rounds = options.rounds > 0 ? options.rounds : options.quick ? 1 : 3;
  Csv table(options, "worst_case",
            "bodies,worlds,step_ms,cpu_ms,step_over_one,cpu_over_one,mixed_islands_per_world,kilobytes_sent");
  for (const int across : kAcross) {
    if (options.quick && across != kAcross[0]) break;
    const SessionRuns runs(block(across));
    const int bodies = across * across * kHigh;
    std::map<unsigned, Measured> measured;
    for (int round = 0; round < rounds; ++round)
      for (const unsigned worlds : kWorlds) {
        std::printf("\r%d bodies: round %d of %d, %u worlds  ", bodies, round + 1, rounds, worlds);
        std::fflush(stdout);
        const std::string arguments = "--balance off --worlds " + std::to_string(worlds);
        const SessionRun step = runs.per_step(arguments, kSettled, kSteps);
        Measured& of = measured[worlds];
        of.wall.push_back(step.wall);
        of.cpu.push_back(step.cpu);
        of.mixed.push_back(step.mixed_islands / worlds);
        of.bytes.push_back(step.bytes_sent);
      }
    const double wall = median(measured[1].wall), cpu = median(measured[1].cpu);
    std::printf("\n");
    for (const unsigned worlds : kWorlds) {
      const Measured& of = measured[worlds];
      const double slower = median(of.wall) / wall, dearer = median(of.cpu) / cpu;
      table.row(bodies, worlds, 1e3 * median(of.wall), 1e3 * median(of.cpu), slower, dearer, median(of.mixed),
                1e-3 * median(of.bytes));
      std::printf(
          "  %u: %7.2f ms per step (%.2f), %7.2f ms of CPU (%.2f), %.2f mixed islands per world, %.0f kB sent\n",
          worlds, 1e3 * median(of.wall), slower, 1e3 * median(of.cpu), dearer, median(of.mixed),
          1e-3 * median(of.bytes));
      if (worlds == 1) continue;
      const std::string end = "_" + std::to_string(worlds) + ".bodies_" + std::to_string(bodies);
      headline.add("worst.step_over_one" + end, slower);
      headline.add("worst.cpu_over_one" + end, dearer);
      headline.add("worst.mixed_islands" + end, median(of.mixed));
    }
  }
  table.close();
  plot(options, "worst_case", kPicture);
}

}  // namespace soda::bench
