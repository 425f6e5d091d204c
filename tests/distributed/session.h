// What the tests of whole sessions share: a directory of their own, scenes, and the command.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/ids.h"
#include "tests/distributed/program.h"

namespace soda::test {

using namespace std::chrono_literals;

class SessionTest : public ::testing::Test {
 protected:
  SessionTest();
  ~SessionTest() override;

  std::string path(const std::string& name) const { return (directory_ / name).string(); }
  const std::filesystem::path& directory() const { return directory_; }
  // A name that no other session has.
  static std::string new_session();
  // The file of a generated scene. `cell`: edge of a territory cell in m, 0: chosen by the program.
  std::string scene(const std::string& generator, std::uint32_t bodies, double cell = 0) const;

  // A file of actions, on bodies of that scene file (.scene), at steps up to `steps`.
  std::string actions(const std::string& scene_file, Step steps, std::size_t count, std::uint64_t seed) const;

  static std::vector<std::string> soda(const std::vector<std::string>& arguments);
  static std::vector<std::string> soda_world(const std::vector<std::string>& arguments);
  // Runs `soda` to its end and expects that exit code; returns what it wrote.
  std::string run(const std::vector<std::string>& arguments, int exit_code = 0,
                  std::chrono::milliseconds at_most = 120s) const;
  // Waits for that program and expects that exit code.
  static void expect_exit(Program& program, int exit_code, std::chrono::milliseconds at_most = 120s);
  // Expects the same lines in both.
  void expect_equal_logs(const std::string& a, const std::string& b) const;

 private:
  std::filesystem::path directory_;
};

std::string read_text(const std::string& path);
// The lines of a file.
std::vector<std::string> lines_of(const std::string& path);
// The first number under that key in a --stats file, after the key `section`: "total" by default.
double stat(const std::string& stats_path, const std::string& key, const std::string& section = "total");

}  // namespace soda::test
