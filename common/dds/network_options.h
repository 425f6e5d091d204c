// How a process of a session reaches the others: options that `soda` and `soda-world` share.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace soda::dds {

struct NetworkOptions {
  // "local": this machine only (UDP on 127.0.0.1); "all": every interface; else the IPv4 address of the one to use.
  std::string interface = "local";
  bool shared_memory = true;     // between processes of one machine
  std::string discovery_server;  // HOST:PORT of a fast-discovery-server with id 0; "": simple discovery
  std::uint32_t domain = 0;      // DDS domain
  // s. A process that was silent for longer is taken for gone and must be discovered again. Well above the longest
  // pause expected; a silent world is noticed faster, by its missing Status (kSilence in topics.h). Not shorter, for
  // each time that Fast DDS 2.9 looks whether somebody's lease has ended, which it does about once a lease, it aborts
  // if that one is just leaving (an assertion in PDP::check_remote_participant_liveliness).
  double lease = 30;
};

void add_network_options(CLI::App& app, NetworkOptions& options);

// The same options as arguments, for starting another process.
std::vector<std::string> arguments(const NetworkOptions& options);

}  // namespace soda::dds
