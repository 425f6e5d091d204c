#include "tests/distributed/program.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace soda::test {

using namespace std::chrono_literals;

Program::Program(const std::vector<std::string>& words, const std::filesystem::path& directory) {
  static std::atomic<int> counter{0};
  file_ = directory / ("output." + std::to_string(counter++));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, file_.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  std::vector<std::string> copies = words;
  std::vector<char*> argv;
  for (std::string& word : copies) argv.push_back(word.data());
  argv.push_back(nullptr);
  const int error = posix_spawn(&pid_, words.front().c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw std::runtime_error("cannot start " + words.front());
}

Program::~Program() {
  if (result_) return;
  signal(SIGCONT);
  signal(SIGTERM);
  if (wait(5s)) return;
  signal(SIGKILL);
  wait(5s);
}

std::optional<int> Program::wait(std::chrono::milliseconds at_most) {
  const auto until = std::chrono::steady_clock::now() + at_most;
  while (!result_) {
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) == pid_)
      result_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
    else if (std::chrono::steady_clock::now() >= until)
      break;
    else
      std::this_thread::sleep_for(5ms);
  }
  return result_;
}

void Program::signal(int number) const {
  if (!result_) kill(pid_, number);
}

std::string Program::output() const {
  std::ifstream file(file_);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

bool Program::wrote(const std::string& text, std::chrono::milliseconds within) const {
  const auto until = std::chrono::steady_clock::now() + within;
  while (output().find(text) == std::string::npos) {
    if (std::chrono::steady_clock::now() >= until) return false;
    std::this_thread::sleep_for(10ms);
  }
  return true;
}

bool alive(pid_t pid) {
  if (kill(pid, 0) != 0) return false;
  std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  std::getline(stat, text);
  const std::size_t end = text.rfind(')');
  return end != std::string::npos && end + 2 < text.size() && text[end + 2] != 'Z';
}

std::vector<pid_t> children_of(pid_t parent) {
  std::vector<pid_t> children;
  const std::string task = "/proc/" + std::to_string(parent) + "/task";
  std::error_code error;
  for (const auto& thread : std::filesystem::directory_iterator(task, error)) {
    std::ifstream file(thread.path() / "children");
    for (pid_t pid = 0; file >> pid;) children.push_back(pid);
  }
  return children;
}

}  // namespace soda::test
