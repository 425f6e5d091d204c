#include "common/dds/network_qos.h"

#include <arpa/inet.h>
#include <fastdds/rtps/attributes/ServerAttributes.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/utils/IPFinder.h>
#include <fastrtps/utils/IPLocator.h>
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>

namespace soda::dds {

namespace fdds = eprosima::fastdds::dds;
namespace frtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::Duration_t;

namespace {

constexpr std::uint32_t kShmSegment = 16u << 20;  // bytes; by default 512 KiB, in which 1 MiB takes 12 ms, not 1.1 ms
// ms. By default a port of shared memory whose reader did not move for a second is taken for dead, and what comes of
// that when the reader had only been stopped may be a port that nobody hears. What the dead leave behind is found by
// its locks.
constexpr std::uint32_t kShmPatience = 3600 * 1000;
constexpr std::uint32_t kSocketBuffer = 4u << 20;  // bytes
constexpr double kAnnouncePeriod = 1;              // s, at most; how long two that lost each other take to meet again

void set_transports(const NetworkOptions& options, fdds::DomainParticipantQos& qos) {
  using namespace eprosima::fastdds::rtps;
  qos.transport().use_builtin_transports = false;
  if (options.shared_memory) {
    auto shm = std::make_shared<SharedMemTransportDescriptor>();
    shm->segment_size(kShmSegment);
    shm->healthy_check_timeout_ms(kShmPatience);
    qos.transport().user_transports.push_back(shm);
  }
  auto udp = std::make_shared<UDPv4TransportDescriptor>();
  udp->sendBufferSize = kSocketBuffer;
  udp->receiveBufferSize = kSocketBuffer;
  if (options.interface == "local") {
    udp->interfaceWhiteList.emplace_back("127.0.0.1");  // otherwise discovery goes out on every interface
  } else if (options.interface != "all") {
    in_addr address{};
    if (inet_pton(AF_INET, options.interface.c_str(), &address) != 1)
      throw std::invalid_argument("--interface: neither 'local', 'all' nor an IPv4 address: " + options.interface);
    udp->interfaceWhiteList.push_back(options.interface);
  }
  qos.transport().user_transports.push_back(udp);
}

// Discovery by UDP alone. Everybody in the domain takes part in it, and what comes through shared memory from a
// stranger who has left before it was looked at makes the reader's thread of Fast DDS 2.9 try for ever to open that
// one's memory (mended in later versions, eProsima/Fast-DDS#3759). So only those come there who share a session.
void keep_discovery_out_of_shared_memory(fdds::DomainParticipantQos& qos) {
  auto& builtin = qos.wire_protocol().builtin;
  frtps::Locator_t any(LOCATOR_KIND_UDPv4, 0);  // of the transport's interfaces, at the default port
  builtin.metatrafficUnicastLocatorList.push_back(any);
  frtps::Locator_t multicast(LOCATOR_KIND_UDPv4, 0);
  frtps::IPLocator::setIPv4(multicast, 239, 255, 0, 1);  // DDSI-RTPS 9.6.1.4.1
  builtin.metatrafficMulticastLocatorList.push_back(multicast);
}

void set_discovery(const NetworkOptions& options, fdds::DomainParticipantQos& qos) {
  auto& config = qos.wire_protocol().builtin.discovery_config;
  config.leaseDuration = Duration_t(static_cast<long double>(options.lease));
  config.leaseDuration_announcementperiod =
      Duration_t(static_cast<long double>(std::min(kAnnouncePeriod, options.lease / 4)));
  if (options.discovery_server.empty()) return;
  const std::size_t colon = options.discovery_server.rfind(':');
  int port = 0;
  if (colon != std::string::npos) port = std::atoi(options.discovery_server.c_str() + colon + 1);
  const std::string host = options.discovery_server.substr(0, colon);
  if (port <= 0 || port > 65535)
    throw std::invalid_argument("--discovery-server: not HOST:PORT: " + options.discovery_server);
  const auto [v4, v6] = frtps::IPLocator::resolveNameDNS(host);
  in_addr literal{};
  const bool is_address = inet_pton(AF_INET, host.c_str(), &literal) == 1;
  if (!is_address && v4.empty()) throw std::invalid_argument("--discovery-server: unknown host: " + host);
  frtps::Locator_t locator(LOCATOR_KIND_UDPv4, static_cast<std::uint32_t>(port));
  frtps::IPLocator::setIPv4(locator, is_address ? host : *v4.begin());
  eprosima::fastdds::rtps::RemoteServerAttributes server;
  server.ReadguidPrefix("44.53.00.5f.45.50.52.4f.53.49.4d.41");  // of `fast-discovery-server -i 0`
  server.metatrafficUnicastLocatorList.push_back(locator);
  config.discoveryProtocol = frtps::DiscoveryProtocol_t::CLIENT;
  config.m_DiscoveryServers.push_back(server);
}

}  // namespace

fdds::DomainParticipantQos network_qos(const NetworkOptions& options) {
  fdds::DomainParticipantQos qos;
  set_transports(options, qos);
  if (options.shared_memory) keep_discovery_out_of_shared_memory(qos);
  set_discovery(options, qos);
  return qos;
}

int fresh_participant_id(std::uint32_t domain) {
  constexpr int kIds = 110;  // the next domain's ports begin at 120
  const int start = static_cast<int>(getpid() % kIds);
  const auto taken = [&](int id) {
    std::error_code error;  // where one cannot look, nothing is taken
    return std::filesystem::exists("/dev/shm/fastrtps_port" + std::to_string(7411 + 250 * domain + 2 * id), error);
  };
  for (int i = 0; i < kIds; ++i)
    if (const int id = (start + i) % kIds; !taken(id)) return id;
  return start;
}

PortsLock::PortsLock() : file_(::open("/dev/shm/soda-participants.lock", O_CREAT | O_RDONLY | O_CLOEXEC, 0666)) {
  if (file_ >= 0) (void)::flock(file_, LOCK_EX);
}

PortsLock::~PortsLock() {
  if (file_ >= 0) ::close(file_);
}

}  // namespace soda::dds
