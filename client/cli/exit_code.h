// The exit codes of `soda`, and which of them an exception becomes.
#pragma once

#include <functional>

namespace soda::cli {

enum ExitCode { kExitEqual = 0, kExitOk = 0, kExitDifferent = 1, kExitFailed = 1, kExitBadInput = 2, kExitNobody = 3 };

// Runs what a command does and returns the exit code that it returns. What it throws is told on stderr: options,
// scenes, actions, recordings and output files that cannot be used are kExitBadInput, everything else is `otherwise`.
int guarded(const std::function<int()>& command, ExitCode otherwise = kExitFailed);

}  // namespace soda::cli
