// Sets of slots: sorted, and as marks that are all taken away at once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace soda::timeline {

inline void sort_unique(std::vector<std::uint32_t>& slots) {
  if (!std::is_sorted(slots.begin(), slots.end())) std::sort(slots.begin(), slots.end());
  slots.erase(std::unique(slots.begin(), slots.end()), slots.end());
}

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
