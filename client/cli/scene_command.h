// soda scene make | convert | check
#pragma once

#include <CLI/CLI.hpp>

namespace soda {

// Adds the subcommand `scene` to the app. Its callbacks set `exit_code`: 0, or 2 when the input is bad, after a message
// on standard error that names the file, the body and the field.
void add_scene_command(CLI::App& app, int& exit_code);

}  // namespace soda
