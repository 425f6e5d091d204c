// soda-bench: what SODA costs and what it gains, measured.
#include <CLI/CLI.hpp>
#include <iostream>

#include "bench/commands.h"
#include "common/version.h"

namespace {

struct Command {
  const char *name, *summary;
  void (*run)(const soda::bench::Options&, soda::bench::Headline&);
  bool has_cases = false;
};

constexpr Command kCommands[] = {
    {"step", "time and standing towers of our step against stock Bullet, side by side", soda::bench::step},
    {"worlds", "whole runs on one world and on two, over DDS", soda::bench::worlds},
    {"response", "from a user's push until it shows, in real time, over DDS", soda::bench::response},
    {"viewer", "what watching costs worlds, gateway, network and browser", soda::bench::viewer},
    {"rollback", "repairs against computing all again; computing ahead; what the window takes of memory",
     soda::bench::rollback},
    {"latency", "a push in a city, and frames missed while first one world is slow and then the other",
     soda::bench::latency},
    {"sync-groups", "how many worlds hang together at a step, by the number of bodies", soda::bench::sync_groups},
    {"granularity", "how many worlds hang together at a step, by the number of worlds", soda::bench::granularity},
    {"resilience", "steps that stay on time when a world's load grows at once", soda::bench::resilience},
    {"worst-case", "everything in contact with everything, on one, two and four worlds", soda::bench::worst_case},
    {"scaling", "strong and weak scaling of a city, on real worlds and on a model of a cluster", soda::bench::scaling},
    {"accuracy", "errors of known motions against their cost, for many step settings and stock Bullet",
     soda::bench::accuracy, true},
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Benchmarks of SODA"};
  app.require_subcommand(1);
  soda::bench::Options options;
  for (const Command& command : kCommands) {
    CLI::App* sub = app.add_subcommand(command.name, command.summary);
    sub->add_option("--out", options.out, "directory for CSV files and pictures");
    sub->add_option("--json", options.json, "file for the headline numbers");
    if (command.has_cases) {
      sub->add_option("CASE", options.cases, "such as A11; without any: all");
      sub->add_option("--worlds", options.worlds,
                      "compare the bits of the cases on so many worlds (several numbers) with one")
          ->check(CLI::Range(2, 64));
      sub->add_flag("--distribution", options.distribution,
                    "the error of distribution, over 30 seeds of a chaotic scene");
    } else {
      sub->add_option("--rounds", options.rounds, "repetitions of which the median is taken")
          ->check(CLI::Range(1, 100));
    }
    if (command.run == soda::bench::scaling)
      sub->add_option("--worlds", options.worlds,
                      "strong scaling on so many worlds (several numbers), and nothing else")
          ->check(CLI::Range(2, 1024));
    sub->add_flag("--quick", options.quick, "small and short: to see that it works, not to measure");
  }
  CLI11_PARSE(app, argc, argv);
  try {
    if (!options.out.empty()) std::filesystem::create_directories(options.out);
    soda::bench::Headline headline;
    for (const Command& command : kCommands)
      if (app.got_subcommand(command.name)) command.run(options, headline);
    headline.print();
    if (!options.json.empty()) headline.write(options.json);
  } catch (const std::exception& error) {
    std::cerr << "soda-bench: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
