#include "client/cli/status_command.h"

#include <google/protobuf/util/json_util.h>
#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>

#include "client/cli/exit_code.h"
#include "client/viewer/live_source.h"
#include "common/dds/checks.h"
#include "common/stop_signals.h"

namespace soda::cli {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

struct StatusOptions {
  std::string session = "soda";
  bool json = false;
  dds::NetworkOptions network;
};

std::string bytes_text(double bytes) {
  const char* const units[] = {"B", "kB", "MB", "GB"};
  int unit = 0;
  for (; bytes >= 1000 && unit < 3; ++unit) bytes /= 1000;
  return fmt::format("{:.{}f} {}", bytes, unit > 0 && bytes < 10 ? 1 : 0, units[unit]);
}

std::string pace_text(const view::Clocks& clocks) {
  if (clocks.gathering()) return "has not begun: worlds are missing";
  if (clocks.paused()) return "paused";
  if (clocks.pace() == 0) return fmt::format("as fast as possible, {:.2f} x real time", clocks.speed());
  const bool slow = clocks.speed() < 0.95 * clocks.pace();
  return fmt::format("{:.2f} x real time{}", clocks.speed(),
                     slow ? fmt::format(": slow motion, {:.2f} was asked for", clocks.pace()) : "");
}

std::string text_of(const std::string& session, const view::Clocks& clocks, const view::Worlds& worlds) {
  std::string text = fmt::format("session '{}'  {}\ndisplayed step {}, final {}\n\n", session, pace_text(clocks),
                                 clocks.displayed(), clocks.final());
  text += fmt::format("{:>5}  {:<10} {:>9} {:>9} {:>5} {:>8} {:>8} {:>5} {:>5} {:>9} {:>9} {:>9}  {}\n", "world",
                      "state", "clock", "final", "ahead", "bodies", "steps/s", "load", "waits", "rollbacks",
                      "to others", "memory", "where");
  for (int w = 0; w < worlds.world_size(); ++w) {
    const view::WorldState& s = worlds.world(w);
    const view::WorldClock& c = clocks.world(w);
    text +=
        fmt::format("{:>5}  {:<10} {:>9} {:>9} {:>5} {:>8} {:>8.1f} {:>4.0f}% {:>4.0f}% {:>9} {:>7}/s {:>9}  {} {}\n",
                    w, s.state(), c.clock(), c.final(), c.clock() - c.final(), s.bodies(), s.steps_per_second(),
                    100 * s.load(), 100 * s.waiting(), s.rollbacks(), bytes_text(s.bytes_per_second()),
                    bytes_text(static_cast<double>(s.memory())), s.host(), s.pid());
  }
  return text;
}

std::string json_of(const view::Clocks& clocks, const view::Worlds& worlds) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string a, b;
  (void)google::protobuf::util::MessageToJsonString(clocks, &a, options);
  (void)google::protobuf::util::MessageToJsonString(worlds, &b, options);
  return "{\"clocks\":" + a + ",\"worlds\":" + b + "}\n";
}

// Rates are of this long.
constexpr auto kEvery = 1s;
constexpr auto kPatience = 5s;

// Calls `tell` every so often, from the time on when all worlds were heard of; false when there is nothing to tell of.
template <typename Tell>
bool follow_status(const StatusOptions& options, const StopSignals& signals, Tell&& tell) {
  dds::check_session_name(options.session);
  viewer::LiveSource source(options.network, options.session, {.history = 1, .transforms = false});
  const auto began = Clock::now();
  const auto wait = [&](Clock::time_point until, auto&& done) {
    while (signals.received() == 0 && Clock::now() < until && !done()) {
      (void)source.poll();
      std::this_thread::sleep_for(20ms);
    }
  };
  wait(began + kPatience, [&] {
    const view::Clocks clocks = source.clocks();
    bool all = source.ready() && clocks.world_size() > 0;
    for (const view::WorldClock& world : clocks.world()) all = all && !world.silent();
    return all || source.ended();
  });
  if (signals.received() != 0) return true;
  if (!source.ready()) {
    const auto end = source.ended();
    std::fprintf(stderr, "error: %s\n",
                 end ? end->reason.c_str() : ("nobody is there in session '" + options.session + "'").c_str());
    return false;
  }
  (void)source.worlds();
  do {
    wait(Clock::now() + kEvery, [&] { return source.ended().has_value(); });
    if (!tell(source.clocks(), source.worlds())) return true;
  } while (signals.received() == 0 && !source.ended());
  return true;
}

int status(const StatusOptions& options) {
  const StopSignals signals;
  const bool told = follow_status(options, signals, [&](const view::Clocks& clocks, const view::Worlds& worlds) {
    const std::string text = options.json ? json_of(clocks, worlds) : text_of(options.session, clocks, worlds);
    std::fputs(text.c_str(), stdout);
    return false;
  });
  return told ? kExitOk : kExitNobody;
}

int top(const StatusOptions& options) {
  const StopSignals signals;
  const bool terminal = isatty(STDOUT_FILENO) != 0;
  const bool told = follow_status(options, signals, [&](const view::Clocks& clocks, const view::Worlds& worlds) {
    const std::string text = text_of(options.session, clocks, worlds);
    std::fputs(((terminal ? "\033[H\033[2J" : "\n") + text + (terminal ? "\nCtrl-C ends this\n" : "")).c_str(), stdout);
    std::fflush(stdout);
    return true;
  });
  return told ? kExitOk : kExitNobody;
}

}  // namespace

void add_status_commands(CLI::App& app, int& exit_code) {
  const auto add = [&](const char* name, const char* text, int (*run)(const StatusOptions&)) {
    auto o = std::make_shared<StatusOptions>();
    CLI::App* command = app.add_subcommand(name, text);
    command->add_option("--session", o->session, "name of the session")->capture_default_str();
    dds::add_network_options(*command, o->network);
    command->callback([o, run, &exit_code] { exit_code = guarded([&] { return run(*o); }); });
    return std::pair(command, o);
  };
  const auto [command, options] = add("status", "how the worlds of a session are doing, measured for a second", status);
  command->add_flag("--json", options->json, "as JSON, for programs (fields: Clocks, Worlds of idl/viewer.proto)");
  add("top", "the same, live, until Ctrl-C or the session's end", top);
}

}  // namespace soda::cli
