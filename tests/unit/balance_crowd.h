// A session with a crowd, as load balancing sees it: no physics, bodies walk as they are told; loads, reports and
// transfers are as late as they are between daemons.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/grid.h"
#include "common/territory.h"
#include "server/balance/policy.h"

namespace soda::balance::test {

// Gives a body's place, m, at a time, s. Cells have an edge of 1 m.
using Walk = std::function<Vec3(std::size_t body, double time)>;

struct CrowdOptions {
  Grid grid;
  std::vector<WorldId> owner;  // at the start
  WorldId worlds = 4;
  std::size_t bodies = 0;
  Walk walk;
  double cost = 10e-6;  // s per step, of a body
  double noise = 0;     // of measured costs, relative
  double budget = 0;    // s per step
  double window = 48;   // steps that a world may be ahead of what is displayed
  bool balancing = true;
  bool foresight = true;     // costs are where bodies are heading, else where they are
  double horizon = 1;        // s, of foresight
  Step in_flight = 60;       // steps after an agreement until the giver may make the next
  double speed_known = 0.5;  // cells about a world from which it knows of bodies
  Settings settings;
};

// 60 steps per second. Each world reports and decides every 15 steps; a report is known to the others 15 steps later; a
// transfer takes effect 60 steps after it has been agreed on.
class CrowdSession {
 public:
  explicit CrowdSession(const CrowdOptions& options);

  void run(Step steps);

  Step now() const { return now_; }
  double slowest_over_mean() const;        // of the worlds' present loads
  double worst() const { return worst_; }  // the largest of that since the last call of forget()
  double mean_ratio() const { return ratios_ / static_cast<double>(samples_); }
  void forget() { worst_ = ratios_ = 0, samples_ = 0; }
  const std::vector<double>& loads() const { return load_; }  // by world, s per step
  const std::vector<WorldId>& owner() const { return owner_; }
  std::size_t transfers() const { return transfers_; }
  std::size_t cells_moved() const { return cells_moved_; }
  std::size_t refused() const { return refused_; }
  Step last_transfer() const { return last_transfer_; }  // that was agreed on
  std::size_t returned() const { return returned_; }     // cells that went back to whom they came from within 10 s
  std::size_t bodies_near_borders() const;               // in cells with a face to another world's
  std::size_t border_faces() const;
  const std::string& fault() const { return fault_; }  // what must not be, empty if nothing
  double late() const { return late_; }                // s that the display has lost, when paced
  std::string picture() const;                         // the lowest layer

 private:
  struct Transfer {
    Step step, agreed;
    WorldId giver, taker;
    std::vector<std::uint32_t> cells;
    double cost;
  };
  struct Past {
    WorldId from = kNoWorld;
    Step at = 0;
  };

  void move();
  void forecast();
  void apply();
  bool decide(WorldId world);  // false: it was refused
  double measured(double cost);
  void check(const char* when, const std::vector<WorldId>& owner);

  CrowdOptions o_;
  Step now_ = 0;
  std::vector<WorldId> owner_, agreed_;             // now, and after all transfers
  std::vector<std::uint32_t> cell_;                 // by body
  std::vector<std::size_t> count_;                  // bodies by cell
  std::vector<double> load_;                        // by world, true, s per step
  std::vector<std::vector<double>> expected_cost_;  // by world, by cell
  std::deque<Transfer> flying_;
  std::vector<Policy> policies_;
  std::deque<std::vector<Load>> reports_;  // newest last, by world
  std::vector<Past> past_;                 // by cell
  std::vector<double> ahead_;              // by world, steps beyond the displayed one
  double worst_ = 0, ratios_ = 0, late_ = 0;
  std::size_t samples_ = 0, transfers_ = 0, cells_moved_ = 0, refused_ = 0, returned_ = 0;
  Step last_transfer_ = -1;
  std::string fault_;
  std::uint64_t random_ = 1;
};

// `bodies` in a crowd that walks from one corner of the grid to the other in `seconds` and stays there: a Gaussian blob
// of `spread` cells, cut off at `radius` cells from its middle along x and y, with which it starts at the grid's edges
// and stops there; upright half a Gaussian of one cell, on the ground. And one body that stands in each cell.
Walk walking_crowd(const Grid& grid, std::size_t bodies, double spread, double radius, double seconds);

// Territories as a session starts with: bisection by where the bodies are at time 0.
std::vector<WorldId> bisected(const CrowdOptions& options);

}  // namespace soda::balance::test
