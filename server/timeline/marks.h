// Sets: of slots or ids, sorted, and of slots as marks that are all taken away at once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace soda::timeline {

template <typename T>
void sort_unique(std::vector<T>& items) {
  if (!std::is_sorted(items.begin(), items.end())) std::sort(items.begin(), items.end());
  items.erase(std::unique(items.begin(), items.end()), items.end());
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
