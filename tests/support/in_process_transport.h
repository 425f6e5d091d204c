// Daemons of one process joined by queues, so that ThreadSanitizer sees the daemon's own threads and nothing else.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "server/world/inbox.h"
#include "server/world/transport.h"

namespace soda::test {

// One session's queues. Made first, destroyed last.
class InProcessNetwork {
 public:
  // `loss`: the share of messages that get lost; both ends then report an interruption, as where DDS knows of it, or
  // nobody does, as with a datagram.
  explicit InProcessNetwork(WorldId worlds, double loss = 0, bool silent = false, std::uint64_t seed = 1)
      : loss_(loss), silent_(silent), random_(seed) {
    for (WorldId i = 0; i < worlds; ++i) inboxes_.push_back(std::make_unique<world::Inbox>());
  }

  world::Inbox& inbox(WorldId world) { return *inboxes_.at(world); }

  void deliver(WorldId from, WorldId to, std::vector<std::byte> bytes) {
    if (lost()) {
      if (silent_) return;
      inbox(to).push({world::Incoming::Kind::kInterrupted, from, {}});
      inbox(from).push({world::Incoming::Kind::kInterrupted, to, {}});
      return;
    }
    inbox(to).push({world::Incoming::Kind::kMessage, from, std::move(bytes)});
  }

 private:
  bool lost() {
    if (loss_ == 0) return false;
    const std::lock_guard lock(mutex_);
    return std::uniform_real_distribution<double>(0, 1)(random_) < loss_;
  }

  std::vector<std::unique_ptr<world::Inbox>> inboxes_;
  const double loss_;
  const bool silent_;
  std::mutex mutex_;  // guards random_
  std::mt19937_64 random_;
};

class InProcessTransport final : public world::Transport {
 public:
  InProcessTransport(InProcessNetwork& network, WorldId me) : network_(network), me_(me) {}

  void open(std::span<const WorldId>) override {}
  bool connected() const override { return true; }
  void send(WorldId to, std::vector<std::byte> bytes) override { network_.deliver(me_, to, std::move(bytes)); }
  std::optional<world::Incoming> receive() override { return network_.inbox(me_).pop(); }
  void wait(std::chrono::steady_clock::duration at_most) override { network_.inbox(me_).wait(at_most); }
  void wake() override { network_.inbox(me_).wake(); }
  void flush(std::chrono::steady_clock::duration) override {}

 private:
  InProcessNetwork& network_;
  const WorldId me_;
};

}  // namespace soda::test
