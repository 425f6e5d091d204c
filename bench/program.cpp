#include "bench/program.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <utility>

#include "bench/harness.h"

namespace soda::bench {

Program::Program(std::vector<std::string> arguments, std::string program) {
  group_ = !program.empty();
  if (program.empty()) program = soda_program().string();
  arguments.insert(arguments.begin(), program);
  std::vector<char*> words;
  for (std::string& word : arguments) words.push_back(word.data());
  words.push_back(nullptr);
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("cannot make a pipe");
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("cannot start " + program);
  if (pid_ == 0) {
    setpgid(0, 0);
    dup2(ends[1], STDOUT_FILENO);
    const int nothing = open("/dev/null", O_WRONLY);
    dup2(nothing, STDERR_FILENO);
    execvp(program.c_str(), words.data());
    _exit(127);
  }
  close(ends[1]);
  out_ = ends[0];
}

Program::~Program() {
  kill(group_ ? -pid_ : pid_, SIGINT);
  close(out_);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (waitpid(pid_, nullptr, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > end) kill(-pid_, SIGKILL);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

std::string Program::output(const std::string& text, std::chrono::seconds at_most) {
  const auto end = std::chrono::steady_clock::now() + at_most;
  while (said_.find(text) == std::string::npos && std::chrono::steady_clock::now() < end) {
    pollfd readable{out_, POLLIN, 0};
    if (poll(&readable, 1, 100) <= 0) continue;
    char some[4096];
    const ssize_t n = read(out_, some, sizeof some);
    if (n <= 0) break;
    said_.append(some, static_cast<std::size_t>(n));
  }
  return said_;
}

double Program::cpu_seconds() const {
  std::ifstream file("/proc/" + std::to_string(pid_) + "/stat");
  const std::string all{std::istreambuf_iterator<char>(file), {}};
  // proc(5): fields 14 and 15, user and system time; the name before them may hold spaces.
  std::istringstream fields(all.substr(all.rfind(')') + 2));
  std::string skipped;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  double user = 0, system = 0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

}  // namespace soda::bench
