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

// What a side of a territory behind which there are others costs, as so many bodies: messages. Measured with 1,000
// bodies per world and 8 neighbours around it (docs/experiments.md). At most an eighth of a world's mean work is
// counted for it. What is heard of across it counts apart, but where this is 0.
constexpr double kBorderBodies = 57;

// Recursive bisection of the grid, weighted by what its cells will cost: connected territories with about the same work
// each, cut where few bodies are, and upright; boxes of cells but for a part of a row at their ends where that makes
// work more equal. Dynamic bodies count, static things a little, for what comes there touches them; large ones
// (grounds, walls across many cells) do not; and borders. Every world gets at least one cell. A pure function of its
// arguments. Throws std::invalid_argument when there are more worlds than cells, or so few cells that cuts find none
// for some world.
TerritoryMap bisect(const Scene& scene, const Grid& grid, WorldId worlds, double border_bodies = kBorderBodies);

// The territories that the scene gives by hand, if it does (Scene::territories), else those of bisect(); a world that
// is alone has everything. Throws std::invalid_argument, too, where they are given to another number of worlds, or
// leave a world without a cell.
TerritoryMap initial_territories(const Scene& scene, const Grid& grid, WorldId worlds);

}  // namespace soda
