// What one neighbour holds of this world's bodies, step by step, and what it should hold: finds what must be told.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "server/border/message.h"
#include "server/timeline/timeline.h"

namespace soda::border {

// A body that a neighbour owns or has near, with those of its contact records that can matter to it.
struct NearBody {
  timeline::Slot slot = 0;
  Ref<timeline::Record> record;
  std::uint64_t wanted = kAll;  // contact records, by position; those that have no bit are wanted, too
  static constexpr std::uint64_t kAll = ~std::uint64_t{0};
  bool wants(std::size_t contact) const { return contact >= 64 || (wanted >> contact & 1) != 0; }
};
using NearBodies = std::vector<NearBody>;  // ascending by slot

class FrameBook {
 public:
  explicit FrameBook(Step first) : base_(first), checked_(first - 1) {}  // without entries

  // The list at step `newest` + 1 is that of the step before, until set() says otherwise.
  void extend();
  const NearBodies& truth(Step step) const { return *at(step).truth; }
  void set(Step step, NearBodies truth);

  // Everything up to `upto` that the neighbour does not hold, by what it was told and by the rule for what it was not:
  // sleeping bodies stay, awake ones are gone.
  std::vector<Frame> tell(Step upto, std::uint32_t epoch);

  void release_before(Step step);

 private:
  using List = std::shared_ptr<const NearBodies>;
  struct Entry {
    List truth;
    List told;   // by a frame of this step; null: none
    List holds;  // with what follows from the step before; valid up to checked_
    std::uint32_t revisions = 0;
  };
  Entry& at(Step step) { return entries_.at(static_cast<std::size_t>(step - base_)); }
  const Entry& at(Step step) const { return entries_.at(static_cast<std::size_t>(step - base_)); }
  std::deque<Entry> entries_;
  Step base_;
  Step checked_;  // up to this step the neighbour holds the truth
};

}  // namespace soda::border
