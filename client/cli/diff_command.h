// soda diff: finds the first thing in which two runs differ.
#pragma once

#include <filesystem>
#include <stdexcept>

namespace CLI {
class App;
}

namespace soda::cli {

void add_diff_command(CLI::App& app, int& exit_code);

// A file that cannot be compared; what() names it and says why.
struct DiffError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Each prints what it finds and returns whether all is equal. They throw DiffError or DumpError.
bool equal_logs(const std::filesystem::path& a, const std::filesystem::path& b);
bool equal_dumps(const std::filesystem::path& a, const std::filesystem::path& b);

}  // namespace soda::cli
