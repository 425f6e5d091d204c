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

// Recursive bisection of the grid, weighted by the dynamic bodies' initial cells: boxes of cells with about the same
// number of bodies each, cut where few bodies are, and upright. Every world gets at least one cell. A pure function of
// its arguments.
// Throws std::invalid_argument when there are more worlds than cells.
TerritoryMap bisect(const Scene& scene, const Grid& grid, WorldId worlds);

}  // namespace soda
