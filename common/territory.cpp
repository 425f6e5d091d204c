#include "common/territory.h"

#include <algorithm>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>

namespace soda {
namespace {

struct Region {
  Cell low, high;  // cells low .. high - 1 along each axis
  std::size_t cells() const {
    return static_cast<std::size_t>(high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2]);
  }
};

// Where a body is, in half cells from the grid's origin.
using HalfCell = std::array<std::int32_t, 3>;

HalfCell half_cell_of(const Grid& grid, const Vec3& position) {
  const Cell cell = grid.cell_of(position);
  HalfCell half;
  for (int axis = 0; axis < 3; ++axis)
    half[axis] = 2 * cell[axis] + (position[axis] - grid.origin[axis] >= (cell[axis] + 0.5) * grid.edge);
  return half;
}

class Bisector {
 public:
  // `last_axis` is cut only where no other can be; -1: all axes are alike.
  Bisector(const Grid& grid, int last_axis, std::vector<WorldId>& owner)
      : grid_(grid), last_axis_(last_axis), owner_(owner) {}

  // Gives `region`, in which `bodies` are, to `count` worlds from `first` on. Reorders the bodies.
  void split(const Region& region, std::span<HalfCell> bodies, WorldId first, WorldId count) {
    if (count == 1) {
      for_each(region, [&](const Cell& c) { owner_[grid_.index(c)] = first; });
      return;
    }
    const WorldId lower = count / 2;
    const Cut cut = best_cut(region, bodies, lower, count);
    Region below = region, above = region;
    below.high[cut.axis] = above.low[cut.axis] = cut.at;
    const auto middle =
        std::partition(bodies.begin(), bodies.end(), [&](const HalfCell& b) { return b[cut.axis] < 2 * cut.at; });
    split(below, {bodies.begin(), middle}, first, lower);
    split(above, {middle, bodies.end()}, first + lower, count - lower);
  }

 private:
  struct Cut {
    int axis = 0;
    std::int32_t at = 0;
  };

  template <typename F>
  static void for_each(const Region& r, F&& f) {
    for (std::int32_t z = r.low[2]; z < r.high[2]; ++z)
      for (std::int32_t y = r.low[1]; y < r.high[1]; ++y)
        for (std::int32_t x = r.low[0]; x < r.high[0]; ++x) f(Cell{x, y, z});
  }

  // The cut that costs least: bodies on the wrong side are work that one half does while the other waits; bodies within
  // half a cell of the cut are told to the other side, and their islands are solved by both. Where that says nothing
  // (empty regions), short borders and even halves. Integers only, so that every process agrees.
  Cut best_cut(const Region& region, std::span<const HalfCell> bodies, WorldId lower, WorldId count) const {
    Cut best;
    bool found = false;
    std::tuple<bool, std::uint64_t, std::uint64_t> best_cost;
    for (int axis = 0; axis < 3; ++axis) {
      const std::int32_t length = region.high[axis] - region.low[axis];
      if (length < 2) continue;
      std::vector<std::uint64_t> slice(2 * static_cast<std::size_t>(length), 0);  // by half cell
      for (const HalfCell& b : bodies) ++slice[b[axis] - 2 * region.low[axis]];
      const std::uint64_t total = bodies.size();
      const std::size_t face = region.cells() / length;
      std::uint64_t below = 0;
      for (std::int32_t i = 1; i < length; ++i) {
        below += slice[2 * i - 2] + slice[2 * i - 1];
        // Each side must have a cell for each of its worlds.
        if (face * i < lower || face * (length - i) < count - lower) continue;
        const std::uint64_t wanted = total * lower / count;
        const std::uint64_t misplaced = wanted > below ? wanted - below : below - wanted;
        const std::uint64_t near = slice[2 * i - 1] + slice[2 * i];
        const auto uneven = static_cast<std::uint64_t>(std::abs(2 * static_cast<std::int64_t>(i) - length));
        const std::tuple cost{axis == last_axis_, 4 * misplaced + near, 10 * face + uneven};
        if (!found || cost < best_cost) best = {axis, region.low[axis] + i}, best_cost = cost, found = true;
      }
    }
    if (!found) throw std::invalid_argument("territories: fewer cells than worlds in a part of the grid");
    return best;
  }

  const Grid& grid_;
  int last_axis_;
  std::vector<WorldId>& owner_;
};

// Whatever hangs in the air at the start comes down: an upper half would soon be empty.
int axis_of_gravity(const Vec3& gravity) {
  if (gravity.isZero(0)) return -1;
  int axis = 0;
  gravity.cwiseAbs().maxCoeff(&axis);
  return axis;
}

}  // namespace

TerritoryMap bisect(const Scene& scene, const Grid& grid, WorldId worlds) {
  if (worlds == 0) throw std::invalid_argument("territories: at least one world is needed");
  if (worlds > grid.cells())
    throw std::invalid_argument("territories: " + std::to_string(worlds) + " worlds for " +
                                std::to_string(grid.cells()) + " cells; use fewer worlds or a smaller territory_cell");
  std::vector<HalfCell> bodies;
  for (const Body& body : scene.bodies)
    if (!body.is_static)
      bodies.push_back(half_cell_of(grid, body.pose.position + body.pose.orientation * body.inertial.centre));
  TerritoryMap map{grid, worlds, std::vector<WorldId>(grid.cells(), 0)};
  Bisector(grid, axis_of_gravity(scene.gravity), map.owner)
      .split({{0, 0, 0}, {grid.size[0], grid.size[1], grid.size[2]}}, bodies, 0, worlds);
  return map;
}

}  // namespace soda
