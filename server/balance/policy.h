// Load balancing without a centre: which cells a world gives to which neighbour, decided by the world alone from what
// it knows of itself and what its neighbours said of themselves. Paper, section 3.4.2; docs/balancing.md says how and
// why. Pure: knows no clock, network or bodies. What it decides can change no bit of the simulation, only its speed.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/grid.h"
#include "common/ids.h"
#include "common/load.h"
#include "server/balance/growth.h"
#include "server/balance/shape.h"

namespace soda::balance {

struct Neighbour {
  WorldId world = 0;
  Load load;  // its newest report
};

// What one world knows when it asks itself whether to give. Spans by cell are by Grid::index.
struct Situation {
  const Grid& grid;
  WorldId me = 0;
  Step now = 0;                           // the world's clock; never falls by more than a window
  std::span<const WorldId> owner;         // by cell, after all transfers that are known
  std::span<const std::uint32_t> mine;    // cells, ascending, that are mine now and after all known transfers
  std::span<const double> cost;           // by cell: s per step that each of mine will cost (as Load::expected)
  Load load;                              // mine
  double ahead = 0;                       // steps computed beyond the displayed one
  double budget = 0;                      // s per step at the displayed rate; 0: as fast as possible
  std::span<const Neighbour> neighbours;  // those who have reported, in any order
};

struct Proposal {
  WorldId taker = 0;
  std::vector<std::uint32_t> cells;  // ascending; never all of mine
  double cost = 0;                   // s per step, of the cells
};

struct Settings {
  // A taker has at most this part of the giver's load: what differs less is noise, and moving it is not worth the work.
  double dead_band = 1 / 1.1;
  // Of the difference of two loads, what is given: half of it would make them equal, were they known exactly.
  double share = 0.45;
  double budget_part = 0.9;   // of the budget, to which a taker that is below it is filled at most
  double least_part = 0.02;   // of the giver's load: a transfer that carries less is not worth its messages
  double least_cost = 10e-6;  // s per step, likewise
  // Steps until a transfer has taken effect: the window, and what agreeing on it takes. A world that will be on time
  // for `patience` times as long gives nothing.
  double transfer_steps = 48 + 8;
  double patience = 2;
  Step keep = 120;               // steps for which a cell is not given back to whom it came from
  Step refused = 15;             // steps for which a world that refused is not asked again
  Step unreported = 30;          // steps for which a world's reports may be older than what it has accepted
  std::size_t max_cells = 4096;  // of one transfer
  GrowthSettings growth;
};

// A world's decisions; keeps what it needs against going back and forth. Memory: 1 byte for each cell of the grid, and
// what is proportional to the world's own cells.
class Policy {
 public:
  explicit Policy(const Settings& settings = {}) : settings_(settings), growth_(settings.growth) {}

  // What to give, if anything. Called some times per second while no transfer of this world is in flight. O(own cells),
  // and O(cells given x log) for what is proposed. The same calls give the same answers: ties go to the lower id, and
  // the lower cell.
  std::optional<Proposal> propose(const Situation& situation);

  // The asked world's answer. One that refused is left alone for a while; one that accepted may not have said so in its
  // reports yet.
  void answered(Step now, const Proposal& proposal, bool accepted);
  // This world has accepted cells of another one: it does not give them back for a while.
  void took(Step now, WorldId giver, std::span<const std::uint32_t> cells);

 private:
  struct Kept {
    std::uint32_t cell;
    WorldId from;
    Step until;
  };
  struct Answer {
    WorldId world;
    bool accepted;
    double cost;  // s per step, of what was accepted
    Step until;
  };
  bool must_give(const Situation& s) const;
  void forget(Step now);

  Settings settings_;
  std::vector<Kept> kept_;  // by cell
  std::vector<Answer> answers_;
  std::vector<Neighbour> ranked_;
  Growth growth_;
};

// What an asked world checks before it accepts: that the cells (ascending, of `cost` s per step together) leave it with
// no more pieces than it has, and that it then has no more to do than the giver has left, to a tolerance for what has
// changed since the giver's proposal. `owner`: after all transfers that it knows, without this one. `mine.expected`
// counts what it has accepted already.
bool may_take(const Grid& grid, std::span<const WorldId> owner, WorldId me, std::span<const std::uint32_t> cells,
              double cost, const Load& mine, const Load& giver);

}  // namespace soda::balance
