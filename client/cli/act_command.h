// soda act push | velocity | pose | grab | move | release | spawn | remove, and soda pause | resume | step | speed:
// what users want of a session that runs.
#pragma once

namespace CLI {
class App;
}

namespace soda::cli {

void add_act_command(CLI::App& app, int& exit_code);
void add_pace_commands(CLI::App& app, int& exit_code);

}  // namespace soda::cli
