// soda watch: follows a session that was started elsewhere.
#pragma once

namespace CLI {
class App;
}

namespace soda::cli {

void add_watch_command(CLI::App& app, int& exit_code);

}  // namespace soda::cli
