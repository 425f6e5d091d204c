#include "client/cli/run_command.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <system_error>
#include <vector>

#include "client/cli/dds_source.h"
#include "client/cli/session_run.h"
#include "common/actions/action_log.h"
#include "common/actions/action_proto.h"
#include "common/dds/checks.h"
#include "common/grid.h"
#include "common/import/load.h"
#include "common/run_settings.h"
#include "common/scene/scene_file.h"
#include "common/scene/validate.h"
#include "common/territory.h"

namespace soda::cli {
namespace {

struct RunOptions {
  std::string scene;
  std::string session;
  WorldId worlds = 4;
  bool worlds_given = false;
  Step steps = kDefaultSteps;
  std::string pace = "realtime";
  std::string sync = "anticipative";
  Step window = kDefaultWindow;
  Step lead = kDefaultLead;
  std::string actions;  // file
  std::string dump_steps;
  std::string start;  // worlds to start here; "": all
  dds::NetworkOptions network;
  FollowOptions follow;

  bool single() const { return sync == "single"; }
};

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

// Where world 0 finds what it inherits.
constexpr int kSceneFd = 3, kReportFd = 4;

// An anonymous file in memory, so that no scene is left behind on disk whatever happens.
std::unique_ptr<Descriptor> in_memory(const std::string& bytes) {
  const int raw = memfd_create("soda-scene", MFD_CLOEXEC);
  if (raw < 0) throw std::system_error(errno, std::generic_category(), "memfd_create");
  auto fd = std::make_unique<Descriptor>(raw);
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::write(fd->get(), bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw std::system_error(errno, std::generic_category(), "keeping the scene");
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

Scene load(const RunOptions& options) {
  std::vector<std::string> warnings;
  const bool terminal = isatty(STDERR_FILENO) == 1;
  const auto progress = [&](std::size_t done, std::size_t total) {
    if (terminal && !options.follow.quiet)
      std::fprintf(stderr, "\r\x1b[2Kloading %s: %zu of %zu", options.scene.c_str(), done, total);
    if (terminal && !options.follow.quiet && done == total) std::fputs("\r\x1b[2K", stderr);
  };
  Scene scene = load_any_scene(options.scene, progress, warnings);
  for (const std::string& warning : warnings)
    std::fprintf(stderr, "warning: %s: %s\n", options.scene.c_str(), warning.c_str());
  return scene;
}

// Complains about what does not go together, before anything is started. Throws std::invalid_argument.
std::vector<WorldId> checked(RunOptions& o) {
  if (o.session.empty()) o.session = new_session_name();
  if (!dds::good_session_name(o.session))
    throw std::invalid_argument("--session: 1 to 64 letters, digits, dots, dashes and underscores, not '" + o.session +
                                "'");
  (void)parse_pace(o.pace);
  if (o.single()) {
    if (!o.start.empty()) throw std::invalid_argument("--start: there is only one world with --sync single");
    if (o.worlds_given && o.worlds != 1)
      throw std::invalid_argument("--worlds: there is only one world with --sync single");
    o.worlds = 1;
  }
  if (!o.follow.files.dump.empty()) {
    if (o.dump_steps.empty()) o.dump_steps = std::to_string(o.steps);
    if (parse_steps(o.dump_steps).second > o.steps) throw std::invalid_argument("--dump-steps: beyond the last step");
  } else if (!o.dump_steps.empty()) {
    throw std::invalid_argument("--dump-steps: needs --dump FILE");
  }
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

// What world 0 would refuse is refused before anything is started. Throws ActionError.
void check_actions(const std::string& file, const Scene& scene) {
  ActionLog log(scene);
  std::size_t number = 0;
  for (WantedAction& wanted : load_actions(file, scene)) {
    const auto result = log.add(std::move(wanted), 1);
    ++number;
    if (const auto* refused = std::get_if<ActionLog::Refused>(&result))
      throw ActionError(file + ": action " + std::to_string(number) + ": " + refused->reason);
  }
}

std::vector<std::string> arguments(const RunOptions& o, WorldId world) {
  std::vector<std::string> args{"--supervised-by", std::to_string(getpid()), "--world", std::to_string(world)};
  const auto add = [&](const std::vector<std::string>& more) { args.insert(args.end(), more.begin(), more.end()); };
  if (!o.single()) {
    add({"--session", o.session});
    add(dds::arguments(o.network));
  }
  if (o.follow.verbose) add({"--verbose"});
  if (world != 0) return args;
  add({"--scene-fd", std::to_string(kSceneFd), "--worlds", std::to_string(o.worlds), "--steps", std::to_string(o.steps),
       "--pace", o.pace, "--sync", o.sync, "--anticipation", std::to_string(o.window), "--input-lead",
       std::to_string(o.lead)});
  if (!o.actions.empty()) add({"--actions", std::filesystem::absolute(o.actions).string()});
  if (o.single()) add({"--report-fd", std::to_string(kReportFd)});
  if (!o.dump_steps.empty()) add({"--dump-steps", o.dump_steps});
  return args;
}

// Parts of a run that must go in this order: the source hears before anybody speaks, and outlives the daemons.
int run(RunOptions& options) {
  const std::vector<WorldId> start = checked(options);
  StopSignals signals;
  std::unique_ptr<Descriptor> scene_fd;
  {
    // An import can take long, and knows no signals; nothing has been started yet that would have to be ended.
    signals.on_stop([&] { std::_Exit(128 + signals.received()); });
    const Scene scene = load(options);
    signals.on_stop(nullptr);
    (void)bisect(scene, make_grid(scene), options.worlds);  // says so now if there are more worlds than cells
    if (!options.actions.empty()) check_actions(options.actions, scene);
    scene_fd = in_memory(encode_scene(scene));
  }
  Collector collector(options.follow.files);
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
    source = std::make_unique<DdsSource>(options.network, options.session, !options.follow.files.dump.empty());
  }
  Processes processes(
      [&](const std::string& name, const std::string& line) { show_line(table, name, line, options.follow.verbose); });
  for (const WorldId world : start) {
    std::vector<std::pair<int, int>> inherited;
    if (world == 0) inherited.emplace_back(scene_fd->get(), kSceneFd);
    if (pipe_out) inherited.emplace_back(pipe_out->get(), kReportFd);
    processes.start("world " + std::to_string(world), beside_me("soda-world"), arguments(options, world), inherited);
  }
  if (pipe_out) pipe_out->close();
  scene_fd->close();
  if (start.size() < options.worlds)
    table.say("session '" + options.session + "': start the other worlds by hand, as in\n  soda-world --session " +
              options.session + " --world I");
  return follow(*source, processes, table, signals, collector, options.follow);
}

}  // namespace

void add_run_command(CLI::App& app, int& exit_code) {
  auto o = std::make_shared<RunOptions>();
  CLI::App* command = app.add_subcommand("run", "simulate a scene on several worlds of this machine");
  command->add_option("scene", o->scene, "scene file (.scene, .txtpb, .sdf, .world)")->required();
  command->add_option("--session", o->session, "name of the session; a new one each time if not given");
  command->add_option("--worlds", o->worlds, "how many worlds")
      ->check(CLI::Range(1u, dds::kMaxWorlds))
      ->capture_default_str();
  command->add_option("--steps", o->steps, "the run ends when this step is final everywhere")
      ->check(CLI::Range(Step{0}, dds::kMaxStepNumber))
      ->capture_default_str();
  command->add_option("--pace", o->pace, "'realtime', 'max' (as fast as possible), or a multiple of real time")
      ->capture_default_str();
  command
      ->add_option("--sync", o->sync,
                   "'anticipative': worlds run ahead of each other and repair; 'conservative': they wait for each "
                   "other; 'single': one world in one process without network, the reference")
      ->check(CLI::IsMember(sync_names()))
      ->capture_default_str();
  command->add_option("--anticipation", o->window, "K: steps beyond the final one that a world may compute")
      ->check(CLI::Range(Step{1}, kLargestWindow))
      ->capture_default_str();
  command->add_option("--actions", o->actions, "file of what is done to bodies, and when (docs/actions.md)")
      ->check(CLI::ExistingFile);
  command
      ->add_option("--input-lead", o->lead,
                   "steps after the displayed one that are closed for actions: an action of now comes after them")
      ->check(CLI::Range(Step{1}, kLargestLead))
      ->capture_default_str();
  command->add_option("--hash-log", o->follow.files.hash_log,
                      "write 'STEP BODIES HASH' for each final step to this file");
  command->add_option("--stats", o->follow.stats, "write statistics to this file (JSON)");
  command->add_option("--dump", o->follow.files.dump, "write whole states to this file, for `soda diff`");
  command->add_option("--dump-steps", o->dump_steps, "A[:B]: the steps to dump; the last one if not given");
  command->add_option("--start", o->start, "start only these worlds (as in 0,2-3); the others are started by hand");
  command->add_flag("--quiet,-q", o->follow.quiet, "no progress");
  command->add_flag("--verbose,-v", o->follow.verbose, "show all that the daemons say");
  dds::add_network_options(*command, o->network);
  command->callback([o, command, &exit_code] {
    try {
      o->worlds_given = command->count("--worlds") > 0;
      exit_code = run(*o);
    } catch (const SceneError& e) {
      std::fprintf(stderr, "error: %s\n", e.what());
      exit_code = kExitBadInput;
    } catch (const ActionError& e) {
      std::fprintf(stderr, "error: %s\n", e.what());
      exit_code = kExitBadInput;
    } catch (const std::invalid_argument& e) {
      std::fprintf(stderr, "error: %s\n", e.what());
      exit_code = kExitBadInput;
    } catch (const ReportError& e) {
      std::fprintf(stderr, "error: %s\n", e.what());
      exit_code = kExitBadInput;
    } catch (const std::exception& e) {
      std::fprintf(stderr, "error: %s\n", e.what());
      exit_code = kExitFailed;
    }
  });
}

}  // namespace soda::cli
