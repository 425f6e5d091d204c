#include "server/world/inbox.h"

#include <utility>

namespace soda::world {

void Inbox::push(Incoming incoming) {
  {
    const std::lock_guard lock(mutex_);
    queue_.push_back(std::move(incoming));
    hint_.store(true, std::memory_order_release);
  }
  condition_.notify_one();
}

void Inbox::wake() {
  {
    const std::lock_guard lock(mutex_);
    woken_ = true;
    hint_.store(true, std::memory_order_release);
  }
  condition_.notify_one();
}

std::optional<Incoming> Inbox::pop() {
  if (!hint_.load(std::memory_order_acquire)) return std::nullopt;
  const std::lock_guard lock(mutex_);
  if (queue_.empty()) {
    hint_.store(woken_, std::memory_order_release);
    return std::nullopt;
  }
  Incoming first = std::move(queue_.front());
  queue_.pop_front();
  hint_.store(ready(), std::memory_order_release);
  return first;
}

void Inbox::wait(Duration at_most) {
  std::unique_lock lock(mutex_);
  condition_.wait_for(lock, at_most, [this] { return ready(); });
  woken_ = false;
  hint_.store(!queue_.empty(), std::memory_order_release);
}

}  // namespace soda::world
