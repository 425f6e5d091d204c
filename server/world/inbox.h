// The queue between the threads on which messages come and the daemon's own. Not bounded by itself: the protocol core
// of a sender keeps at most a few steps of messages in flight.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>

#include "server/world/transport.h"

namespace soda::world {

class Inbox {
 public:
  using Duration = std::chrono::steady_clock::duration;

  void push(Incoming incoming);  // from any thread
  void wake();                   // from any thread: ends the present or the next wait
  std::optional<Incoming> pop();
  // Blocks until there is something, wake() was called, or the time is up.
  void wait(Duration at_most);

 private:
  bool ready() const { return !queue_.empty() || woken_; }

  std::mutex mutex_;
  std::condition_variable condition_;
  std::deque<Incoming> queue_;
  bool woken_ = false;
  std::atomic<bool> hint_{false};  // ready(), for looking without the lock
};

}  // namespace soda::world
