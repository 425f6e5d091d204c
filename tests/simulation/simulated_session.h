// Several worlds in one process under a simulated network: a seeded scheduler delays, reorders, doubles and loses
// messages and stalls worlds. One seed is one run, exactly. Every final step is compared with the single world's.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/actions/action.h"
#include "common/scene/scene.h"
#include "server/border/world_core.h"

namespace soda::test {

struct StepDigest {
  std::size_t bodies = 0;
  std::uint64_t hash = 0;
  bool operator==(const StepDigest&) const = default;
};

struct NetworkSettings {
  border::Sync sync = border::Sync::kAnticipative;
  Step window = 48;
  std::size_t piece_bodies = border::CoreSettings{}.piece_bodies;
  std::uint64_t seed = 1;
  int delay = 5;               // ticks, at most, for an ordinary message
  double slow_share = 0.05;    // of messages that take up to ten times as long: reordering
  double double_share = 0.05;  // of messages that arrive twice
  double loss_share = 0;       // of messages that never arrive; the sender is told nothing
  double stall_share = 0.5;    // of ticks in which a world does nothing
  Step lead = 4;               // steps beyond the slowest final one up to which the session closes actions
  double touch_share = 0;      // of ticks in which a world at rest repairs a random step where nothing has changed
  double give_share = 0;       // of ticks in which a world offers some of its cells to a neighbour
  // Worlds balance their loads, as daemons do, with made-up costs; 0: they do not. Otherwise s that a step may take, or
  // less than 0: as fast as possible. A body takes 1 us at first.
  double budget = 0;
};

struct SessionResult {
  std::vector<StepDigest> steps;  // summed over the worlds, by step
  border::CoreStats total;        // likewise
  std::uint64_t lost = 0, doubled = 0, delivered = 0, touched = 0, held = 0;
  std::size_t least_neighbours = 0;
  Step kept = 0;        // final steps before the newest one that a world still kept at the end, at most
  std::string failure;  // empty: all worlds made the last step final
};

// Adds what may be added up; of the longest, the longer.
void add(border::CoreStats& sum, const border::CoreStats& s);

using Actions = std::vector<LoggedAction>;

// The reference: the step alone, again and again, and what is done to bodies in between.
std::vector<StepDigest> run_single(const Scene& scene, Step steps, const Actions& log = {});

// The session on `worlds` worlds. `owner` overrides the territories (by Grid::index) where not empty. Actions come
// while it runs where their log is in the order of their steps, else all at the start. All worlds know of `transfers`
// of cells from the start.
SessionResult run_session(const Scene& scene, WorldId worlds, Step steps, const NetworkSettings& network,
                          const std::vector<WorldId>& owner = {}, const Actions& log = {},
                          const std::vector<border::Transfer>& transfers = {});

// "step 17: ..." for the first step that differs, empty where none does.
std::string first_difference(const std::vector<StepDigest>& expected, const std::vector<StepDigest>& got);

}  // namespace soda::test
