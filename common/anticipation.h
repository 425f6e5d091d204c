// What computing ahead is worth when the load grows ("anticipation benefits function" of the paper that SODA comes
// from, section 4.2): for how many steps a world stays on time.
#pragma once

#include <limits>

namespace soda {

// Steps that can be shown on time, from now on, by a world that has `entries` computed beyond the shown step and takes
// `cost` seconds to compute one, where one is shown every `budget` seconds. While n are shown, n budget / cost more are
// computed: it lasts until n = entries + n budget / cost. Infinite where the world keeps up.
inline double steps_on_time(double entries, double budget, double cost) {
  return cost <= budget ? std::numeric_limits<double>::infinity() : entries / (1 - budget / cost);
}

}  // namespace soda
