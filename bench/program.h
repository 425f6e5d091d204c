// Programs that a benchmark starts, and ends.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <string>
#include <vector>

namespace soda::bench {

// The soda command with these arguments, or another program; interrupted and waited for with the object. Its messages
// go nowhere, its output can be read.
class Program {
 public:
  explicit Program(std::vector<std::string> arguments, std::string program = "");
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  // What it has printed, as soon as that contains `text`, or it has ended, or the time is up.
  std::string output(const std::string& text, std::chrono::seconds at_most);
  double cpu_seconds() const;  // all of its threads so far

 private:
  pid_t pid_ = 0;
  bool group_ = false;  // it does not end those that it has started itself
  int out_ = -1;
  std::string said_;
};

}  // namespace soda::bench
