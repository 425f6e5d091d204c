#include "client/cli/view_command.h"

#include <spdlog/fmt/fmt.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <random>
#include <string>

#include "client/cli/exit_code.h"
#include "client/viewer/gateway.h"
#include "client/viewer/live_source.h"
#include "client/viewer/replay_source.h"
#include "common/dds/checks.h"
#include "common/stop_signals.h"

namespace soda::cli {
namespace {

struct ViewOptions {
  std::string session = "soda";
  viewer::HttpOptions http;
  bool read_only = false;
  Step history = 180;
  std::string recording;
  std::string page;  // folder; "": where the build has put it
  dds::NetworkOptions network;
};

constexpr std::chrono::seconds kLongWait{10};  // for a session

std::string random_token() {
  std::random_device device;
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", device());
  return token;
}

bool is_loopback(const std::string& address) { return address.rfind("127.", 0) == 0 || address == "::1"; }

// Opens the gateway and says where. `open_to_all`: where no token is asked for, none is needed to act.
std::unique_ptr<viewer::Gateway> open(ViewOptions& options, const viewer::StaticFiles& files, const std::string& what,
                                      bool open_to_all) {
  if (options.read_only)
    options.http.token.clear();
  else if (options.http.token.empty() && open_to_all)
    options.http.open_to_all = true;
  else if (options.http.token.empty())
    options.http.token = random_token();
  auto gateway = std::make_unique<viewer::Gateway>(options.http, files);
  const std::string host = is_loopback(options.http.address) ? "localhost" : options.http.address;
  const std::string token = options.http.token.empty() ? "" : "?token=" + options.http.token;
  std::printf("%s can be watched%s at  http://%s:%u/%s\n", what.c_str(),
              token.empty()               ? ""
              : options.recording.empty() ? " and acted on"
                                          : " and controlled",
              host.c_str(), static_cast<unsigned>(gateway->port()), token.c_str());
  std::fflush(stdout);
  return gateway;
}

std::filesystem::path page_of(const ViewOptions& options) {
  return options.page.empty() ? viewer::page_folder() : std::filesystem::path(options.page);
}

int view(ViewOptions options) {
  dds::check_session_name(options.session);
  StopSignals signals;
  const viewer::StaticFiles files(page_of(options));
  const auto gateway = open(options, files, "session '" + options.session + "'", false);
  const auto began = std::chrono::steady_clock::now();
  bool waited = false;     // and said so
  std::int64_t after = 0;  // sessions of this name follow one another
  while (signals.received() == 0) {
    viewer::LiveSource source(options.network, options.session,
                              {.history = options.history, .on_news = [&] { gateway->wake(); }, .after = after});
    gateway->run(source, [&] {
      if (!waited && (source.ready() || std::chrono::steady_clock::now() - began > kLongWait)) {
        waited = true;
        if (!source.ready()) std::printf("no session '%s' has been heard of yet; waiting\n", options.session.c_str());
        std::fflush(stdout);
      }
      return signals.received() != 0 || source.superseded();
    });
    after = source.next();
  }
  return kExitOk;
}

int replay(ViewOptions options) {
  StopSignals signals;
  const viewer::StaticFiles files(page_of(options));
  viewer::ReplaySource source(options.recording);
  if (!source.cut().empty()) std::printf("not whole: %s; what is there is shown\n", source.cut().c_str());
  const auto gateway = open(options, files, options.recording, true);
  gateway->run(source, [&] { return signals.received() != 0; });
  return kExitOk;
}

void add_page_options(CLI::App& command, ViewOptions& o) {
  command.add_option("--port,-p", o.http.port, "to serve the page at; 0: any that is free")->capture_default_str();
  command.add_option("--address", o.http.address, "to listen at; others than this machine's own only with care")
      ->capture_default_str();
  command
      .add_option(
          "--token", o.http.token,
          "who has it in the link may act, others only watch; by default random, and none is needed for a recording")
      ->check([](const std::string& token) {
        const bool good = token.size() >= 8 && token.find_first_not_of(
                                                   "0123456789abcdefghijklmnopqrstuvwxyz"
                                                   "ABCDEFGHIJKLMNOPQRSTUVWXYZ-_") == std::string::npos;
        return good ? "" : "at least 8 letters, digits, dashes and underscores";
      });
  command.add_flag("--read-only", o.read_only, "nobody may act");
  command.add_option("--page", o.page, "folder of the page, for developers of it");
}

}  // namespace

void add_view_commands(CLI::App& app, int& exit_code) {
  auto o = std::make_shared<ViewOptions>();
  CLI::App* command = app.add_subcommand("view", "show a session in the browser, and let people act on it");
  command->add_option("--session", o->session, "name of the session; it may begin later")->capture_default_str();
  add_page_options(*command, *o);
  command->add_option("--history", o->history, "steps in the past that can be shown")
      ->capture_default_str()
      ->check(CLI::Range(Step{1}, Step{100'000}));
  dds::add_network_options(*command, o->network);
  command->callback([o, &exit_code] { exit_code = guarded([&] { return view(*o); }); });

  auto r = std::make_shared<ViewOptions>();
  CLI::App* replay_command = app.add_subcommand("replay", "show a recording in the browser");
  replay_command->add_option("recording", r->recording, "file of soda run --record")->required();
  add_page_options(*replay_command, *r);
  replay_command->callback([r, &exit_code] { exit_code = guarded([&] { return replay(*r); }); });
}

}  // namespace soda::cli
