// Notices repairs: what did they cost?
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "server/border/world_core.h"

namespace soda::world {

class RepairMeter {
 public:
  using Clock = std::chrono::steady_clock;
  struct Repair {
    Step step = 0;             // the first that was done again
    Step steps = 0;            // from there to the clock
    std::uint64_t bodies = 0;  // results that were replaced
    Clock::duration work{};    // until nothing was left to be done again
  };

  // After each piece of work; `front` is the core's before it.
  void worked(Step front, const border::WorldCore& core, Clock::duration passed) {
    const std::uint64_t redone = core.stats().timeline.bodies_redone;
    if (redone != redone_) {
      if (!under_way_) now_ = {front, 0, 0, {}};
      under_way_ = true;
      now_.step = std::min(now_.step, front);
      now_.bodies += redone - redone_;
      until_ = core.clock();
      redone_ = redone;
    }
    if (!under_way_) return;
    now_.work += passed;
    if (core.front() < until_) return;
    under_way_ = false;
    now_.steps = until_ - now_.step;
    newest_ = now_;
    ++count_;
  }

  const Repair& newest() const { return newest_; }  // that has come to its end
  std::uint64_t count() const { return count_; }

 private:
  Repair newest_, now_;
  std::uint64_t count_ = 0, redone_ = 0;
  bool under_way_ = false;
  Step until_ = 0;
};

}  // namespace soda::world
