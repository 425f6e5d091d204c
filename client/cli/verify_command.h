// soda verify: simulates a recorded run again and compares every step.
#pragma once

namespace CLI {
class App;
}

namespace soda::cli {

void add_verify_command(CLI::App& app, int& exit_code);

}  // namespace soda::cli
