// Messages that came before actions which they presuppose: they may be of bodies that are not known here yet.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <vector>

#include "common/ids.h"

namespace soda::border {

class HeldBack {
 public:
  // What there is no room for is dropped: it will be asked for again.
  void keep(ActionNumber presupposed, std::span<const std::byte> bytes) {
    constexpr std::size_t kAtMost = 4096, kBytesAtMost = std::size_t{256} << 20;
    if (count_ >= kAtMost || bytes_ + bytes.size() > kBytesAtMost) return;
    messages_[presupposed].emplace_back(bytes.begin(), bytes.end());
    ++count_;
    bytes_ += bytes.size();
  }

  // Hands out those that presuppose no more than is known now.
  template <typename F>
  void release(ActionNumber known, F&& receive) {
    while (!messages_.empty() && messages_.begin()->first <= known) {
      const auto ready = messages_.extract(messages_.begin());
      for (const auto& bytes : ready.mapped()) {
        --count_;
        bytes_ -= bytes.size();
        receive(bytes);
      }
    }
  }

 private:
  std::map<ActionNumber, std::vector<std::vector<std::byte>>> messages_;  // by what they presuppose
  std::size_t count_ = 0, bytes_ = 0;
};

}  // namespace soda::border
