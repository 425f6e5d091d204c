// Which cells to give: grown from the taker's border into the giver's territory, so that both stay in one piece and
// compact (Miller & Luding 2004: territories like cubes or spheres keep borders, and what crosses them, few).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "common/grid.h"
#include "common/ids.h"

namespace soda::balance {

struct GrowthSettings {
  double density = 1;  // weight of a border face between cells of the territory's mean cost; an empty one's is 1
  double sweep = 0.3;  // faces that a cell further from the giver's load may cost less than one a cell nearer to it
  double slack = 0.2;  // of the cost reached, what is left out for a shorter border
};

struct GrowthRequest {
  const Grid& grid;
  WorldId giver = 0, taker = 0;
  std::span<const WorldId> owner;       // by cell
  std::span<const std::uint32_t> mine;  // ascending, the giver's cells that may be given
  std::span<const double> cost;         // by cell, s per step
  std::function<bool(std::uint32_t)> barred;  // cells not to give to this taker
  double wanted = 0;                    // s per step, to give if possible
  double limit = 0;                     // s per step, at most
  std::size_t max_cells = 0;
};

class Growth {
 public:
  explicit Growth(const GrowthSettings& settings = {}) : settings_(settings) {}

  // The cells, ascending; empty where nothing can be given. `cost_given`: s per step, of all of them.
  std::vector<std::uint32_t> grow(const GrowthRequest& request, double& cost_given);

 private:
  struct Candidate {
    double score;  // the lower, the sooner
    std::uint32_t cell;
    bool operator<(const Candidate& o) const { return score != o.score ? score > o.score : cell > o.cell; }
  };
  struct Direction {
    Vec3 from = Vec3::Zero(), towards = Vec3::Zero();  // cells; unit, or zero
  };
  Direction sweep_direction(const GrowthRequest& r) const;
  double border_growth(const GrowthRequest& r, std::size_t cell) const;
  void consider(const GrowthRequest& r, std::size_t cell);

  GrowthSettings settings_;
  std::vector<std::uint8_t> state_;  // by cell, bits
  std::vector<Candidate> heap_;
  std::vector<std::uint32_t> chosen_;
  Direction direction_;
  double unit_ = 0;  // s per step, of the mean cell that costs anything
};

}  // namespace soda::balance
