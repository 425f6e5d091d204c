// soda run: starts a session's daemons on this machine, follows it to its end, and reports.
#pragma once

namespace CLI {
class App;
}

namespace soda::cli {

void add_run_command(CLI::App& app, int& exit_code);

}  // namespace soda::cli
