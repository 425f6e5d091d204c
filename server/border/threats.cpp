#include "server/border/threats.h"

#include <algorithm>

namespace soda::border {

void Threats::add(const Aabb& box, const Vec3& velocity, double seconds, double margin) {
  const Vec3 way = seconds * velocity;
  boxes_.push_back(
      {box.min + way.cwiseMin(0.0) - Vec3::Constant(margin), box.max + way.cwiseMax(0.0) + Vec3::Constant(margin)});
  sorted_ = false;
}

void Threats::sort() {
  sorted_ = true;
  all_ = boxes_.front();
  for (const Aabb& box : boxes_) {
    all_.min = all_.min.cwiseMin(box.min);
    all_.max = all_.max.cwiseMax(box.max);
  }
  (all_.max - all_.min).maxCoeff(&axis_);
  longest_ = 0;
  for (const Aabb& box : boxes_) longest_ = std::max(longest_, box.max[axis_] - box.min[axis_]);
  std::sort(boxes_.begin(), boxes_.end(), [&](const Aabb& l, const Aabb& r) { return l.min[axis_] < r.min[axis_]; });
}

bool Threats::meet(std::span<const Aabb> boxes) {
  if (boxes_.empty()) return false;
  if (!sorted_) sort();
  for (const Aabb& box : boxes) {
    if (!box.overlaps(all_)) continue;
    auto at = std::lower_bound(boxes_.begin(), boxes_.end(), box.min[axis_] - longest_,
                               [&](const Aabb& b, double from) { return b.min[axis_] < from; });
    for (; at != boxes_.end() && at->min[axis_] <= box.max[axis_]; ++at)
      if (at->overlaps(box)) return true;
  }
  return false;
}

}  // namespace soda::border
