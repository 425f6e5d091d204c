// Runs simulated sessions by the number: each seed is a scene, worlds, territories and a network, and must give the
// bits of one world. A seed that fails is printed with the command that repeats exactly that run.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <mutex>
#include <thread>

#include "tests/simulation/scenario.h"

namespace {

using namespace soda::test;

struct Totals {
  std::uint64_t conservative = 0, lost = 0, doubled = 0, touched = 0, held = 0, balanced = 0;
  soda::border::CoreStats stats;
};

}  // namespace

int main(int argc, char** argv) {
  std::uint64_t first = 1, seeds = 300;
  unsigned jobs = std::max(1u, std::thread::hardware_concurrency());
  bool verbose = false;
  CLI::App app("Simulated sessions: the same bits on many worlds as on one, whatever the network does", "simulate");
  app.add_option("--seeds", seeds, "how many")->check(CLI::Range(1ul, 100000000ul))->capture_default_str();
  app.add_option("--first", first, "the first of them")->capture_default_str();
  app.add_option("--jobs", jobs, "at a time")->check(CLI::Range(1u, 256u))->capture_default_str();
  app.add_flag("--verbose,-v", verbose, "say what each is");
  CLI11_PARSE(app, argc, argv);

  std::mutex mutex;
  Totals totals;
  std::uint64_t done = 0, failed = 0;
  std::atomic<std::uint64_t> next{0};
  const auto began = std::chrono::steady_clock::now();
  const auto work = [&] {
    for (std::uint64_t i = next++; i < seeds; i = next++) {
      const std::uint64_t seed = first + i;
      std::string text;
      SessionResult result;
      try {
        const Scenario scenario = scenario_of(seed);
        text = scenario.text();
        result = run_scenario(scenario);
        const std::lock_guard lock(mutex);
        if (scenario.network.budget != 0) totals.balanced += result.total.cells_given;
        totals.conservative += scenario.network.sync == soda::border::Sync::kConservative;
      } catch (const std::exception& e) {
        result.failure = e.what();
      }
      const std::lock_guard lock(mutex);
      totals.lost += result.lost, totals.doubled += result.doubled, totals.touched += result.touched;
      totals.held += result.held;
      add(totals.stats, result.total);
      if (verbose) std::printf("seed %lu: %s\n", seed, text.c_str());
      if (!result.failure.empty()) {
        ++failed;
        std::printf("FAILED seed %lu (%s): %s\n  to repeat it: %s --first %lu --seeds 1\n", seed, text.c_str(),
                    result.failure.c_str(), argv[0], seed);
      }
      if (++done % 50 == 0 || done == seeds)
        std::printf("%lu of %lu seeds, %lu failed, %.0f s\n", done, seeds, failed,
                    std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count());
      std::fflush(stdout);
    }
  };
  std::vector<std::thread> threads;
  for (unsigned j = 0; j < jobs; ++j) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();

  const auto& s = totals.stats;
  const std::pair<const char*, std::uint64_t> happened[] = {
      {"conservative sessions", totals.conservative},
      {"messages lost", totals.lost},
      {"messages doubled", totals.doubled},
      {"repairs of what had not changed", totals.touched},
      {"times that a world waited for what was on its way", totals.held},
      {"steps anticipated", s.anticipated},
      {"steps told before they were done", s.told_early},
      {"rollbacks", s.timeline.steps_redone},
      {"results of bodies done again", s.timeline.bodies_redone},
      {"actions, summed over worlds", s.actions},
      {"messages that came before an action", s.held_back},
      {"frames corrected", s.frames_corrected},
      {"islands mixed", s.mixed_islands},
      {"bodies that changed worlds", s.arrived},
      {"bodies handed over with their cells", s.timeline.handed_over},
      {"cells given while it ran, at random", s.cells_given - totals.balanced},
      {"cells given by worlds that balance their loads", totals.balanced},
      {"offers of cells declined", s.offers_declined},
      {"links opened while it ran", s.links_opened},
      {"wide bodies told", s.wide_bodies},
      {"parts passed on", s.parts_passed},
      {"times that passing one on was left to somebody else", s.parts_left},
  };
  bool all = true;
  for (const auto& [what, count] : happened) {
    std::printf("%12lu %s\n", count, what);
    all = all && count > 0;
  }
  std::printf("%12lu steps of rollback at most\n", s.timeline.longest_rollback);
  if (seeds >= 100 && !all) {
    std::printf("FAILED: something that should have happened did not\n");
    return 1;
  }
  return failed == 0 ? 0 : 1;
}
