// Marks by slot that are all taken away at once.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace soda::timeline {

class Marks {
 public:
  void clear() { ++stamp_; }
  // False: it was marked already.
  bool add(std::uint32_t slot) {
    if (slot >= stamps_.size()) stamps_.resize(slot + slot / 2 + 64, 0);
    return std::exchange(stamps_[slot], stamp_) != stamp_;
  }
  bool has(std::uint32_t slot) const { return slot < stamps_.size() && stamps_[slot] == stamp_; }

 private:
  std::vector<std::uint64_t> stamps_;
  std::uint64_t stamp_ = 1;
};

}  // namespace soda::timeline
