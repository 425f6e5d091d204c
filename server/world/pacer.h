// How far a session may have got: the displayed step follows the clock on the wall, but never beyond the slowest
// world's final step (slow motion); no world's clock passes the displayed step by more than the window; and up to the
// input lead beyond it steps are closed for actions. A pure function of what it is told, so that tests choose the time.
#pragma once

#include "common/ids.h"

namespace soda::world {

constexpr Step kNoLimit = Step{1} << 62;

class Pacer {
 public:
  // `steps_per_second` of wall time; 0: as fast as possible, and then nobody waits for anybody.
  Pacer(double steps_per_second, Step window, Step lead, Step last_step)
      : rate_(steps_per_second), window_(window), lead_(lead), last_(last_step) {}

  struct Order {
    Step displayed = 0;
    Step limit = 0;   // no clock passes it
    Step closed = 0;  // nothing will be done to bodies at steps up to this one but what is known; never falls
    bool operator==(const Order&) const = default;
  };

  // `now` in s, from any origin, never falling; `slowest_final` of all worlds. The first call starts the run.
  Order at(double now, Step slowest_final);

  void set_rate(double steps_per_second) { rate_ = steps_per_second; }
  double rate() const { return rate_; }
  // The displayed step stays; what is beyond it is still computed, as far as the window goes.
  void pause();
  void resume() { paused_ = false; }
  void step(Step steps);  // while paused: that many more
  bool paused() const { return paused_; }

 private:
  double rate_;
  Step window_, lead_, last_;
  bool started_ = false, paused_ = false;
  double then_ = 0;       // s, of the last call
  double displayed_ = 0;  // steps, with fraction
  Step goal_ = 0;         // of the displayed step, while paused
  Step closed_ = 0;
};

}  // namespace soda::world
