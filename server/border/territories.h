// Who owns which cell at which step: the initial territories and the transfers of cells that are known. A transfer must
// become known before anything of its step is computed; trade.h is how it does.
#pragma once

#include <cstdint>
#include <span>
#include <string>
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
  // `transfers`: that are known from the start.
  explicit Territories(const TerritoryMap& initial, std::span<const Transfer> transfers = {});

  const Grid& grid() const { return grid_; }
  WorldId worlds() const { return worlds_; }
  // Why a transfer cannot be: cells that there are not, or that are not the giver's at the step before, a number that
  // is not the giver's next. Empty where it can be, or is known already.
  std::string fault(const Transfer& transfer) const;
  // Takes a transfer without fault; false where it is known already.
  bool add(const Transfer& transfer);
  std::uint32_t known(WorldId giver) const { return known_[giver]; }     // number of the newest transfer of that world
  const std::vector<Transfer>& transfers() const { return transfers_; }  // that are remembered: by step, giver, number

  WorldId owner(std::size_t cell, Step step) const { return at(step).owner[cell]; }
  std::span<const WorldId> owners(Step step) const { return at(step).owner; }  // by cell
  WorldId owner_of(const Vec3& position, Step step) const { return owner(grid_.index(grid_.cell_of(position)), step); }
  // The one world that owns every cell within one cell, or kNoWorld.
  WorldId sole(std::size_t cell, Step step) const { return at(step).sole[cell]; }
  std::size_t cells_of(WorldId world, Step step) const;

  // Whether cells change hands at this step; and then, whether one within two cells of this does.
  bool change_at(Step step) const { return at(step).from == step && step > 0; }
  bool changes_near(std::size_t cell, Step step) const { return change_at(step) && at(step).near_changed[cell]; }

  // Whether `world` owns a cell from `step` on, whatever is known to happen.
  bool keeps(WorldId world, std::size_t cell, Step step) const;
  // After all that is known.
  const std::vector<WorldId>& newest() const { return versions_.back().owner; }

  // Lowers since[w] to the first step that is known of at which w owns a cell within `range` cells of one that `world`
  // owns then; or owned either at the step before. Looks at what holds from `from` on only.
  void find_neighbours(WorldId world, int range, Step from, std::vector<Step>& since) const;

  // The most neighbours from one world that has cells to another, by the initial territories; `range` as above.
  Step diameter(int range) const;

  // Nothing is asked about steps before this one any more. Transfers are remembered for `memory` steps longer, for
  // worlds to whom somebody new may have to tell them.
  void release_before(Step step, Step memory);

 private:
  struct Version {
    Step from = 0;
    std::vector<WorldId> owner, sole;        // by cell
    std::vector<std::uint8_t> near_changed;  // by cell; of the first: empty
  };
  const Version& at(Step step) const {
    auto version = versions_.end();
    do --version;
    while (version->from > step && version != versions_.begin());
    return *version;
  }
  void make_sole(Version& version, const std::vector<std::uint8_t>& where) const;
  void rebuild_from(Step step);

  Grid grid_;
  WorldId worlds_;
  std::vector<Version> versions_;  // ascending
  std::vector<Transfer> transfers_;
  std::vector<std::uint32_t> known_;  // by giver
};

}  // namespace soda::border
