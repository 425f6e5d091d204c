// Puts a daemon together as the command line says, and runs it to its end.
#pragma once

#include "common/stop_signals.h"
#include "server/world/options.h"

namespace soda::world {

// Exit codes of soda-world, beside 128 + number of the signal that ended it.
enum ExitCode { kExitDone = 0, kExitFailed = 1, kExitBadInput = 2, kExitRefused = 3 };

int run_world(const Options& options, StopSignals& signals);

}  // namespace soda::world
