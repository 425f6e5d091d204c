// The canonical order in which an island's constraints are solved. It depends on ids, places and scene constants only:
// never on which process solves, nor on what else is in the scene.
//
// Four grids of blocks, each shifted against the one before by a quarter of a block along all axes. A pair belongs to
// the first grid one of whose blocks holds both bodies' centres at the start of the step, or else to a last phase; a
// pair with a static body goes by its dynamic body alone. Order: grid, block, colour, lower id, higher id, part. The
// colours are greedy within the block: constraints of one colour share no body, which lets errors cancel instead of run
// through a stack in one direction, and keeps the place for solving four of them at once. Blocks of one grid share no
// body.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/math.h"
#include "server/physics/islands.h"

namespace soda::physics {

class ConstraintOrder {
 public:
  explicit ConstraintOrder(double block_edge) : inverse_edge_(1 / block_edge) {}

  // Sorts `contacts` (positions in an array of records, given in canonical order of ids) of one island into solving
  // order. `ends` by record, `centres` by body (m).
  void sort(std::span<std::uint32_t> contacts, std::span<const Ends> ends, std::span<const Vec3> centres);

 private:
  struct Key {
    std::uint64_t block;  // grid and block, packed
    std::uint32_t contact;
    std::uint32_t colour;
  };
  std::uint64_t block_of(const Vec3& a, const Vec3& b) const;
  void colour(std::span<Key> block, std::span<const Ends> ends, std::span<std::uint32_t> contacts);
  double inverse_edge_;
  std::vector<Key> keys_;
  std::vector<std::uint64_t> used_, stamp_;  // by body: colours used in the block now coloured
  std::uint64_t block_stamp_ = 0;
};

}  // namespace soda::physics
