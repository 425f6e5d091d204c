// One world's part in balancing while a session runs: measures what its cells cost, tells its neighbours how busy it
// is, offers them cells, and answers their offers. It knows no clock: whoever drives the world says what that took.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/load.h"
#include "server/balance/policy.h"
#include "server/border/world_core.h"

namespace soda::balance {

// How fast the session is shown.
struct Pace {
  double budget = 0;   // s per step; 0: as fast as possible
  Step displayed = 0;  // newest step that is shown; without a budget it does not count
};

class Balancer {
 public:
  // `core` must outlive it. `window` is the session's K.
  Balancer(border::WorldCore& core, const Grid& grid, WorldId me, Step window, bool gives = true);

  // Work of the world, s of CPU time, since the last call.
  void worked(double seconds) { since_ += seconds; }
  // To be called after each piece of work, before what goes out is taken: answers offers at once; looks at loads every
  // kEvery steps of the clock.
  void consider(const Pace& pace);

  const Load& load() const { return load_; }

  static constexpr Step kEvery = 15;

 private:
  void measure(const Pace& pace);
  void answer_offers();
  void offer(const Pace& pace);
  double cost_of(std::span<const std::uint32_t> cells) const;

  border::WorldCore& core_;
  const Grid& grid_;
  const WorldId me_;
  const Step window_;
  const bool gives_;
  Policy policy_;
  double since_ = 0;  // s of work since the last measurement
  Step measured_at_ = 0;
  Load load_;
  std::vector<double> cost_;           // by cell: s per step of each of this world's
  std::vector<std::uint32_t> costly_;  // cells that have any
  std::vector<std::uint32_t> mine_;
  std::vector<Neighbour> neighbours_;
  std::optional<Proposal> proposed_;
  std::uint64_t declined_ = 0;  // of its offers, by the core's count
  struct Promise {
    std::vector<std::uint32_t> cells;
    double cost;  // s per step
  };
  std::vector<Promise> promises_;  // accepted cells that are not this world's yet
};

}  // namespace soda::balance
