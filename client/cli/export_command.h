// soda export: a recording as a file that other programs show.
#pragma once

namespace CLI {
class App;
}

namespace soda::cli {

void add_export_command(CLI::App& app, int& exit_code);

}  // namespace soda::cli
