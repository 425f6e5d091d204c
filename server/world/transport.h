// How a daemon's messages reach the other worlds of its session. Two homes: DDS (dds_transport.h) and, for tests of the
// daemon's own threads, queues inside one process (tests/support). Except for wake() all calls come from the daemon's
// thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "common/ids.h"

namespace soda::world {

struct Incoming {
  enum class Kind {
    kMessage,      // `bytes` is a border message
    kInterrupted,  // many messages to or from `from` may have been lost (unmatched, matched again, write failed)
  };
  Kind kind = Kind::kMessage;
  WorldId from = 0;
  std::vector<std::byte> bytes;
};

class Transport {
 public:
  virtual ~Transport() = default;
  // Sets up the connections with these worlds: once before anything else, and later with those that become neighbours.
  virtual void open(std::span<const WorldId> neighbours) = 0;
  // Whether every neighbour has been met that there is so far.
  virtual bool connected() const = 0;
  // Hands a message over for sending; never blocks for long for the receiver's sake. What cannot be sent is dropped,
  // and kInterrupted comes for that world once it is worth trying again. What is sent mostly arrives, and in order;
  // that it did not is noticed by nobody but the receiver.
  virtual void send(WorldId to, std::vector<std::byte> bytes) = 0;
  // The next thing that came, if any.
  virtual std::optional<Incoming> receive() = 0;
  // Blocks until something has come, wake() was called, or the time is up.
  virtual void wait(std::chrono::steady_clock::duration at_most) = 0;
  virtual void wake() = 0;  // from any thread
  // Blocks until what can be acknowledged has been by its receivers, or the time is up. For the end of a run.
  virtual void flush(std::chrono::steady_clock::duration at_most) = 0;
};

}  // namespace soda::world
