#include "server/balance/growth.h"

#include <algorithm>

#include "server/balance/shape.h"

namespace soda::balance {
namespace {

constexpr std::uint8_t kFree = 1;  // may be chosen
constexpr std::uint8_t kChosen = 2, kSeen = 4;
constexpr int kCuts = 8;  // tries, per call, to give what would be cut off as well: each looks at all own cells

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

bool Growth::is_left(const GrowthRequest& r, std::size_t cell) const {
  return r.owner[cell] == r.giver && !(state_[cell] & kChosen);
}

double Growth::border_growth(const GrowthRequest& r, std::size_t cell) const {
  double growth = 0;
  for_faces(r.grid, cell, [&](std::size_t n) {
    const bool left = is_left(r, n);
    if (!left && r.owner[n] != r.giver && r.owner[n] != r.taker) return;  // a border before and after
    const double other = r.owner[n] == r.giver ? r.cost[n] : r.cost[cell];
    const double face = 1 + settings_.density * 0.5 * (r.cost[cell] + other) / unit_;
    growth += left ? face : -face;
  });
  return growth;
}

double Growth::score(const GrowthRequest& r, std::size_t cell) const {
  const double depth = direction_.towards.dot(place(r.grid, cell) - direction_.from);
  return border_growth(r, cell) + settings_.sweep * depth;
}

void Growth::consider(const GrowthRequest& r, std::size_t cell) {
  if (state_[cell] != kFree) return;
  bool touches = false;
  for_faces(r.grid, cell, [&](std::size_t n) { touches |= (state_[n] & kChosen) || r.owner[n] == r.taker; });
  if (!touches) return;
  heap_.push_back({score(r, cell), static_cast<std::uint32_t>(cell)});
  std::push_heap(heap_.begin(), heap_.end());
}

void Growth::choose(const GrowthRequest& r, std::uint32_t cell) {
  border_ += border_growth(r, cell);
  given_ += r.cost[cell];
  state_[cell] |= kChosen;
  chosen_.push_back(cell);
  for_around(r.grid, cell, [&](std::size_t n) { consider(r, n); });
}

// Chooses a cell that may cut what is left into pieces, and all of these but the most costly one. Rings and strips one
// cell wide could give nothing otherwise.
bool Growth::choose_with_rest(const GrowthRequest& r, std::uint32_t cell) {
  rest_.clear();                       // flooded, all pieces one after the other
  std::size_t kept = 0, kept_end = 0;  // the piece that is kept, in rest_
  double all = 0, most = -1;
  state_[cell] |= kSeen;
  for_faces(r.grid, cell, [&](std::size_t start) {
    if (!is_left(r, start) || state_[start] & kSeen) return;
    const std::size_t first = rest_.size();
    double cost = 0;
    state_[start] |= kSeen;
    rest_.push_back(static_cast<std::uint32_t>(start));
    for (std::size_t k = first; k < rest_.size(); ++k) {
      cost += r.cost[rest_[k]];
      for_faces(r.grid, rest_[k], [&](std::size_t n) {
        if (!is_left(r, n) || state_[n] & kSeen) return;
        state_[n] |= kSeen;
        rest_.push_back(static_cast<std::uint32_t>(n));
      });
    }
    all += cost;
    if (cost > most) most = cost, kept = first, kept_end = rest_.size();
  });
  state_[cell] &= static_cast<std::uint8_t>(~kSeen);
  for (const std::uint32_t c : rest_) state_[c] &= static_cast<std::uint8_t>(~kSeen);
  if (kept == kept_end) return false;
  rest_.erase(rest_.begin() + static_cast<std::ptrdiff_t>(kept), rest_.begin() + static_cast<std::ptrdiff_t>(kept_end));
  if (given_ + r.cost[cell] + (all - most) > r.limit || chosen_.size() + 1 + rest_.size() > r.max_cells) return false;
  if (std::any_of(rest_.begin(), rest_.end(), [&](std::uint32_t c) { return state_[c] != kFree; })) return false;
  choose(r, cell);
  for (const std::uint32_t c : rest_) choose(r, c);
  return true;
}

Growth::Grown Growth::grow(const GrowthRequest& r) {
  state_.resize(r.grid.cells(), 0);
  heap_.clear(), blocked_.clear(), chosen_.clear(), reached_.clear();
  given_ = border_ = 0;
  double load = 0, squares = 0;
  for (const std::uint32_t cell : r.mine) {
    if (!r.barred(cell)) state_[cell] = kFree;
    load += r.cost[cell];
    squares += r.cost[cell] * r.cost[cell];
  }
  unit_ = load > 0 ? squares / load : 1;
  direction_ = sweep_direction(r);
  for (const std::uint32_t cell : r.mine) consider(r, cell);

  for (int cuts = 0; chosen_.size() < r.max_cells && chosen_.size() + 1 < r.mine.size();) {
    const bool enough = given_ >= r.wanted;  // from then on only what makes the border shorter
    if (heap_.empty()) {
      if (enough || blocked_.empty() || cuts++ == kCuts) break;
      const auto best = std::max_element(blocked_.begin(), blocked_.end());
      const std::uint32_t cell = best->cell;
      blocked_.erase(best);
      if (state_[cell] != kFree || !choose_with_rest(r, cell)) continue;
    } else {
      std::pop_heap(heap_.begin(), heap_.end());
      const Candidate best = heap_.back();
      heap_.pop_back();
      if (state_[best.cell] != kFree || best.score != score(r, best.cell))
        continue;  // there is a newer one of this cell
      if (given_ + r.cost[best.cell] > r.limit || (enough && border_growth(r, best.cell) >= 0)) continue;
      if (!can_leave(r.grid, best.cell, [&](std::size_t n) { return is_left(r, n); })) {
        blocked_.push_back(best);
        continue;
      }
      choose(r, best.cell);
    }
    reached_.push_back({chosen_.size(), given_, border_});
  }
  for (const std::uint32_t cell : r.mine) state_[cell] = 0;

  if (reached_.empty()) return {};
  Reached best = reached_.back();
  const bool full = best.cost < r.wanted && best.cells >= r.max_cells;
  // A little less, where that leaves a shorter border still.
  for (const Reached& k : reached_)
    if (!full && k.cost >= (1 - settings_.slack) * given_ && k.border < best.border) best = k;
  chosen_.resize(best.cells);
  std::sort(chosen_.begin(), chosen_.end());
  return {chosen_, best.cost, full};
}

}  // namespace soda::balance
