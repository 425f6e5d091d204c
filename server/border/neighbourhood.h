// Who must hear of which body: geometry of territories, fixed for a session.
#pragma once

#include <cstdint>
#include <vector>

#include "common/body_state.h"
#include "common/territory.h"
#include "server/physics/model.h"
#include "server/timeline/record.h"

namespace soda::border {

class Neighbourhood {
 public:
  // `model` and `map` must outlive it.
  Neighbourhood(const physics::Model& model, const TerritoryMap& map, WorldId me);

  // A body has been added to the model.
  void model_grew();

  // Worlds with a cell so near to one of ours that a body can matter to both: within two cells, or more where the
  // scene's largest body, or its largest speed, reaches further. Ascending.
  const std::vector<WorldId>& neighbours() const { return neighbours_; }

  WorldId owner(const BodyState& body) const { return map_.owner_of(body.x()); }
  std::size_t own_cells() const { return own_cells_; }
  double half_cell() const { return half_edge_; }  // m

  timeline::Place place(const BodyState& body) const;
  bool is_wide(const BodyState& body) const { return place(body).wide; }

  // The worlds other than the body's owner that its reach box, enlarged by half a cell, reaches. Ascending.
  void reached(const BodyState& body, std::vector<WorldId>& worlds) const;
  // The worlds that must hear of a body that this world produced: its owner, and those that it reaches; not this world.
  // For a body that is inside this world's own territory: nobody.
  void hearers(const BodyState& body, std::vector<WorldId>& worlds) const;

 private:
  void reached_by_box(const BodyState& body, std::vector<WorldId>& worlds) const;
  const physics::Model& model_;
  const TerritoryMap& map_;
  WorldId me_;
  std::vector<WorldId> neighbours_;
  std::size_t own_cells_ = 0;
  double half_edge_ = 0;
  // By body: below this square of its speed, (m/s)^2, its reach box cannot leave half a cell, however it turns.
  std::vector<double> ordinary_below_;
  // By cell: the one world that owns every cell within one cell, or kNoWorld.
  std::vector<WorldId> sole_;
};

}  // namespace soda::border
