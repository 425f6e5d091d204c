#include "client/cli/processes.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <thread>

namespace soda::cli {
namespace {

constexpr std::size_t kLinesKept = 12;

void check(int error, const char* what) {
  if (error != 0) throw std::system_error(error, std::generic_category(), what);
}

std::string reason_of(int status) {
  if (WIFEXITED(status)) return "exited with code " + std::to_string(WEXITSTATUS(status));
  return "was killed by signal " + std::to_string(WTERMSIG(status)) + " (" + strsignal(WTERMSIG(status)) + ")";
}

}  // namespace

struct Processes::Process {
  std::string name;
  pid_t pid = -1;
  int output = -1;
  bool running = true;
  std::string partial;  // a line that has not ended yet
  std::deque<std::string> last_lines;

  ~Process() {
    if (output >= 0) ::close(output);
  }
};

Processes::Processes(LineHandler on_line) : on_line_(std::move(on_line)) {}

Processes::~Processes() { stop(SIGTERM, std::chrono::seconds(2)); }

void Processes::start(const std::string& name, const std::string& program, const std::vector<std::string>& arguments,
                      const std::vector<std::pair<int, int>>& inherited) {
  int pipe_fds[2];
  if (pipe2(pipe_fds, O_CLOEXEC) != 0) check(errno, "pipe");
  auto process = std::make_unique<Process>();
  process->name = name;
  process->output = pipe_fds[0];
  fcntl(pipe_fds[0], F_SETFL, O_NONBLOCK);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, pipe_fds[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, pipe_fds[1], STDERR_FILENO);
  for (const auto& [here, there] : inherited) posix_spawn_file_actions_adddup2(&actions, here, there);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, dflt;
  sigemptyset(&none);
  sigemptyset(&dflt);
  sigaddset(&dflt, SIGPIPE);
  posix_spawnattr_setsigmask(&attributes, &none);  // this process has blocked its stop signals
  posix_spawnattr_setsigdefault(&attributes, &dflt);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);

  std::vector<std::string> words{program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const int error = posix_spawn(&process->pid, program.c_str(), &actions, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  ::close(pipe_fds[1]);
  check(error, ("starting " + program).c_str());
  processes_.push_back(std::move(process));
}

void Processes::read_output(Process& process) {
  char buffer[4096];
  for (ssize_t n = 0; (n = ::read(process.output, buffer, sizeof buffer)) > 0;) {
    process.partial.append(buffer, static_cast<std::size_t>(n));
    for (std::size_t end = 0; (end = process.partial.find('\n')) != std::string::npos;) {
      const std::string line = process.partial.substr(0, end);
      process.partial.erase(0, end + 1);
      process.last_lines.push_back(line);
      if (process.last_lines.size() > kLinesKept) process.last_lines.pop_front();
      on_line_(process.name, line);
    }
  }
}

std::vector<Ended> Processes::poll() {
  std::vector<Ended> ended;
  for (const auto& process : processes_) {
    if (!process->running) continue;
    read_output(*process);
    int status = 0;
    if (waitpid(process->pid, &status, WNOHANG) != process->pid) continue;
    process->running = false;
    read_output(*process);
    Ended e{process->name, -1, 0, reason_of(status), process->last_lines};
    if (WIFEXITED(status))
      e.exit_code = WEXITSTATUS(status);
    else
      e.signal = WTERMSIG(status);
    ended.push_back(std::move(e));
  }
  return ended;
}

std::size_t Processes::running() const {
  return static_cast<std::size_t>(
      std::count_if(processes_.begin(), processes_.end(), [](const auto& process) { return process->running; }));
}

void Processes::stop(int signal, std::chrono::milliseconds patience, const std::function<void()>& meanwhile) {
  const auto signal_all = [this](int number) {
    for (const auto& process : processes_)
      if (process->running) ::kill(process->pid, number);
  };
  signal_all(signal);
  signal_all(SIGCONT);  // a stopped process would not hear of it
  const auto until = std::chrono::steady_clock::now() + patience;
  bool killed = false;
  while (poll(), running() > 0) {
    if (!killed && std::chrono::steady_clock::now() >= until) {
      signal_all(SIGKILL);
      killed = true;
    }
    if (meanwhile) meanwhile();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

std::string beside_me(const std::string& program) {
  std::error_code error;
  const auto me = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return program;
  return (me.parent_path() / program).string();
}

}  // namespace soda::cli
