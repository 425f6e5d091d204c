// How busy a world is, as it tells its neighbours. Decides about no bit of any result.
#pragma once

#include <limits>

namespace soda {

struct Load {
  double work = 0;  // s of CPU time per step, recent mean
  // The same about a second from now, when a transfer agreed on now will have taken effect: with all known transfers
  // and accepted ones done. Decisions are made on this; `work` where nothing better is known.
  double expected = 0;
  // s per step, of those bodies that are heading into the territory of the world which is told.
  double coming = 0;
  // Steps that it can still serve in time at the displayed rate under its present load (anticipation.h).
  double on_time = std::numeric_limits<double>::infinity();
};

}  // namespace soda
