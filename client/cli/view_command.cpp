#include "client/cli/view_command.h"

#include <spdlog/fmt/fmt.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <random>
#include <string>

#include "client/cli/exit_code.h"
#include "client/viewer/gateway.h"
#include "client/viewer/live_source.h"
#include "common/dds/checks.h"
#include "common/stop_signals.h"

namespace soda::cli {
namespace {

struct ViewOptions {
  std::string session = "soda";
  viewer::HttpOptions http;
  bool read_only = false;
  Step history = 180;
  std::string page;  // folder; "": where the build has put it
  dds::NetworkOptions network;
};

std::string random_token() {
  std::random_device device;
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", device());
  return token;
}

bool is_loopback(const std::string& address) { return address.rfind("127.", 0) == 0 || address == "::1"; }

int view(ViewOptions options) {
  dds::check_session_name(options.session);
  if (options.read_only)
    options.http.token.clear();
  else if (options.http.token.empty())
    options.http.token = random_token();
  StopSignals signals;
  const viewer::StaticFiles files(options.page.empty() ? viewer::page_folder() : std::filesystem::path(options.page));
  viewer::Gateway gateway(options.http, files);
  viewer::LiveSource source(options.network, options.session, options.history, [&] { gateway.wake(); });
  const std::string host = is_loopback(options.http.address) ? "localhost" : options.http.address;
  const std::string url = fmt::format("http://{}:{}/", host, gateway.port());
  if (options.http.token.empty())
    std::printf("session '%s' can be watched at  %s\n", options.session.c_str(), url.c_str());
  else
    std::printf("session '%s' can be watched and acted on at  %s?token=%s\n", options.session.c_str(), url.c_str(),
                options.http.token.c_str());
  std::fflush(stdout);
  gateway.run(source, [&] { return signals.received() != 0; });
  return kExitOk;
}

}  // namespace

void add_view_command(CLI::App& app, int& exit_code) {
  auto o = std::make_shared<ViewOptions>();
  CLI::App* command = app.add_subcommand("view", "show a session in the browser, and let people act on it");
  command->add_option("--session", o->session, "name of the session; it may begin later")->capture_default_str();
  command->add_option("--port,-p", o->http.port, "to serve the page at; 0: any that is free")->capture_default_str();
  command->add_option("--address", o->http.address, "to listen at; others than this machine's own only with care")
      ->capture_default_str();
  command->add_option("--token", o->http.token, "who has it in the link may act, others only watch; by default random")
      ->check([](const std::string& token) {
        const bool good = token.size() >= 8 && token.find_first_not_of(
                                                   "0123456789abcdefghijklmnopqrstuvwxyz"
                                                   "ABCDEFGHIJKLMNOPQRSTUVWXYZ-_") == std::string::npos;
        return good ? "" : "at least 8 letters, digits, dashes and underscores";
      });
  command->add_flag("--read-only", o->read_only, "nobody may act");
  command->add_option("--history", o->history, "steps in the past that can be shown")
      ->capture_default_str()
      ->check(CLI::Range(Step{1}, Step{100'000}));
  command->add_option("--page", o->page, "folder of the page, for developers of it");
  dds::add_network_options(*command, o->network);
  command->callback([o, &exit_code] { exit_code = guarded([&] { return view(*o); }); });
}

}  // namespace soda::cli
