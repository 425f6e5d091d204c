#include "common/dds/network_options.h"

#include <CLI/CLI.hpp>

namespace soda::dds {

void add_network_options(CLI::App& app, NetworkOptions& options) {
  const char* group = "Network";
  app.add_option("--interface,--network", options.interface,
                 "'local' (this machine only), 'all' (every interface), or the IPv4 address of the interface to use")
      ->capture_default_str()
      ->group(group);
  app.add_flag("!--no-shm", options.shared_memory, "no shared memory between processes of one machine, only UDP")
      ->group(group);
  app.add_option("--discovery-server", options.discovery_server,
                 "HOST:PORT of a `fast-discovery-server -i 0`; recommended from about 32 worlds")
      ->group(group);
  app.add_option("--domain", options.domain, "DDS domain")
      ->check(CLI::Range(0, 232))
      ->capture_default_str()
      ->group(group);
  app.add_option("--lease", options.lease, "seconds of silence after which a process is taken for gone")
      ->check(CLI::Range(0.2, 3600.0))
      ->group("");
}

std::vector<std::string> arguments(const NetworkOptions& options) {
  std::vector<std::string> args{"--interface", options.interface,
                                "--domain",    std::to_string(options.domain),
                                "--lease",     std::to_string(options.lease)};
  if (!options.shared_memory) args.emplace_back("--no-shm");
  if (!options.discovery_server.empty()) args.insert(args.end(), {"--discovery-server", options.discovery_server});
  return args;
}

}  // namespace soda::dds
