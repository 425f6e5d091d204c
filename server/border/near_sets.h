// What two neighbours know of each other's bodies near their border, told by frames; and what is assumed without one.
#pragma once

#include <map>

#include "common/body_set.h"
#include "common/ids.h"

namespace soda::border {

// Turns a set at t - 1 into what is assumed of it at t if nothing is told: its sleeping bodies stay as they are,
// everything awake is gone.
void keep_sleepers(BodySet& set);

// Bit for bit.
bool same(const BodySet& l, const BodySet& r);

// The neighbour's bodies that we own or have near, step by step.
class HeardBodies {
 public:
  void hear(Step step, BodySet set) { frames_[step] = std::move(set); }
  // The set at `step`; called for each step in order. `told` says whether a frame told it.
  const BodySet& at(Step step, bool& told);

 private:
  std::map<Step, BodySet> frames_;  // told, not yet used
  BodySet set_;
};

// Our bodies that the neighbour owns or has near, as it knows them.
class ToldBodies {
 public:
  // Whether `now`, the set at the next step, differs from what the neighbour will assume, so that it must be told.
  bool must_tell(const BodySet& now);

 private:
  BodySet told_;
};

}  // namespace soda::border
