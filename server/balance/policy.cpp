#include "server/balance/policy.h"

#include <algorithm>
#include <cmath>

#include "common/anticipation.h"

namespace soda::balance {
namespace {

// Of the giver's load: what may have changed since it proposed, and is no reason to refuse.
constexpr double kTolerance = 0.05;

bool sensible(double load) { return std::isfinite(load) && load >= 0; }

}  // namespace

// Lazy: as long as what has been computed ahead lasts well beyond the time that a transfer takes, nothing is done.
bool Policy::must_give(const Situation& s) const {
  if (s.budget <= 0) return true;
  const double soon = steps_on_time(s.ahead, s.budget, s.load.expected);
  return std::min(s.load.on_time, soon) < settings_.patience * settings_.transfer_steps;
}

void Policy::forget(Step now) {
  std::erase_if(kept_, [&](const Kept& k) { return k.until <= now; });
  std::erase_if(answers_, [&](const Answer& a) { return a.until <= now; });
}

std::optional<Proposal> Policy::propose(const Situation& s) {
  forget(s.now);
  const double load = s.load.expected;
  if (!sensible(load) || load <= settings_.least_cost || s.mine.size() < 2 || !must_give(s)) return std::nullopt;
  ranked_.clear();
  for (Neighbour n : s.neighbours) {
    bool refused = false;
    for (const Answer& a : answers_)
      if (a.world == n.world) n.load.expected += a.cost, refused |= !a.accepted;
    if (n.world != s.me && sensible(n.load.expected) && n.load.expected < settings_.dead_band * load && !refused)
      ranked_.push_back(n);
  }
  std::sort(ranked_.begin(), ranked_.end(), [](const Neighbour& a, const Neighbour& b) {
    return a.load.expected != b.load.expected ? a.load.expected < b.load.expected : a.world < b.world;
  });
  for (const Neighbour& n : ranked_) {
    const double difference = load - n.load.expected;
    GrowthRequest request{s.grid, s.me, n.world, s.owner, s.mine, s.cost, {}};
    request.barred = [&](std::uint32_t cell) {
      const auto k = std::lower_bound(kept_.begin(), kept_.end(), cell,
                                      [](const Kept& kept, std::uint32_t c) { return kept.cell < c; });
      return k != kept_.end() && k->cell == cell && k->from == n.world;
    };
    request.wanted = settings_.share * difference;
    // Who still has time is given no more than it has time for: another neighbour may have some, too.
    const double room = settings_.budget_part * s.budget - n.load.expected;
    if (room > 0) request.wanted = std::min(request.wanted, room);
    request.limit = 0.5 * difference;
    request.max_cells = settings_.max_cells;
    // Cells that cost more cannot go; if little is left without them, there is no sense in giving what costs nothing.
    double movable = 0;
    for (const std::uint32_t cell : s.mine)
      if (s.cost[cell] <= request.limit) movable += s.cost[cell];
    const double least = std::max(settings_.least_cost, settings_.least_part * load);
    if (movable < least) continue;
    Growth::Grown grown = growth_.grow(request);
    // As many cells as there may be are a step towards those that cost something.
    if (grown.cells.empty() || (grown.cost < least && !grown.full)) continue;
    return Proposal{n.world, std::move(grown.cells), grown.cost};
  }
  return std::nullopt;
}

void Policy::answered(Step now, const Proposal& proposal, bool accepted) {
  answers_.push_back({proposal.taker, accepted, accepted ? proposal.cost : 0,
                      now + (accepted ? settings_.unreported : settings_.refused)});
}

void Policy::took(Step now, WorldId giver, std::span<const std::uint32_t> cells) {
  std::erase_if(kept_, [&](const Kept& k) { return std::binary_search(cells.begin(), cells.end(), k.cell); });
  for (const std::uint32_t cell : cells) kept_.push_back({cell, giver, now + settings_.keep});
  std::sort(kept_.begin(), kept_.end(), [](const Kept& a, const Kept& b) { return a.cell < b.cell; });
}

bool may_take(const Grid& grid, std::span<const WorldId> owner, WorldId me, std::span<const std::uint32_t> cells,
              double cost, const Load& mine, const Load& giver) {
  const bool has_room = mine.expected + cost <= giver.expected - cost + kTolerance * giver.expected;
  return !cells.empty() && has_room && attached(grid, owner, me, cells);
}

}  // namespace soda::balance
