#include "server/world/pacer.h"

#include <algorithm>
#include <cmath>

namespace soda::world {

Pacer::Order Pacer::at(double now, Step slowest_final) {
  if (rate_ == 0) return {slowest_final, kNoLimit};
  if (started_) displayed_ += (now - then_) * rate_;
  started_ = true;
  then_ = now;
  // Time that the worlds could not keep up with is lost, not caught up later.
  displayed_ = std::min(displayed_, static_cast<double>(std::min(slowest_final, last_)));
  const Step displayed = static_cast<Step>(std::floor(displayed_));
  return {displayed, displayed + window_};
}

}  // namespace soda::world
