// `soda view`: the viewer of a session, in the browser.
#pragma once

namespace CLI {
class App;
}

namespace soda::cli {

void add_view_command(CLI::App& app, int& exit_code);

}  // namespace soda::cli
