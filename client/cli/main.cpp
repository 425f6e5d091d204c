// soda: the command.
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <string>

#include "client/cli/act_command.h"
#include "client/cli/diff_command.h"
#include "client/cli/export_command.h"
#include "client/cli/run_command.h"
#include "client/cli/scene_command.h"
#include "client/cli/status_command.h"
#include "client/cli/verify_command.h"
#include "client/cli/view_command.h"
#include "client/cli/watch_command.h"
#include "common/version.h"

namespace {

// Names the subcommands where none was given, or an unknown one: CLI11 says no more than that one is required.
std::string explain(const CLI::App* app, const CLI::Error& error) {
  const CLI::App* command = app;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  std::string text;
  for (const CLI::App* known : command->get_subcommands({})) text += (text.empty() ? ": " : ", ") + known->get_name();
  if (text.empty() || error.get_name() != "RequiredError") return CLI::FailureMessage::simple(app, error);
  if (const auto unknown = command->remaining(); !unknown.empty()) text += "; not '" + unknown.front() + "'";
  return CLI::FailureMessage::simple(app, CLI::Error(error.get_name(), error.what() + text));
}

}  // namespace

int main(int argc, char** argv) {
  spdlog::set_default_logger(spdlog::stderr_logger_mt("soda"));
  spdlog::set_pattern("%^%l%$: %v");
  CLI::App app("SODA: distributed rigid-body simulation with the same bits on any number of processes", "soda");
  app.set_version_flag("--version", std::string("soda ") + soda::kVersion);
  app.require_subcommand(1);
  app.failure_message(explain);
  int exit_code = 0;
  soda::cli::add_run_command(app, exit_code);
  soda::cli::add_watch_command(app, exit_code);
  soda::cli::add_view_commands(app, exit_code);
  soda::cli::add_status_commands(app, exit_code);
  soda::cli::add_act_command(app, exit_code);
  soda::cli::add_pace_commands(app, exit_code);
  soda::cli::add_diff_command(app, exit_code);
  soda::cli::add_verify_command(app, exit_code);
  soda::cli::add_export_command(app, exit_code);
  soda::add_scene_command(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  return exit_code;
}
