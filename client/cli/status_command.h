// `soda status` and `soda top`: how a session's worlds are doing, once or live; the numbers of the viewer's panels.
#pragma once

namespace CLI {
class App;
}

namespace soda::cli {

void add_status_commands(CLI::App& app, int& exit_code);

}  // namespace soda::cli
