// `soda view` and `soda replay`: a session, or a recording, in the browser.
#pragma once

namespace CLI {
class App;
}

namespace soda::cli {

void add_view_commands(CLI::App& app, int& exit_code);

}  // namespace soda::cli
