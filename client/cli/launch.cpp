#include "client/cli/launch.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numeric>
#include <random>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "client/cli/dds_source.h"
#include "common/actions/action_proto.h"
#include "common/dds/checks.h"
#include "common/grid.h"
#include "common/scene/scene_file.h"
#include "common/territory.h"

namespace soda::cli {
namespace {

// A descriptor that closes itself, above those that children are to find theirs at.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fcntl(fd, F_DUPFD_CLOEXEC, 64)) {
    ::close(fd);
    if (fd_ < 0) throw std::system_error(errno, std::generic_category(), "a descriptor");
  }
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  void close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

 private:
  int fd_;
};

// How long to look for another session of the same name.
constexpr std::chrono::milliseconds kLookForOthers{1000};

// Where world 0 finds what it inherits.
constexpr int kSceneFd = 3, kReportFd = 4, kActionsFd = 5;

// An anonymous file in memory, so that nothing is left behind on disk whatever happens.
std::unique_ptr<Descriptor> in_memory(const std::string& bytes) {
  const int raw = memfd_create("soda-handed-over", MFD_CLOEXEC);
  if (raw < 0) throw std::system_error(errno, std::generic_category(), "memfd_create");
  auto fd = std::make_unique<Descriptor>(raw);
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::write(fd->get(), bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw std::system_error(errno, std::generic_category(), "keeping what is handed over");
    done += static_cast<std::size_t>(n);
  }
  lseek(fd->get(), 0, SEEK_SET);
  return fd;
}

std::string new_session_name() {
  std::random_device device;
  char name[64];
  std::snprintf(name, sizeof name, "soda-%d-%08x", static_cast<int>(getpid()), device());
  return name;
}

// The worlds to be started here.
std::vector<WorldId> started_here(const LaunchOptions& o) {
  std::vector<WorldId> start(o.worlds);
  std::iota(start.begin(), start.end(), 0u);
  if (o.start.empty()) return start;
  start = parse_worlds(o.start);
  if (start.empty() || start.front() != 0)
    throw std::invalid_argument("--start: world 0 must be started here, because it has the scene");
  if (start.back() >= o.worlds)
    throw std::invalid_argument("--start: there is no world " + std::to_string(start.back()));
  return start;
}

std::vector<std::string> arguments(const LaunchOptions& o, double dt, WorldId world) {
  std::vector<std::string> args{"--supervised-by", std::to_string(getpid()), "--world", std::to_string(world)};
  const auto add = [&](const std::vector<std::string>& more) { args.insert(args.end(), more.begin(), more.end()); };
  if (!o.single()) {
    add({"--session", o.session});
    add(dds::arguments(o.network));
  }
  if (o.follow.verbose) add({"--verbose"});
  if (o.follow.explain) add({"--explain"});
  if (world != 0) return args;
  add({"--scene-fd", std::to_string(kSceneFd), "--worlds", std::to_string(o.worlds), "--steps", std::to_string(o.steps),
       "--pace", o.pace, "--sync", o.sync, "--anticipation", std::to_string(o.window), "--input-lead",
       std::to_string(o.lead), "--balance", o.balance});
  add({"--actions-fd", std::to_string(kActionsFd)});
  if (!o.follow.files.record.empty()) {
    const double every = o.poses > 0 ? std::max(1.0, std::round(1 / (o.poses * dt))) : 0;
    add({"--pose-every", std::to_string(static_cast<Step>(std::min(every, 1e6)))});
  }
  if (o.single()) add({"--report-fd", std::to_string(kReportFd)});
  if (!o.dump_steps.empty()) add({"--dump-steps", o.dump_steps});
  return args;
}

}  // namespace

void check(LaunchOptions& o) {
  o.named = !o.session.empty();
  if (!o.named) o.session = new_session_name();
  dds::check_session_name(o.session);
  (void)parse_pace(o.pace);
  if (o.single()) {
    if (!o.start.empty()) throw std::invalid_argument("--start: there is only one world with --sync single");
    o.worlds = 1;
  }
  if (!o.follow.files.dump.empty()) {
    if (o.dump_steps.empty()) o.dump_steps = std::to_string(o.steps);
    if (parse_steps(o.dump_steps).second > o.steps) throw std::invalid_argument("--dump-steps: beyond the last step");
  } else if (!o.dump_steps.empty()) {
    throw std::invalid_argument("--dump-steps: needs --dump FILE");
  }
  (void)started_here(o);
}

int launch(LaunchOptions options, const Scene& scene, const std::vector<LoggedAction>& actions, StopSignals& signals,
           std::string* difference) {
  const std::vector<WorldId> start = started_here(options);
  (void)initial_territories(scene, make_grid(scene), options.worlds);  // says so now if they are wrong
  std::string encoded = encode_scene(scene);
  const auto scene_fd = in_memory(encoded), actions_fd = in_memory(encode_actions(actions));
  if (!options.follow.files.record.empty()) options.follow.files.encoded_scene = std::move(encoded);
  // In this order: the source hears before anybody speaks, and outlives the daemons.
  Table table(options.follow.quiet);
  std::unique_ptr<ReportSource> source;
  std::unique_ptr<Descriptor> pipe_in, pipe_out;
  if (options.single()) {
    int fds[2];
    if (pipe2(fds, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
    pipe_in = std::make_unique<Descriptor>(fds[0]);
    pipe_out = std::make_unique<Descriptor>(fds[1]);
    source = std::make_unique<PipeSource>(pipe_in->get());
  } else {
    source = std::make_unique<DdsSource>(options.network, options.session, !options.follow.files.dump.empty(),
                                         !options.follow.files.record.empty());
  }
  if (options.named && !options.single() && source->next(kLookForOthers))
    throw std::invalid_argument("session '" + options.session + "' runs already: choose another --session");
  Collector collector(options.follow.files);
  Processes processes(
      [&](const std::string& name, const std::string& line) { show_line(table, name, line, options.follow.verbose); });
  for (const WorldId world : start) {
    std::vector<std::pair<int, int>> inherited;
    if (world == 0) inherited = {{scene_fd->get(), kSceneFd}, {actions_fd->get(), kActionsFd}};
    if (pipe_out) inherited.emplace_back(pipe_out->get(), kReportFd);
    processes.start("world " + std::to_string(world), beside_me("soda-world"), arguments(options, scene.dt, world),
                    inherited);
  }
  if (pipe_out) pipe_out->close();
  scene_fd->close();
  actions_fd->close();
  if (start.size() < options.worlds)
    table.say("session '" + options.session + "': start the other worlds by hand, as in\n  soda-world --session " +
              options.session + " --world I");
  const int code = follow(*source, processes, table, signals, collector, options.follow);
  if (difference) *difference = collector.difference();
  return code;
}

}  // namespace soda::cli
