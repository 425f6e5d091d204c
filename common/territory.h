// Who owns which cell.
#pragma once

#include <vector>

#include "common/grid.h"
#include "common/ids.h"

namespace soda {

struct TerritoryMap {
  Grid grid;
  WorldId worlds = 1;
  std::vector<WorldId> owner;  // by Grid::index

  WorldId owner_of(const Vec3& position) const { return owner[grid.index(grid.cell_of(position))]; }
};

// Recursive bisection of the grid, weighted by what its cells will cost: boxes of cells with about the same work each,
// cut where few bodies are, and upright. Dynamic bodies count, static things a little, for what comes there touches
// them; large ones (grounds, walls across many cells) do not. Every world gets at least one cell. A pure function of
// its arguments. Throws std::invalid_argument when there are more worlds than cells.
TerritoryMap bisect(const Scene& scene, const Grid& grid, WorldId worlds);

// The territories that the scene gives by hand, if it does (Scene::territories), else those of bisect(); a world that
// is alone has everything. Throws std::invalid_argument, too, where they are given to another number of worlds, or
// leave a world without a cell.
TerritoryMap initial_territories(const Scene& scene, const Grid& grid, WorldId worlds);

}  // namespace soda
