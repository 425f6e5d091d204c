// Broad phase: which bodies may touch. A uniform hash grid over exact boxes, built anew each time: its answer, the set
// of all overlapping pairs, depends on the boxes alone and never on history or on the grid.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/math.h"

namespace soda::physics {

// Partners of each body, higher index only, ascending: CSR. Indices are positions in the arrays given.
struct Pairs {
  std::vector<std::uint32_t> offsets;  // bodies + 1
  std::vector<std::uint32_t> partners;
  std::span<const std::uint32_t> of(std::size_t body) const {
    return std::span(partners).subspan(offsets[body], offsets[body + 1] - offsets[body]);
  }
};

// What the broad phase must know of a body besides its box.
enum BodyRole : std::uint8_t {
  kRoleNone = 0,
  kRoleWanted = 1,  // pairs are wanted only where at least one of the two is wanted ...
  kRoleAwake = 2,   // ... and at least one is awake
  kRoleWide = 4,    // between two wide bodies pairs are wanted in any case
};

class BroadPhase {
 public:
  // Finds all pairs of overlapping boxes whose roles ask for it. Boxes larger than `cell` along some axis are compared
  // with every other.
  void find(std::span<const Aabb> boxes, std::span<const std::uint8_t> roles, double cell, Pairs& pairs);

 private:
  // A body's box in single precision: half the memory, and four comparisons at once. Rounding keeps order, so whose
  // rounded boxes are apart are apart.
  using Floats = float __attribute__((vector_size(4 * sizeof(float))));
  struct Rounded {
    Floats min, max;  // x, y, z, 0
  };
  static Rounded rounded(const Aabb& box);
  static bool may_overlap(const Rounded& l, const Rounded& r);

  struct Entry {
    std::int32_t x, y, z;  // the cell of its centre
    std::uint32_t body;
  };
  std::vector<Rounded> rounded_;  // by position in entries_
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> buckets_, bucket_of_, large_;
  std::vector<std::uint64_t> found_;
};

// The scene's static bodies: large ones in a list, small ones in a grid made once.
class StaticGrid {
 public:
  StaticGrid(std::span<const Aabb> boxes, double cell);
  // Indices of the boxes that overlap, ascending. Thread-safe.
  void find(const Aabb& box, std::vector<std::uint32_t>& out) const;

 private:
  std::vector<Aabb> boxes_;
  std::vector<std::uint32_t> large_;
  double cell_;
  // Open addressing by cell key: ranges in members_.
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t first = 0, count = 0;
  };
  std::vector<Slot> slots_;
  std::vector<std::uint32_t> members_;
  const Slot* slot(std::uint64_t key) const;
};

}  // namespace soda::physics
