// Border messages over DDS: short ones as datagrams that may get lost, to a topic of each receiver; long ones, of which
// DDS would seldom bring all fragments at the first go, and all while it has not brought these yet, reliably on a topic
// of each ordered pair. So nobody receives what was meant for others, and order is mostly kept. Numbering, and asking
// for what is missing, are the core's and the daemon's business; this says honestly when it knows that a message may
// have been lost.
#pragma once

#include <atomic>
#include <memory>
#include <span>
#include <vector>

#include "common/dds/participant.h"
#include "server/world/inbox.h"
#include "server/world/transport.h"

namespace soda::world {

class DdsTransport final : public Transport {
 public:
  DdsTransport(dds::Participant& participant, WorldId me);
  ~DdsTransport() override;

  void open(std::span<const WorldId> neighbours) override;
  bool connected() const override;
  void send(WorldId to, std::vector<std::byte> bytes) override;
  std::optional<Incoming> receive() override;
  void wait(std::chrono::steady_clock::duration at_most) override;
  void wake() override { inbox_.wake(); }
  void flush(std::chrono::steady_clock::duration at_most) override;

 private:
  using Clock = std::chrono::steady_clock;
  struct Link;

  Link* find(WorldId neighbour);
  void readers_changed(Link& link, int change);  // of what we write
  void writers_changed(Link& link, int change);  // of what we read
  void came(WorldId from, wire::Border&& sample);

  dds::Participant& participant_;
  const WorldId me_;
  Inbox inbox_;
  std::vector<std::atomic<bool>> opened_ = std::vector<std::atomic<bool>>(kMaxWorlds);  // by world
  std::atomic<int> datagram_writers_{0};  // that have been met; also such as are no neighbours
  bool any_missed_ = false;               // some link has missed a message
  std::vector<std::unique_ptr<Link>> links_;
  // Last, so that no handler finds the rest gone.
  std::unique_ptr<dds::Reader<wire::Border>> datagrams_;
};

}  // namespace soda::world
