#include "server/world/run_world.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>

#include "common/actions/action_proto.h"
#include "common/dds/participant.h"
#include "common/scene/scene_file.h"
#include "common/scene/validate.h"
#include "common/scene_hash.h"
#include "server/world/daemon.h"
#include "server/world/dds_reports.h"
#include "server/world/dds_transport.h"
#include "server/world/no_transport.h"
#include "server/world/pipe_reports.h"
#include "server/world/session_guest.h"
#include "server/world/session_host.h"

namespace soda::world {
namespace {

using namespace std::chrono_literals;

// A world that is done stays for neighbours that may still ask for something, until world 0 ends the session. If world
// 0 is gone for that long, nobody will.
constexpr auto kWithoutHost = 30s;
constexpr auto kHostFinish = 5s;

struct EncodedScene {
  Scene scene;
  std::string bytes;
};

std::string read_all(int fd, const char* what) {
  std::string bytes;
  char buffer[1 << 16];
  for (;;) {
    const ssize_t n = ::read(fd, buffer, sizeof buffer);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw std::system_error(errno, std::generic_category(), std::string("reading ") + what);
    if (n == 0) return bytes;
    bytes.append(buffer, static_cast<std::size_t>(n));
  }
}

EncodedScene scene_of(const Options& options) {
  if (options.scene_fd < 0) {
    Scene scene = load_scene(options.scene);
    std::string bytes = encode_scene(scene);
    return {std::move(scene), std::move(bytes)};
  }
  std::string bytes = read_all(options.scene_fd, "the scene");
  ::close(options.scene_fd);
  return {decode_scene(bytes, "the scene handed over"), std::move(bytes)};
}

std::uint64_t random_word() {
  std::random_device device;
  std::uint64_t word = 0;
  while (word == 0) word = (std::uint64_t{device()} << 32) | device();
  return word;
}

wire::Session describe(const Options& options, const EncodedScene& scene) {
  wire::Session s;
  s.protocol(options.protocol);
  s.version(kVersion);
  s.instance(random_word());
  s.started(std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
                .count());
  s.scene_name(scene.scene.name.substr(0, 200));
  s.scene_hash(scene_hash(scene.bytes));
  s.scene_bytes(scene.bytes.size());
  s.worlds(options.worlds);
  s.last_step(options.steps);
  s.sync(static_cast<std::uint8_t>(options.sync));
  s.window(static_cast<std::uint32_t>(options.window));
  s.dt(scene.scene.dt);
  s.lead(static_cast<std::uint32_t>(options.lead));
  s.pace(options.pace);
  s.dump_first(options.dump_first);
  s.dump_last(options.dump_last);
  s.watched(options.supervised_by != 0 || options.watched);
  s.pose_every(static_cast<std::uint32_t>(options.pose_every));
  s.balance(options.balance);
  return s;
}

DaemonSettings settings_of(const wire::Session& session, const Options& options) {
  DaemonSettings settings;
  settings.instance = session.instance();
  settings.me = options.world;
  settings.worlds = session.worlds();
  settings.epoch = options.epoch;
  settings.last_step = session.last_step();
  settings.sync = session.sync() == wire::SYNC_ANTICIPATIVE ? border::Sync::kAnticipative : border::Sync::kConservative;
  settings.window = session.window();
  settings.dump_first = session.dump_first();
  settings.dump_last = session.dump_last();
  settings.pose_every = session.pose_every();
  settings.measure = options.explain;
  settings.balance = session.balance();
  return settings;
}

void obey(Daemon& daemon, const wire::Control& control) {
  if (control.phase() == wire::PHASE_FAILED) {
    spdlog::error("the session has failed; leaving it");
    return daemon.stop();
  }
  if (control.phase() == wire::PHASE_STOPPED) {
    spdlog::info("the session was stopped; leaving it");
    return daemon.stop();
  }
  if (control.phase() != wire::PHASE_GATHERING) {
    daemon.close_actions(control.closed(), control.logged());
    daemon.set_pace(control.pace());
    daemon.set_limit(control.limit());
  }
  if (control.phase() == wire::PHASE_ENDED) daemon.release();
}

SessionListener listener_of(Daemon& daemon) {
  return {[&daemon](const wire::Control& control) { obey(daemon, control); },
          [&daemon](const wire::LogEntry& entry) { daemon.act(entry); }};
}

std::vector<WantedAction> actions_of(const Options& options, const Scene& scene) {
  if (options.actions_fd >= 0) return decode_actions(read_all(options.actions_fd, "the actions"), scene);
  return options.actions.empty() ? std::vector<WantedAction>() : load_actions(options.actions, scene);
}

void print_summary(const Options& options, const Daemon& daemon, double wall) {
  if (options.supervised_by != 0) return;
  const border::CoreStats& stats = daemon.core().stats();
  std::printf(
      "world %u: step %lld is final; %zu bodies, %llu steps in %.2f s, %llu of them synchronised, "
      "%llu mixed islands, %llu bodies arrived, %llu departed, %.1f MB sent, %llu interruptions\n",
      options.world, static_cast<long long>(daemon.core().final_step()), daemon.core().own_bodies(),
      static_cast<unsigned long long>(stats.steps), wall, static_cast<unsigned long long>(stats.syncs),
      static_cast<unsigned long long>(stats.mixed_islands), static_cast<unsigned long long>(stats.arrived),
      static_cast<unsigned long long>(stats.departed), 1e-6 * static_cast<double>(stats.bytes_sent),
      static_cast<unsigned long long>(daemon.interruptions()));
}

// Runs the daemon under the eyes of the signals.
int run(Daemon& daemon, const Options& options, StopSignals& signals) {
  const auto began = std::chrono::steady_clock::now();
  signals.on_stop([&] { daemon.stop(); });
  Daemon::End end{};
  try {
    end = daemon.run();
  } catch (...) {
    signals.on_stop(nullptr);
    throw;
  }
  signals.on_stop(nullptr);
  print_summary(options, daemon, std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count());
  if (end == Daemon::End::kDone) return kExitDone;
  spdlog::info("stopped at step {}", daemon.core().final_step());
  return signals.received() != 0 ? 128 + signals.received() : kExitFailed;
}

int run_single(const Options& options, StopSignals& signals) {
  EncodedScene scene = scene_of(options);
  const wire::Session session = describe(options, scene);
  SessionService* listener = nullptr;
  PipeReports reports(options.report_fd, [&](const wire::Status& status) {
    if (listener != nullptr) listener->status(status);
  });
  reports.session(session);
  NoTransport transport;
  const auto shared = std::make_shared<const Scene>(scene.scene);
  std::vector<WantedAction> actions = actions_of(options, *shared);
  Daemon daemon(std::move(scene.scene), settings_of(session, options), transport, reports);
  const SessionListener listening = listener_of(daemon);
  SessionService service(session, shared, std::move(actions),
                         {[&](const wire::Control& control) {
                            reports.control(control);
                            listening.control(control);
                          },
                          [&](const wire::LogEntry& entry) {
                            reports.entry(entry);
                            listening.entry(entry);
                          },
                          [](const auto&) {}});
  listener = &service;
  return run(daemon, options, signals);
}

// A second world 0 must leave before it has confused anybody.
void look_for_conflict(const SessionHost& host) {
  if (const std::string conflict = host.conflict(); !conflict.empty()) throw Refused(conflict);
}

int run_host(const Options& options, StopSignals& signals) {
  EncodedScene scene = scene_of(options);
  const wire::Session session = describe(options, scene);
  dds::Participant participant(options.network, options.session, "soda-world-0");
  DdsReports reports(participant, session.instance(), options.world, session.watched(), session.dump_first() >= 0,
                     session.pose_every() > 0, [&] { return signals.received() != 0; });
  DdsTransport transport(participant, options.world);
  const auto shared = std::make_shared<const Scene>(scene.scene);
  std::vector<WantedAction> actions = actions_of(options, *shared);
  Daemon daemon(std::move(scene.scene), settings_of(session, options), transport, reports);
  SessionHost host(participant, session, scene.bytes, shared, std::move(actions), listener_of(daemon));
  spdlog::info("session '{}': {} worlds, scene {} ({} kB), {} steps", options.session, session.worlds(),
               to_hex(session.scene_hash()), session.scene_bytes() / 1000, session.last_step());
  std::atomic<bool> over{false};
  std::string conflict;
  std::thread watch([&] {
    while (!over.load() && conflict.empty()) {
      std::this_thread::sleep_for(50ms);
      conflict = host.conflict();
    }
    if (!conflict.empty()) daemon.stop();
  });
  const auto end_watch = [&] {
    over.store(true);
    watch.join();
  };
  int code = kExitFailed;
  try {
    code = run(daemon, options, signals);
  } catch (...) {
    end_watch();
    throw;
  }
  end_watch();
  look_for_conflict(host);
  if (code == kExitDone) {
    host.finish(kHostFinish);
  } else {
    // `soda run` stops its worlds with SIGTERM where one of them has failed, or it has itself.
    const bool failed = options.supervised_by != 0 && signals.received() == SIGTERM;
    host.leave(failed ? wire::PHASE_FAILED : wire::PHASE_STOPPED);
  }
  return code;
}

// While it lasts, watches whether world 0 is there, and lets the daemon go if it stays away.
class HostWatch {
 public:
  HostWatch(const SessionGuest& guest, Daemon& daemon)
      : thread_([this, &guest, &daemon] {
          std::chrono::milliseconds gone{0};
          for (constexpr auto look = 100ms; !over_.load(); std::this_thread::sleep_for(look)) {
            gone = guest.host_gone() ? gone + look : 0ms;
            if (gone == 5s) spdlog::warn("world 0 of the session is gone");
            if (gone == kWithoutHost) {
              daemon.release();  // if all is done, there is nothing to wait for
              std::this_thread::sleep_for(look);
              daemon.stop();
            }
          }
        }) {}
  ~HostWatch() {
    over_.store(true);
    thread_.join();
  }

 private:
  std::atomic<bool> over_{false};
  std::thread thread_;
};

wire::Join claim_of(const Options& options) {
  wire::Join claim;
  claim.protocol(options.protocol);
  claim.version(kVersion);
  claim.nonce(random_word());
  claim.world(options.world);
  claim.epoch(options.epoch);
  claim.scene_hash(options.expect_scene);
  char host[256] = "?";
  gethostname(host, sizeof host - 1);
  claim.host(host);
  claim.pid(static_cast<std::uint32_t>(getpid()));
  return claim;
}

int run_guest(const Options& options, StopSignals& signals) {
  dds::Participant participant(options.network, options.session, "soda-world-" + std::to_string(options.world));
  SessionGuest guest(participant, options.session, claim_of(options));
  const auto stop = [&] { return signals.received() != 0; };
  auto admitted = guest.join(stop);
  if (!admitted) return 128 + signals.received();
  const wire::Session& session = admitted->session;
  if (options.expect_scene != 0 && options.expect_scene != session.scene_hash())
    throw Refused("session '" + options.session + "' runs scene " + to_hex(session.scene_hash()) + ", not " +
                  to_hex(options.expect_scene));
  spdlog::info("admitted to session '{}' as world {} of {}", options.session, options.world, session.worlds());
  Scene scene = decode_scene(admitted->encoded_scene, "the scene of session '" + options.session + "'");
  admitted->encoded_scene = {};
  DdsReports reports(participant, session.instance(), options.world, session.watched(), session.dump_first() >= 0,
                     session.pose_every() > 0, stop);
  DdsTransport transport(participant, options.world);
  Daemon daemon(std::move(scene), settings_of(session, options), transport, reports);
  // The guest outlives the daemon, and must not talk to it then, whatever happens.
  struct Listening {
    SessionGuest& guest;
    ~Listening() { guest.stop_listening(); }
  } const listening{guest};
  guest.listen(listener_of(daemon));
  const HostWatch watch(guest, daemon);
  return run(daemon, options, signals);
}

}  // namespace

int run_world(const Options& options, StopSignals& signals) {
  try {
    if (options.sync == SyncMode::kSingle) return run_single(options, signals);
    return options.world == 0 ? run_host(options, signals) : run_guest(options, signals);
  } catch (const Refused& e) {
    spdlog::error("{}", e.what());
    return kExitRefused;
  } catch (const SceneError& e) {
    spdlog::error("{}", e.what());
    return kExitBadInput;
  } catch (const ActionError& e) {
    spdlog::error("{}", e.what());
    return kExitBadInput;
  } catch (const std::invalid_argument& e) {
    spdlog::error("{}", e.what());
    return kExitBadInput;
  } catch (const std::exception& e) {
    spdlog::critical("{}", e.what());
    return kExitFailed;
  }
}

}  // namespace soda::world
