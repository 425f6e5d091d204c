// How a participant uses the network: its transports, ports and discovery.
#pragma once

#include <cstdint>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

#include "common/dds/network_options.h"

namespace soda::dds {

// Throws std::invalid_argument, naming the option, where one of `options` means nothing.
eprosima::fastdds::dds::DomainParticipantQos network_qos(const NetworkOptions& options);

// Where Fast DDS should start to look for free ports. By default every process starts at 0 and so takes over, in shared
// memory, the port of one that was just killed; those that knew the dead one keep writing to its memory, which nobody
// reads. So: an id whose port has left no trace there, if there is one. To be asked with PortsLock held.
int fresh_participant_id(std::uint32_t domain);

// Held while a process chooses its id and takes the ports that go with it: of several that start at once, two would
// choose the same.
class PortsLock {
 public:
  PortsLock();
  ~PortsLock();
  PortsLock(const PortsLock&) = delete;
  PortsLock& operator=(const PortsLock&) = delete;

 private:
  int file_;  // -1 where there is none to be had: then it is as without
};

}  // namespace soda::dds
