#include "client/cli/run_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/cli/launch.h"
#include "common/actions/action_log.h"
#include "common/actions/action_proto.h"
#include "common/dds/checks.h"
#include "common/grid.h"
#include "common/import/load.h"
#include "common/scene/scene_file.h"

namespace soda::cli {
namespace {

struct RunOptions : LaunchOptions {
  std::string scene;
  std::string actions, territories;  // files
  bool worlds_given = false, poses_given = false;
};

Scene load(const RunOptions& options) {
  std::vector<std::string> warnings;
  const bool terminal = isatty(STDERR_FILENO) == 1;
  const auto progress = [&](std::size_t done, std::size_t total) {
    if (terminal && !options.follow.quiet)
      std::fprintf(stderr, "\r\x1b[2Kloading %s: %zu of %zu", options.scene.c_str(), done, total);
    if (terminal && !options.follow.quiet && done == total) std::fputs("\r\x1b[2K", stderr);
  };
  Scene scene = load_any_scene(options.scene, progress, warnings);
  for (const std::string& warning : warnings)
    std::fprintf(stderr, "warning: %s: %s\n", options.scene.c_str(), warning.c_str());
  return scene;
}

// The log that the file's actions make. What world 0 would refuse is refused before anything is started. Throws
// ActionError.
std::vector<LoggedAction> log_of(const std::string& file, const Scene& scene) {
  if (file.empty()) return {};
  ActionLog log(scene);
  log.add_all(load_actions(file, scene), 1, file + ": ");
  return log.entries();
}

int run(RunOptions& options) {
  if (options.single() && options.worlds_given && options.worlds != 1)
    throw std::invalid_argument("--worlds: there is only one world with --sync single");
  if (options.poses_given && options.follow.files.record.empty())
    throw std::invalid_argument("--record-poses: needs --record FILE");
  // Nothing may be written over what is read, or over each other.
  const auto& files = options.follow.files;
  std::vector<std::filesystem::path> used{std::filesystem::weakly_canonical(options.scene)};
  for (const std::filesystem::path& path :
       {std::filesystem::path(options.actions), files.hash_log, files.dump, files.record, options.follow.stats}) {
    if (path.empty()) continue;
    used.push_back(std::filesystem::weakly_canonical(path));
    if (std::count(used.begin(), used.end(), used.back()) > 1)
      throw std::invalid_argument(path.string() + ": is named twice, for different things");
  }
  check(options);
  StopSignals signals;
  // An import can take long, and knows no signals; nothing has been started yet that would have to be ended.
  signals.on_stop([&] { std::_Exit(128 + signals.received()); });
  Scene scene = load(options);
  // Unasked, no more worlds than there are cells to own.
  if (!options.worlds_given && !options.single())
    options.worlds = std::min<WorldId>(options.worlds, static_cast<WorldId>(make_grid(scene).cells()));
  if (!options.territories.empty()) {
    scene.territories = load_territories(options.territories);
    validate(scene, options.territories);
  }
  signals.on_stop(nullptr);
  options.follow.substeps = scene.substeps;
  const std::vector<LoggedAction> log = log_of(options.actions, scene);
  const auto late =
      std::count_if(log.begin(), log.end(), [&](const auto& entry) { return entry.step > options.steps; });
  if (late > 0)
    std::fprintf(stderr, "warning: %s: %td actions are for steps after %lld, the last one, and will not be done\n",
                 options.actions.c_str(), late, static_cast<long long>(options.steps));
  return launch(options, scene, log, signals);
}

}  // namespace

void add_run_command(CLI::App& app, int& exit_code) {
  auto o = std::make_shared<RunOptions>();
  CLI::App* command = app.add_subcommand("run", "simulate a scene on several worlds of this machine");
  command->footer(
      "Exit code: 0 when the last step is final everywhere; 1 if a world or a report failed; 2 if the scene, a file or\n"
      "an option is wrong; 128 + N if signal N ended it (130 after Ctrl-C).");
  command->add_option("scene", o->scene, "scene file (.scene, .txtpb, .sdf, .world)")->required();
  command->add_option("--session", o->session, "name of the session; a new one each time if not given");
  command
      ->add_option("--worlds", o->worlds, "how many worlds; unless given no more than the scene's territory has cells")
      ->check(CLI::Range(1u, dds::kMaxWorlds))
      ->capture_default_str();
  command->add_option("--steps", o->steps, "the run ends when this step is final everywhere")
      ->check(CLI::Range(Step{0}, dds::kMaxStepNumber))
      ->capture_default_str();
  command->add_option("--pace", o->pace, "'realtime', 'max' (as fast as possible), or a multiple of real time")
      ->capture_default_str();
  command
      ->add_option("--sync", o->sync,
                   "'anticipative': worlds run ahead of each other and repair; 'conservative': they wait for each "
                   "other; 'single': one world in one process without network, the reference")
      ->check(CLI::IsMember(sync_names()))
      ->capture_default_str();
  command->add_option("--anticipation", o->window, "K: steps beyond the final one that a world may compute")
      ->check(CLI::Range(Step{1}, kLargestWindow))
      ->capture_default_str();
  command->add_option("--actions", o->actions, "file of what is done to bodies, and when (docs/actions.md)")
      ->check(CLI::ExistingFile);
  command
      ->add_option("--territories", o->territories,
                   "file of regions that worlds own at the start, by hand (docs/scenes.md); chosen if not given")
      ->check(CLI::ExistingFile);
  command
      ->add_option("--balance", o->balance, "'on': worlds that have much to do give cells to their neighbours; 'off'")
      ->check(CLI::IsMember({"on", "off"}))
      ->capture_default_str();
  command
      ->add_option("--input-lead", o->lead,
                   "steps after the displayed one that are closed for actions: an action of now comes after them")
      ->check(CLI::Range(Step{1}, kLargestLead))
      ->capture_default_str();
  command->add_option("--hash-log", o->follow.files.hash_log,
                      "write 'STEP BODIES HASH' for each final step to this file");
  command->add_option("--record", o->follow.files.record,
                      "keep the run in this file: for `soda verify`, and to look at later");
  command->add_option("--record-poses", o->poses, "poses recorded per second of simulated time; 0: none")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  command->add_option("--stats", o->follow.stats, "write statistics to this file (JSON)");
  command->add_option("--dump", o->follow.files.dump, "write whole states to this file, for `soda diff`");
  command->add_option("--dump-steps", o->dump_steps, "A[:B]: the steps to dump; the last one if not given");
  command->add_option("--start", o->start, "start only these worlds (as in 0,2-3); the others are started by hand");
  command->add_flag("--explain", o->follow.explain,
                    "tell at the end how the scene was modelled, how often, and what that cost");
  command->add_flag("--quiet,-q", o->follow.quiet, "no progress");
  command->add_flag("--verbose,-v", o->follow.verbose, "show all that the daemons say");
  dds::add_network_options(*command, o->network);
  command->callback([o, command, &exit_code] {
    o->worlds_given = command->count("--worlds") > 0;
    o->poses_given = command->count("--record-poses") > 0;
    exit_code = guarded([&] { return run(*o); });
  });
}

}  // namespace soda::cli
