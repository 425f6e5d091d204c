// A program that a test starts, with what it writes. Ended, by its process id, with the test at the latest.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace soda::test {

class Program {
 public:
  // `words`: the program's path and its arguments. Standard output and error go to a file in `directory`.
  Program(const std::vector<std::string>& words, const std::filesystem::path& directory);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  pid_t pid() const { return pid_; }
  // Its exit code, or -N if signal N ended it; none if it still runs after that time.
  std::optional<int> wait(std::chrono::milliseconds at_most);
  void signal(int number) const;
  std::string output() const;
  // Whether it has written `text`, waiting for it as long as that.
  bool wrote(const std::string& text, std::chrono::milliseconds within) const;

 private:
  pid_t pid_ = -1;
  std::filesystem::path file_;
  std::optional<int> result_;
};

bool alive(pid_t pid);
// Processes that this one started, directly, and that still run.
std::vector<pid_t> children_of(pid_t parent);

}  // namespace soda::test
