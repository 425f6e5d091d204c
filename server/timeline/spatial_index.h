// Where to look for bodies: a hash grid over the centres of all states of a whole window of steps at once. It answers
// with a superset, bodies that were in the vicinity at some step of the window; whoever asks looks at the step's own
// records. So one grid serves all entries, and a step costs it only the bodies that changed cells.
#pragma once

#include <cstdint>
#include <limits>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "common/ids.h"
#include "common/math.h"

namespace soda::timeline {

class SpatialIndex {
 public:
  using Slot = std::uint32_t;

  // `cell`, m: bodies whose boxes reach at most half of it from their centres are found by cell, others always.
  explicit SpatialIndex(double cell) : inverse_(1 / cell), half_(0.5 * cell) {}

  // How far a body's reach box may reach from its centre so that it is not large, m.
  double ordinary_reach() const { return half_; }

  // A body has a state with that centre at `step` or before, within the window. Every state of a body is noted, but for
  // those that a later step has taken over unchanged from the one before.
  void note(Slot slot, const Vec3& centre, bool large, Step step);

  // As well as where it is noted now, the body has a state there: two worlds tell of it at the newest step, of which
  // one must be wrong. Both places are kept until not_beside().
  void note_beside(Slot slot, const Vec3& centre, bool large, Step step);
  bool is_beside(Slot slot) const { return !beside_.empty() && beside_.contains(slot); }
  // From the newest step on the body has a state where it is noted now, and nowhere else.
  void not_beside(Slot slot);

  // The body has no state from the newest step on, until it is noted again.
  void note_gone(Slot slot);

  // Appends every body that may have a state whose box overlaps `box`; some twice.
  void query(const Aabb& box, std::vector<Slot>& out) const;

  // States before `step` do not matter any more.
  void forget_before(Step step);

 private:
  using Key = std::uint64_t;
  struct Seen {
    Key key;
    Step last;  // a state there cannot be later
  };
  static constexpr Key kNowhere = ~Key{0}, kEverywhere = kNowhere - 1;
  static constexpr Step kStill = std::numeric_limits<Step>::max();
  static Key key_of(std::int64_t x, std::int64_t y, std::int64_t z);
  Key key_of(const Vec3& centre) const;
  std::int64_t cell_along(double place) const;
  void leave(Slot slot, Key key);

  double inverse_, half_;
  Step newest_ = 0;  // noted
  std::unordered_map<Key, std::vector<Slot>> cells_;
  std::vector<Key> now_;                                 // by slot: where it was noted last
  std::unordered_map<Slot, std::vector<Seen>> earlier_;  // and before that, within the window
  std::unordered_set<Slot> beside_;                      // that have an earlier place with last == kStill
};

}  // namespace soda::timeline
