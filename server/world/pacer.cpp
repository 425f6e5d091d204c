#include "server/world/pacer.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace soda::world {

Pacer::Order Pacer::at(double now, Step slowest_final) {
  const double passed = std::exchange(started_, true) ? now - then_ : 0;
  then_ = now;
  const auto slowest = static_cast<double>(std::min(slowest_final, last_));
  const bool max = rate_ == 0 && !paused_;
  if (paused_)
    displayed_ = std::max(displayed_, std::min(static_cast<double>(goal_), slowest));
  else if (max)
    displayed_ = std::max(displayed_, slowest);
  else  // time that the worlds could not keep up with is lost, not caught up later
    displayed_ = std::min(displayed_ + passed * rate_, std::max(slowest, std::floor(displayed_)));
  const Step displayed = static_cast<Step>(std::floor(displayed_));
  // As fast as possible, nobody is to wait for this.
  closed_ = std::max(closed_, displayed + (max ? 4 * window_ : lead_));
  return {displayed, max ? kNoLimit : displayed + window_, closed_};
}

void Pacer::pause() {
  if (paused_) return;
  paused_ = true;
  displayed_ = std::floor(displayed_);
  goal_ = static_cast<Step>(displayed_);
}

void Pacer::step(Step steps) { goal_ = std::min(goal_ + steps, last_); }

}  // namespace soda::world
