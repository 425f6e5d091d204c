#include "server/timeline/spatial_index.h"

#include <algorithm>
#include <cmath>

namespace soda::timeline {

SpatialIndex::Key SpatialIndex::key_of(std::int64_t x, std::int64_t y, std::int64_t z) {
  // Two cells with one key only make answers longer.
  Key h = static_cast<Key>(x) * 0x9e3779b97f4a7c15u;
  h = (h ^ (h >> 29)) + static_cast<Key>(y) * 0xbf58476d1ce4e5b9u;
  h = (h ^ (h >> 31)) + static_cast<Key>(z) * 0x94d049bb133111ebu;
  h ^= h >> 30;
  return h >= kEverywhere ? 0 : h;
}

std::int64_t SpatialIndex::cell_along(double place) const {
  constexpr double kFar = 1e12;  // cells; beyond, all is one
  return static_cast<std::int64_t>(std::clamp(std::floor(place * inverse_), -kFar, kFar));
}

SpatialIndex::Key SpatialIndex::key_of(const Vec3& centre) const {
  return key_of(cell_along(centre.x()), cell_along(centre.y()), cell_along(centre.z()));
}

void SpatialIndex::note(Slot slot, const Vec3& centre, bool large, Step step) {
  if (slot >= now_.size()) now_.resize(slot + 1, kNowhere);
  const Key key = large ? kEverywhere : key_of(centre);
  newest_ = std::max(newest_, step);
  Key& now = now_[slot];
  if (now == key) return;
  bool listed = false;
  if (now != kNowhere) {
    std::vector<Seen>& earlier = earlier_[slot];
    listed = std::erase_if(earlier, [&](const Seen& s) { return s.key == key; }) > 0;
    earlier.push_back({now, newest_});
  }
  now = key;
  if (!listed) cells_[key].push_back(slot);
}

void SpatialIndex::note_beside(Slot slot, const Vec3& centre, bool large, Step step) {
  const Key key = large ? kEverywhere : key_of(centre);
  newest_ = std::max(newest_, step);
  if (now_.at(slot) == key) return;
  beside_.insert(slot);
  std::vector<Seen>& earlier = earlier_[slot];
  const auto listed = std::find_if(earlier.begin(), earlier.end(), [&](const Seen& s) { return s.key == key; });
  if (listed != earlier.end()) {
    listed->last = kStill;
    return;
  }
  earlier.push_back({key, kStill});
  cells_[key].push_back(slot);
}

void SpatialIndex::not_beside(Slot slot) {
  if (beside_.erase(slot) == 0) return;
  for (Seen& s : earlier_[slot])
    if (s.last == kStill) s.last = newest_;
}

void SpatialIndex::note_gone(Slot slot) {
  not_beside(slot);
  if (slot >= now_.size() || now_[slot] == kNowhere) return;
  earlier_[slot].push_back({now_[slot], newest_});
  now_[slot] = kNowhere;
}

void SpatialIndex::query(const Aabb& box, std::vector<Slot>& out) const {
  const auto visit = [&](Key key) {
    const auto cell = cells_.find(key);
    if (cell != cells_.end()) out.insert(out.end(), cell->second.begin(), cell->second.end());
  };
  visit(kEverywhere);
  std::int64_t low[3], high[3];
  double cells = 1;
  for (int axis = 0; axis < 3; ++axis) {
    low[axis] = cell_along(box.min[axis] - half_);
    high[axis] = cell_along(box.max[axis] + half_);
    cells *= static_cast<double>(high[axis] - low[axis] + 1);
  }
  if (cells > static_cast<double>(cells_.size())) {  // a very large body
    for (const auto& [key, slots] : cells_)
      if (key != kEverywhere) out.insert(out.end(), slots.begin(), slots.end());
    return;
  }
  for (std::int64_t z = low[2]; z <= high[2]; ++z)
    for (std::int64_t y = low[1]; y <= high[1]; ++y)
      for (std::int64_t x = low[0]; x <= high[0]; ++x) visit(key_of(x, y, z));
}

void SpatialIndex::leave(Slot slot, Key key) {
  const auto cell = cells_.find(key);
  std::vector<Slot>& slots = cell->second;
  *std::find(slots.begin(), slots.end(), slot) = slots.back();
  slots.pop_back();
  if (slots.empty()) cells_.erase(cell);
}

void SpatialIndex::forget_before(Step step) {
  for (auto it = earlier_.begin(); it != earlier_.end();) {
    std::erase_if(it->second, [&](const Seen& s) {
      if (s.last >= step) return false;
      leave(it->first, s.key);
      return true;
    });
    it = it->second.empty() ? earlier_.erase(it) : std::next(it);
  }
}

}  // namespace soda::timeline
