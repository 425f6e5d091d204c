#include "client/cli/verify_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include "client/cli/launch.h"
#include "common/dds/checks.h"
#include "common/recording/recording.h"
#include "common/scene_hash.h"

namespace soda::cli {
namespace {

struct VerifyOptions : LaunchOptions {
  std::string recording;
  bool worlds_given = false;
};

int verify(VerifyOptions& options) {
  Recording recording = load_recording(options.recording, false);
  const pb::RecordedSettings& settings = recording.settings;
  if (!options.worlds_given) options.worlds = options.single() ? 1 : std::clamp(settings.worlds(), 1u, dds::kMaxWorlds);
  if (options.worlds != settings.worlds()) recording.scene.territories.clear();  // they were for other worlds
  options.pace = "max";
  options.steps = static_cast<Step>(recording.digests.size()) - 1;
  check(options);
  std::printf("%s: scene %s (%s), %lld of %lld steps, %zu actions, made on %u worlds by soda %s\n",
              options.recording.c_str(), to_hex(recording.scene_hash).c_str(), settings.scene_name().c_str(),
              static_cast<long long>(options.steps), static_cast<long long>(settings.last_step()),
              recording.actions.size(), settings.worlds(), settings.version().c_str());
  if (!recording.cut.empty()) std::printf("not whole: %s; what is there is verified\n", recording.cut.c_str());
  std::fflush(stdout);
  options.follow.files.expected = recording.digests;
  StopSignals signals;
  std::string difference;
  const int code = launch(options, recording.scene, recording.actions, signals, &difference);
  if (!difference.empty())
    std::printf("DIFFERENT: %s\n", difference.c_str());
  else if (code == kExitOk)
    std::printf("equal: %zu steps%s\n", recording.digests.size(),
                recording.damaged ? "; what comes after them is lost" : "");
  return code == kExitOk && recording.damaged ? kExitFailed : code;
}

}  // namespace

void add_verify_command(CLI::App& app, int& exit_code) {
  auto o = std::make_shared<VerifyOptions>();
  CLI::App* command = app.add_subcommand("verify", "simulate a recorded run again and compare every step");
  command->footer(
      "Exit code: 0 when all steps that the recording has are equal (a run that was ended early has fewer); 1 if one\n"
      "is different, the file is damaged, or the run failed; 2 if it is no recording, or an option is wrong.");
  command->add_option("recording", o->recording, "file of `soda run --record`")->required();
  command->add_option("--worlds", o->worlds, "how many worlds; as many as were recorded if not given")
      ->check(CLI::Range(1u, dds::kMaxWorlds));
  command->add_option("--sync", o->sync, "as for `soda run`")
      ->check(CLI::IsMember(sync_names()))
      ->capture_default_str();
  command->add_option("--anticipation", o->window, "K: steps beyond the final one that a world may compute")
      ->check(CLI::Range(Step{1}, kLargestWindow))
      ->capture_default_str();
  command->add_flag("--quiet,-q", o->follow.quiet, "no progress");
  command->add_flag("--verbose,-v", o->follow.verbose, "show all that the daemons say");
  dds::add_network_options(*command, o->network);
  command->callback([o, command, &exit_code] {
    o->worlds_given = command->count("--worlds") > 0;
    exit_code = guarded([&] { return verify(*o); });
  });
}

}  // namespace soda::cli
