// Shapes of territories on the grid: neighbours by faces, and pieces.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "common/grid.h"
#include "common/ids.h"

namespace soda::balance {

inline Cell cell_at(const Grid& grid, std::size_t index) {
  const auto i = static_cast<std::int64_t>(index);
  return {static_cast<std::int32_t>(i % grid.size[0]), static_cast<std::int32_t>(i / grid.size[0] % grid.size[1]),
          static_cast<std::int32_t>(i / grid.size[0] / grid.size[1])};
}

// Calls f(index) for each cell of the grid that shares a face with this one, ascending.
template <typename F>
void for_faces(const Grid& grid, std::size_t index, F&& f) {
  const Cell c = cell_at(grid, index);
  const std::array<std::size_t, 3> stride{1, static_cast<std::size_t>(grid.size[0]),
                                          static_cast<std::size_t>(grid.size[0]) * grid.size[1]};
  for (std::size_t axis = 3; axis-- > 0;)
    if (c[axis] > 0) f(index - stride[axis]);
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (c[axis] + 1 < grid.size[axis]) f(index + stride[axis]);
}

// Calls f(index) for each other cell of the grid within one cell along each axis.
template <typename F>
void for_around(const Grid& grid, std::size_t index, F&& f) {
  const Cell c = cell_at(grid, index);
  for (std::int32_t z = std::max(c[2] - 1, 0); z <= std::min(c[2] + 1, grid.size[2] - 1); ++z)
    for (std::int32_t y = std::max(c[1] - 1, 0); y <= std::min(c[1] + 1, grid.size[1] - 1); ++y)
      for (std::int32_t x = std::max(c[0] - 1, 0); x <= std::min(c[0] + 1, grid.size[0] - 1); ++x)
        if (const std::size_t i = grid.index({x, y, z}); i != index) f(i);
}

// Whether the cells of `world` are one piece, by faces. A world without cells counts as connected. O(grid).
bool connected(const Grid& grid, std::span<const WorldId> owner, WorldId world);

// Whether `world`, given these cells, would have no more pieces than before: each piece of them shares a face with a
// cell that is the world's already. `cells`: ascending, none of them the world's. A world without cells is given
// nothing so.
bool attached(const Grid& grid, std::span<const WorldId> owner, WorldId world, std::span<const std::uint32_t> cells);

namespace detail {
// Of a cube of 27 cells, bit (z + 1) * 9 + (y + 1) * 3 + x + 1: those with a face to cell i.
constexpr std::array<std::uint32_t, 27> kFaces = [] {
  std::array<std::uint32_t, 27> faces{};
  for (int i = 0; i < 27; ++i)
    for (int j = 0; j < 27; ++j) {
      const auto far = [](int a) { return a < 0 ? -a : a; };
      if (far(i % 3 - j % 3) + far(i / 3 % 3 - j / 3 % 3) + far(i / 9 - j / 9) == 1)
        faces[static_cast<std::size_t>(i)] |= std::uint32_t{1} << j;
    }
  return faces;
}();
constexpr std::uint32_t kCentre = 13;
}  // namespace detail

// Whether those of `cell`'s neighbours by faces that are `in` a set of cells hang together without it, by cells within
// one cell of it. Then the set has no more pieces without the cell than with it. (Where they hang together by a longer
// way only, the answer is no, too.)
template <typename In>
bool can_leave(const Grid& grid, std::size_t cell, In&& in) {
  const Cell c = cell_at(grid, cell);
  std::uint32_t around = 0;
  for_around(grid, cell, [&](std::size_t i) {
    if (!in(i)) return;
    const Cell o = cell_at(grid, i);
    around |= std::uint32_t{1} << ((o[2] - c[2] + 1) * 9 + (o[1] - c[1] + 1) * 3 + o[0] - c[0] + 1);
  });
  const std::uint32_t wanted = around & detail::kFaces[detail::kCentre];
  std::uint32_t reached = wanted & (~wanted + 1);  // the lowest
  for (std::uint32_t todo = reached; todo != 0;) {
    std::uint32_t next = 0;
    for (std::size_t i = 0; i < 27; ++i)
      if (todo >> i & 1) next |= detail::kFaces[i];
    todo = next & around & ~reached;
    reached |= todo;
  }
  return (wanted & ~reached) == 0;
}

}  // namespace soda::balance
