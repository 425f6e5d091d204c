// Who owns which cell at which step: the initial territories and the transfers of cells that are known. Steps before a
// transfer's are never asked about again in another way: what is learnt of them must be learnt in time (transfers.h).
#pragma once

#include <cstdint>
#include <vector>

#include "common/territory.h"

namespace soda::border {

// Cells that change hands: nothing else is handed over, since from then on their bodies are the taker's to compute, and
// who produced them at that step tells it so as of any body that arrives.
struct Transfer {
  WorldId giver = 0;
  std::uint32_t number = 0;  // of the giver's transfers, from 1
  Step step = 0;             // from which on the taker owns them
  WorldId taker = 0;
  std::vector<std::uint32_t> cells;  // by Grid::index, ascending
  bool operator==(const Transfer&) const = default;
};

class Territories {
 public:
  explicit Territories(const TerritoryMap& initial);

  const Grid& grid() const { return grid_; }
  WorldId worlds() const { return worlds_; }
  // Takes a transfer of cells that are the giver's at the step before; false where it is known already.
  bool add(const Transfer& transfer);
  bool knows(WorldId giver, std::uint32_t number) const;
  const std::vector<Transfer>& transfers() const { return transfers_; }  // by step, giver, number

  WorldId owner(std::size_t cell, Step step) const { return at(step).owner[cell]; }
  WorldId owner_of(const Vec3& position, Step step) const { return owner(grid_.index(grid_.cell_of(position)), step); }
  // The one world that owns every cell within one cell, or kNoWorld.
  WorldId sole(std::size_t cell, Step step) const { return at(step).sole[cell]; }
  std::size_t cells_of(WorldId world, Step step) const;

  // Whether cells change hands at this step; and then, whether one within two cells of this does.
  bool change_at(Step step) const { return at(step).from == step && step > 0; }
  bool changes_near(std::size_t cell, Step step) const { return change_at(step) && at(step).near_changed[cell]; }

  // Marks worlds that own cells, at any step that is known of, within `range` cells of one that `world` owns then; or
  // owned either at the step before.
  void mark_neighbours(WorldId world, int range, std::vector<std::uint8_t>& marked) const;

 private:
  struct Version {
    Step from = 0;
    std::vector<WorldId> owner, sole;        // by cell
    std::vector<std::uint8_t> near_changed;  // by cell; of the first: empty
  };
  const Version& at(Step step) const;
  void make_sole(Version& version, const std::vector<std::uint8_t>& where) const;
  void rebuild_from(Step step);

  Grid grid_;
  WorldId worlds_;
  std::vector<Version> versions_;  // ascending
  std::vector<Transfer> transfers_;
};

}  // namespace soda::border
