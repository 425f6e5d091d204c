// Starts a session's daemons on this machine for a scene, and follows it to its end: what `soda run` and `soda verify`
// have in common.
#pragma once

#include <string>
#include <vector>

#include "client/cli/session_run.h"
#include "common/actions/action.h"
#include "common/dds/network_options.h"
#include "common/run_settings.h"
#include "common/scene/scene.h"

namespace soda::cli {

struct LaunchOptions {
  std::string session;  // "": a new name
  bool named = false;   // by the user: somebody else may have chosen it, too
  WorldId worlds = 4;
  Step steps = kDefaultSteps;
  std::string pace = "realtime";
  std::string sync = "anticipative";
  Step window = kDefaultWindow;
  Step lead = kDefaultLead;
  std::string balance = "on";
  std::string dump_steps;
  std::string start;  // worlds to start here; "": all
  double poses = 30;  // recorded per second of simulated time; 0: none
  dds::NetworkOptions network;
  FollowOptions follow;

  bool single() const { return sync == "single"; }
};

// Complains about what does not go together, and completes the options. Throws std::invalid_argument.
void check(LaunchOptions& options);

// `options` have been checked; `actions` are the log that the run begins with. Returns the command's exit code;
// `difference` gets the first step that was not as expected (CollectorOptions), if any.
int launch(LaunchOptions options, const Scene& scene, const std::vector<LoggedAction>& actions, StopSignals& signals,
           std::string* difference = nullptr);

}  // namespace soda::cli
