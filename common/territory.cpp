#include "common/territory.h"

#include <algorithm>
#include <cstdint>
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

class Bisector {
 public:
  // `last_axis` is cut only where no other can be; -1: all axes are alike.
  Bisector(const Grid& grid, const std::vector<std::uint32_t>& weight, int last_axis, std::vector<WorldId>& owner)
      : grid_(grid), weight_(weight), last_axis_(last_axis), owner_(owner) {}

  void split(const Region& region, WorldId first, WorldId count) {
    if (count == 1) {
      for_each(region, [&](const Cell& c) { owner_[grid_.index(c)] = first; });
      return;
    }
    const WorldId lower = count / 2;
    const Cut cut = best_cut(region, lower, count);
    Region below = region, above = region;
    below.high[cut.axis] = above.low[cut.axis] = cut.at;
    split(below, first, lower);
    split(above, first + lower, count - lower);
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

  // The cut that costs least: bodies on the wrong side are work that one half does while the other waits; bodies in the
  // cells along the cut are told to the other side, and their islands are solved by both. Where that says nothing (empty
  // regions), short borders and even halves. Integers only, so that every process agrees.
  Cut best_cut(const Region& region, WorldId lower, WorldId count) const {
    Cut best;
    bool found = false;
    std::tuple<bool, std::uint64_t, std::uint64_t> best_cost;
    for (int axis = 0; axis < 3; ++axis) {
      const std::int32_t length = region.high[axis] - region.low[axis];
      if (length < 2) continue;
      std::vector<std::uint64_t> slice(length, 0);
      for_each(region, [&](const Cell& c) { slice[c[axis] - region.low[axis]] += weight_[grid_.index(c)]; });
      std::uint64_t total = 0;
      for (std::uint64_t s : slice) total += s;
      const std::size_t face = region.cells() / length;
      std::uint64_t below = 0;
      for (std::int32_t i = 1; i < length; ++i) {
        below += slice[i - 1];
        // Each side must have a cell for each of its worlds.
        if (face * i < lower || face * (length - i) < count - lower) continue;
        const std::uint64_t wanted = total * lower / count;
        const std::uint64_t misplaced = wanted > below ? wanted - below : below - wanted;
        const std::uint64_t near = slice[i - 1] + slice[i];
        const auto uneven = static_cast<std::uint64_t>(std::abs(2 * static_cast<std::int64_t>(i) - length));
        const std::tuple cost{axis == last_axis_, 2 * misplaced + near, 10 * face + uneven};
        if (!found || cost < best_cost) best = {axis, region.low[axis] + i}, best_cost = cost, found = true;
      }
    }
    if (!found) throw std::invalid_argument("territories: fewer cells than worlds in a part of the grid");
    return best;
  }

  const Grid& grid_;
  const std::vector<std::uint32_t>& weight_;
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
  std::vector<std::uint32_t> weight(grid.cells(), 0);
  for (const Body& body : scene.bodies)
    if (!body.is_static)
      ++weight[grid.index(grid.cell_of(body.pose.position + body.pose.orientation * body.inertial.centre))];
  TerritoryMap map{grid, worlds, std::vector<WorldId>(grid.cells(), 0)};
  Bisector(grid, weight, axis_of_gravity(scene.gravity), map.owner).split({{0, 0, 0}, {grid.size[0], grid.size[1], grid.size[2]}}, 0, worlds);
  return map;
}

}  // namespace soda
