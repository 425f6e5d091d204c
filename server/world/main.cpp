// soda-world: one world of a session.
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <csignal>

#include "common/stop_signals.h"
#include "server/world/options.h"
#include "server/world/run_world.h"

namespace {

void set_up_log(const soda::world::Options& options) {
  spdlog::set_default_logger(spdlog::stderr_logger_mt("soda"));
  spdlog::set_level(options.verbose ? spdlog::level::debug : spdlog::level::info);
  // A supervisor puts name and time before each line itself, and looks at the letter of the level.
  if (options.supervised_by != 0)
    spdlog::set_pattern("%L %v");
  else
    spdlog::set_pattern("%H:%M:%S.%e world " + std::to_string(options.world) + " %^%l%$: %v");
}

}  // namespace

int main(int argc, char** argv) {
  int exit_code = 0;
  const auto options = soda::world::parse_options(argc, argv, exit_code);
  if (!options) return exit_code;
  set_up_log(*options);
  soda::StopSignals signals;
  if (options->supervised_by != 0) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != options->supervised_by) return 128 + SIGTERM;  // it ended before that
  }
  return soda::world::run_world(*options, signals);
}
