#include "server/balance/shape.h"

#include <vector>

namespace soda::balance {

bool connected(const Grid& grid, std::span<const WorldId> owner, WorldId world) {
  std::vector<std::uint8_t> reached(owner.size(), 0);
  std::vector<std::size_t> todo;
  std::size_t cells = 0, found = 0;
  for (std::size_t i = 0; i < owner.size(); ++i) {
    if (owner[i] != world) continue;
    if (cells++ == 0) todo.push_back(i), reached[i] = 1;
  }
  while (!todo.empty()) {
    const std::size_t i = todo.back();
    todo.pop_back();
    ++found;
    for_faces(grid, i, [&](std::size_t n) {
      if (owner[n] == world && !reached[n]) todo.push_back(n), reached[n] = 1;
    });
  }
  return found == cells;
}

bool attached(const Grid& grid, std::span<const WorldId> owner, WorldId world, std::span<const std::uint32_t> cells) {
  std::vector<std::uint8_t> reached(cells.size(), 0);
  std::vector<std::size_t> todo;
  for (std::size_t k = 0; k < cells.size(); ++k)
    for_faces(grid, cells[k], [&](std::size_t n) {
      if (owner[n] == world && !reached[k]) todo.push_back(k), reached[k] = 1;
    });
  std::size_t found = 0;
  while (!todo.empty()) {
    const std::size_t k = todo.back();
    todo.pop_back();
    ++found;
    for_faces(grid, cells[k], [&](std::size_t n) {
      const auto at = std::lower_bound(cells.begin(), cells.end(), n);
      if (at == cells.end() || *at != n) return;
      const auto other = static_cast<std::size_t>(at - cells.begin());
      if (!reached[other]) todo.push_back(other), reached[other] = 1;
    });
  }
  return found == cells.size();
}

}  // namespace soda::balance
