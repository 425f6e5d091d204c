// Who must hear of which body: geometry of territories.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "common/body_state.h"
#include "server/border/territories.h"
#include "server/physics/model.h"
#include "server/timeline/record.h"

namespace soda::border {

class Neighbourhood {
 public:
  // `model` and `territories` must outlive it.
  Neighbourhood(const physics::Model& model, const Territories& territories, WorldId me);

  void territories_change(Step step);  // a transfer of that step has become known

  // H: a transfer told at a final step F is of step F + K + H + 2 at least, so that all know it in time (trade.h).
  // Found at the first call, which costs something.
  Step hops() const;

  // From which step on a world has a cell so near to one of ours that a body can matter to both: within two cells, or
  // more where the scene's largest body, or its largest speed, reaches further. kNever: at none that is known of. What
  // has begun does not end.
  static constexpr Step kNever = std::numeric_limits<Step>::max();
  Step neighbour_since(WorldId world) const { return since_[world]; }

  WorldId owner(const BodyState& body, Step step) const { return territories_.owner_of(body.x(), step); }
  std::size_t own_cells(Step step) const { return territories_.cells_of(me_, step); }
  double half_cell() const { return half_edge_; }  // m

  timeline::Place place(const BodyState& body, Step step) const;
  bool is_wide(const BodyState& body) const;
  // Whether cells change hands at a step; and then, whether that can matter to whoever hears of a body.
  bool places_change(Step step) const { return territories_.change_at(step); }
  bool place_changes(const BodyState& body, Step step) const;

  // The worlds other than the body's owner that its reach box, enlarged by half a cell, reaches. Ascending.
  void reached(const BodyState& body, Step step, std::vector<WorldId>& worlds) const;
  // The worlds that must hear of a body that this world produced: its owner, and those that it reaches; not this world.
  // For a body that is inside this world's own territory: nobody.
  void hearers(const BodyState& body, Step step, std::vector<WorldId>& worlds) const;

 private:
  std::size_t cell_of(const BodyState& body) const;
  bool reaches_me(const BodyState& body, Step step) const;
  void reached_by_box(const BodyState& body, Step step, std::vector<WorldId>& worlds) const;
  const physics::Model& model_;
  const Territories& territories_;
  const int range_;  // cells
  WorldId me_;
  std::vector<Step> since_;  // by world
  bool alone_ = true;        // no world is a neighbour, ever
  mutable Step hops_ = -1;   // -1: not known yet
  double half_edge_ = 0;
};

}  // namespace soda::border
