// Border messages over DDS: for each neighbour one writer and one reader, on topics of their own, so that nobody
// receives what was meant for others. Order and numbering are the core's business; this only has to say honestly when a
// message may have been lost.
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
  void came(const Link& link, wire::Border&& sample);

  dds::Participant& participant_;
  const WorldId me_;
  Inbox inbox_;
  bool any_missed_ = false;  // some link has missed a message
  std::vector<std::unique_ptr<Link>> links_;
};

}  // namespace soda::world
