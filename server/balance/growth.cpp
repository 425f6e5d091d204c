#include "server/balance/growth.h"

#include <algorithm>

#include "server/balance/shape.h"

namespace soda::balance {
namespace {

constexpr std::uint8_t kFree = 1;    // may be chosen
constexpr std::uint8_t kChosen = 2;

Vec3 place(const Grid& grid, std::size_t cell) {
  const Cell c = cell_at(grid, cell);
  return {static_cast<double>(c[0]), static_cast<double>(c[1]), static_cast<double>(c[2])};
}

}  // namespace

Growth::Direction Growth::sweep_direction(const GrowthRequest& r) const {
  Vec3 contact = Vec3::Zero(), crowd = Vec3::Zero();
  double faces = 0, load = 0;
  for (const std::uint32_t cell : r.mine) {
    std::size_t touching = 0;
    for_faces(r.grid, cell, [&](std::size_t n) { touching += r.owner[n] == r.taker; });
    contact += static_cast<double>(touching) * place(r.grid, cell);
    faces += static_cast<double>(touching);
    crowd += r.cost[cell] * place(r.grid, cell);
    load += r.cost[cell];
  }
  if (faces == 0 || load == 0) return {};
  const Vec3 from = contact / faces, way = crowd / load - from;
  constexpr double kNoWay = 0.5;  // cells: the load is where the border is
  return way.norm() < kNoWay ? Direction{} : Direction{from, way.normalized()};
}

double Growth::border_growth(const GrowthRequest& r, std::size_t cell) const {
  double growth = 0;
  for_faces(r.grid, cell, [&](std::size_t n) {
    const bool chosen = (state_[n] & kChosen) != 0;
    if (!chosen && r.owner[n] != r.giver && r.owner[n] != r.taker) return;  // a border before and after
    const double other = r.owner[n] == r.giver ? r.cost[n] : r.cost[cell];
    const double face = 1 + settings_.density * 0.5 * (r.cost[cell] + other) / unit_;
    growth += chosen || r.owner[n] == r.taker ? -face : face;
  });
  return growth;
}

void Growth::consider(const GrowthRequest& r, std::size_t cell) {
  if (state_[cell] != kFree) return;
  bool touches = false;
  for_faces(r.grid, cell, [&](std::size_t n) { touches |= (state_[n] & kChosen) || r.owner[n] == r.taker; });
  if (!touches) return;
  const double depth = direction_.towards.dot(place(r.grid, cell) - direction_.from);
  heap_.push_back({border_growth(r, cell) + settings_.sweep * depth, static_cast<std::uint32_t>(cell)});
  std::push_heap(heap_.begin(), heap_.end());
}

std::vector<std::uint32_t> Growth::grow(const GrowthRequest& r, double& cost_given) {
  state_.resize(r.grid.cells(), 0);
  heap_.clear();
  chosen_.clear();
  double load = 0, squares = 0;
  for (const std::uint32_t cell : r.mine) {
    if (!r.barred(cell)) state_[cell] = kFree;
    load += r.cost[cell];
    squares += r.cost[cell] * r.cost[cell];
  }
  unit_ = load > 0 ? squares / load : 1;
  direction_ = sweep_direction(r);
  for (const std::uint32_t cell : r.mine) consider(r, cell);

  double given = 0, border = 0;
  std::vector<std::pair<double, double>> reached;  // cost given and growth of the border, by number of cells
  while (!heap_.empty() && given < r.wanted && chosen_.size() < r.max_cells && chosen_.size() + 1 < r.mine.size()) {
    std::pop_heap(heap_.begin(), heap_.end());
    const Candidate best = heap_.back();
    heap_.pop_back();
    if (state_[best.cell] != kFree) continue;
    const double growth = border_growth(r, best.cell);
    const double depth = direction_.towards.dot(place(r.grid, best.cell) - direction_.from);
    if (best.score != growth + settings_.sweep * depth) continue;  // there is a newer one of this cell
    if (given + r.cost[best.cell] > r.limit) continue;
    if (!can_leave(r.grid, best.cell,
                   [&](std::size_t n) { return r.owner[n] == r.giver && !(state_[n] & kChosen); }))
      continue;  // considered again when something about it is chosen
    state_[best.cell] |= kChosen;
    chosen_.push_back(best.cell);
    given += r.cost[best.cell];
    border += growth;
    reached.push_back({given, border});
    for_around(r.grid, best.cell, [&](std::size_t n) { consider(r, n); });
  }
  for (const std::uint32_t cell : r.mine) state_[cell] = 0;

  // A little less, where that leaves a shorter border.
  std::size_t count = reached.size();
  for (std::size_t k = reached.size(); k-- > 0 && reached[k].first >= (1 - settings_.slack) * given;)
    if (reached[k].second < reached[count - 1].second) count = k + 1;
  chosen_.resize(count);
  cost_given = count == 0 ? 0 : reached[count - 1].first;
  std::vector<std::uint32_t> cells = chosen_;
  std::sort(cells.begin(), cells.end());
  return cells;
}

}  // namespace soda::balance
