// Whom an island may yet have to do with: bodies whose states at its step are not known, only those some steps before.
// A guess of where they may have got decides about waiting, and never about state.
#pragma once

#include <span>
#include <vector>

#include "common/body_state.h"
#include "common/math.h"

namespace soda::border {

class Threats {
 public:
  void clear() { boxes_.clear(), sorted_ = true; }
  bool empty() const { return boxes_.empty(); }
  // A body last seen with that reach box and velocity (m/s) `seconds` ago; `margin` m more on all sides.
  void add(const Aabb& box, const Vec3& velocity, double seconds, double margin);
  // Whether any of `boxes` meets one of them.
  bool meet(std::span<const Aabb> boxes);

 private:
  void sort();
  std::vector<Aabb> boxes_;
  Aabb all_;
  int axis_ = 0;        // along which they are sorted
  double longest_ = 0;  // extent along it, at most
  bool sorted_ = true;
};

}  // namespace soda::border
