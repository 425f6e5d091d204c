#include "client/cli/watch_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "client/cli/dds_source.h"
#include "client/cli/session_run.h"
#include "common/dds/checks.h"

namespace soda::cli {
namespace {

struct WatchOptions {
  std::string session = "soda";
  dds::NetworkOptions network;
  FollowOptions follow;
};

int watch(const WatchOptions& options) {
  dds::check_session_name(options.session);
  StopSignals signals;
  Collector collector(options.follow.files);
  Table table(options.follow.quiet);
  DdsSource source(options.network, options.session, !options.follow.files.dump.empty());
  if (!options.follow.quiet) table.say("waiting for session '" + options.session + "' ...");
  Processes none([](const std::string&, const std::string&) {});
  return follow(source, none, table, signals, collector, options.follow);
}

}  // namespace

void add_watch_command(CLI::App& app, int& exit_code) {
  auto o = std::make_shared<WatchOptions>();
  CLI::App* command = app.add_subcommand("watch", "follow a session that was started by hand, to its end");
  command->add_option("--session", o->session, "name of the session")->capture_default_str();
  command->add_option("--hash-log", o->follow.files.hash_log,
                      "write 'STEP BODIES HASH' for each final step to this file");
  command->add_option("--stats", o->follow.stats, "write statistics to this file (JSON)");
  command->add_option("--dump", o->follow.files.dump, "write the whole states that world 0 dumps (its --dump-steps)");
  command->add_flag("--quiet,-q", o->follow.quiet, "no progress");
  dds::add_network_options(*command, o->network);
  command->callback([o, &exit_code] { exit_code = guarded([&] { return watch(*o); }); });
}

}  // namespace soda::cli
