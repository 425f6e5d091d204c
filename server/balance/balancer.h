// One world's part in balancing while a session runs: measures what its cells cost, tells its neighbours how busy it
// is, offers them cells, and answers their offers. It knows no clock: whoever drives the world says what that took.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
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
  // `core` and `grid` must outlive it. `dt`: of the scene, s.
  Balancer(border::WorldCore& core, const Grid& grid, WorldId me, double dt);

  // Work of the world, s of CPU time, since the last call.
  void worked(double seconds) { since_ += seconds; }
  // To be called after each piece of work, before what goes out is taken: answers offers at once; looks at loads every
  // kEvery steps of the clock, and sooner while it falls behind the display.
  void consider(const Pace& pace);

  const Load& load() const { return load_; }

  static constexpr Step kEvery = 10;

 private:
  void measure(const Pace& pace);
  void spread_cost(const std::vector<WorldId>& owners);
  void answer_offers();
  bool hear_answer(const Pace& pace);
  void offer(const Pace& pace);

  border::WorldCore& core_;
  const Grid& grid_;
  const WorldId me_;
  const double foresight_;  // s, until a transfer agreed on now has been in effect for half as long as until the next
  Policy policy_;
  double since_ = 0;  // s of work since the last measurement
  Step measured_at_ = 0, seen_ = 0;
  double seen_since_ = 0;       // of since_, up to the step seen_
  double late_ = 0;             // s by which steps have lately taken longer than they may
  std::uint64_t computed_ = 0;  // bodies, at the last measurement
  double per_body_ = 0;         // s of work for each body computed, a recent mean
  Load load_;
  std::vector<double> cost_;           // by cell: s per step that each of this world's will cost
  std::vector<std::uint32_t> costly_;  // cells that have any
  std::map<WorldId, double> leaving_;  // s per step, of bodies that head into others' territories
  std::vector<std::uint32_t> mine_;
  std::vector<Neighbour> neighbours_;
  std::optional<Proposal> proposed_;
  int offers_ = 0;                       // since the last measurement
  std::uint64_t declined_ = 0;           // of its offers, by the core's count
  std::vector<border::Offer> promises_;  // accepted cells that are not this world's yet
};

}  // namespace soda::balance
