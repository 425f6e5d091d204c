// How far a session may have got: the displayed step follows the clock on the wall, but never beyond the slowest
// world's final step (slow motion), and no world's clock passes the displayed step by more than the window. A pure
// function of what it is told, so that tests choose the time.
#pragma once

#include "common/ids.h"

namespace soda::world {

constexpr Step kNoLimit = Step{1} << 62;

class Pacer {
 public:
  // `steps_per_second` of wall time; 0: as fast as possible, and then nobody waits for anybody.
  Pacer(double steps_per_second, Step window, Step last_step)
      : rate_(steps_per_second), window_(window), last_(last_step) {}

  struct Order {
    Step displayed = 0;
    Step limit = 0;  // no clock passes it
    bool operator==(const Order&) const = default;
  };

  // `now` in s, from any origin, never falling; `slowest_final` of all worlds. The first call starts the run.
  Order at(double now, Step slowest_final);

 private:
  double rate_;
  Step window_;
  Step last_;
  bool started_ = false;
  double then_ = 0;       // s, of the last call
  double displayed_ = 0;  // steps, with fraction
};

}  // namespace soda::world
