// The daemons that the command has started: starts them, reads what they say, notices their end, ends them.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace soda::cli {

struct Ended {
  std::string name;
  int exit_code = 0;                   // -1 if a signal ended it
  int signal = 0;                      // 0 if it exited
  std::string reason;                  // "exited with code 1", "was killed by signal 9 (Killed)"
  std::deque<std::string> last_lines;  // of its log
};

class Processes {
 public:
  // `on_line` gets each line that a process writes to its standard output and error.
  using LineHandler = std::function<void(const std::string& name, const std::string& line)>;
  explicit Processes(LineHandler on_line);
  ~Processes();  // ends what still runs, hard if need be
  Processes(const Processes&) = delete;
  Processes& operator=(const Processes&) = delete;

  // Starts the program with `inherited` descriptors: {here, there}. It gets no terminal input. Throws
  // std::system_error.
  void start(const std::string& name, const std::string& program, const std::vector<std::string>& arguments,
             const std::vector<std::pair<int, int>>& inherited);
  // Reads what was written and says who has ended since the last call. Does not block.
  std::vector<Ended> poll();
  std::size_t running() const;
  // Asks all to end by `signal`, and after that long makes them (SIGKILL). `meanwhile` is called again and again.
  void stop(int signal, std::chrono::milliseconds patience, const std::function<void()>& meanwhile = nullptr);

 private:
  struct Process;
  void read_output(Process& process);

  LineHandler on_line_;
  std::vector<std::unique_ptr<Process>> processes_;
};

// A program beside this one.
std::string beside_me(const std::string& program);

}  // namespace soda::cli
