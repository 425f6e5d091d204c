// The transport of a world that is alone.
#pragma once

#include <stdexcept>

#include "server/world/inbox.h"
#include "server/world/transport.h"

namespace soda::world {

class NoTransport final : public Transport {
 public:
  void open(std::span<const WorldId> neighbours) override {
    if (!neighbours.empty()) throw std::logic_error("a world without network has neighbours");
  }
  bool connected() const override { return true; }
  void send(WorldId, std::vector<std::byte>) override {}
  std::optional<Incoming> receive() override { return std::nullopt; }
  void wait(std::chrono::steady_clock::duration at_most) override { inbox_.wait(at_most); }
  void wake() override { inbox_.wake(); }
  void flush(std::chrono::steady_clock::duration) override {}

 private:
  Inbox inbox_;
};

}  // namespace soda::world
