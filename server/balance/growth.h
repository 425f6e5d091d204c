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
  double sweep = 0.5;  // faces that a cell further from the giver's load may cost less than one a cell nearer to it
  double slack = 0.1;  // of the cost reached, what is left out for a shorter border
};

struct GrowthRequest {
  const Grid& grid;
  WorldId giver = 0, taker = 0;
  std::span<const WorldId> owner;             // by cell
  std::span<const std::uint32_t> mine;        // ascending, the giver's cells that may be given
  std::span<const double> cost;               // by cell, s per step
  std::function<bool(std::uint32_t)> barred;  // cells not to give to this taker
  double wanted = 0;                          // s per step, to give if possible
  double limit = 0;                           // s per step, at most
  std::size_t max_cells = 0;
};

class Growth {
 public:
  explicit Growth(const GrowthSettings& settings = {}) : settings_(settings) {}

  struct Grown {
    std::vector<std::uint32_t> cells;  // ascending; empty where nothing can be given
    double cost = 0;                   // s per step, of all of them
    bool full = false;                 // there would be more to give, if more cells were allowed
  };
  Grown grow(const GrowthRequest& request);

 private:
  struct Candidate {
    double score;  // the lower, the sooner
    std::uint32_t cell;
    bool operator<(const Candidate& o) const { return score != o.score ? score > o.score : cell > o.cell; }
  };
  struct Direction {
    Vec3 from = Vec3::Zero(), towards = Vec3::Zero();  // cells; unit, or zero
  };
  struct Reached {  // after some of the cells: what may be stopped at
    std::size_t cells;
    double cost, border;
  };
  Direction sweep_direction(const GrowthRequest& r) const;
  bool is_left(const GrowthRequest& r, std::size_t cell) const;  // the giver's, and not chosen
  double border_growth(const GrowthRequest& r, std::size_t cell) const;
  double score(const GrowthRequest& r, std::size_t cell) const;
  void consider(const GrowthRequest& r, std::size_t cell);
  void choose(const GrowthRequest& r, std::uint32_t cell);
  bool choose_with_rest(const GrowthRequest& r, std::uint32_t cell);

  GrowthSettings settings_;
  std::vector<std::uint8_t> state_;  // by cell, bits
  std::vector<Candidate> heap_, blocked_;
  std::vector<std::uint32_t> chosen_, rest_;
  std::vector<Reached> reached_;
  Direction direction_;
  double unit_ = 0;                // s per step, of the cell in which the giver's cost is on average
  double given_ = 0, border_ = 0;  // s per step; weighted faces that the border between the two has grown by
};

}  // namespace soda::balance
