#include "common/territory.h"

#include <algorithm>
#include <array>
#include <cmath>
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

// Something that costs, and where it is, in half cells from the grid's origin.
struct Weight {
  std::array<std::int32_t, 3> at;
  std::uint32_t cost;
};
constexpr std::uint32_t kDynamicCost = 8, kStaticCost = 1;  // of a body; of a static one in each cell that it lies in
constexpr double kLargeStatic = 64;                         // cells: what lies in more is everywhere

Weight weight_at(const Grid& grid, const Vec3& position, std::uint32_t cost) {
  const Cell cell = grid.cell_of(position);
  Weight weight{{}, cost};
  for (std::size_t axis = 0; axis < 3; ++axis)
    weight.at[axis] =
        2 * cell[axis] + (position[static_cast<Eigen::Index>(axis)] - grid.origin[static_cast<Eigen::Index>(axis)] >=
                          (cell[axis] + 0.5) * grid.edge);
  return weight;
}

// A small static body lies in the cells of the cube about it, as far as there are cells.
void add_static(const Scene& scene, const Grid& grid, const Body& body, std::vector<Weight>& weights) {
  const double radius = bounding_radius(scene, body);
  const Vec3 low = body.pose.position - Vec3::Constant(radius), high = body.pose.position + Vec3::Constant(radius);
  const Vec3 end = grid.origin + grid.edge * Vec3(grid.size[0], grid.size[1], grid.size[2]);
  const bool beside = (high.array() < grid.origin.array()).any() || (low.array() > end.array()).any();
  if (!(radius > 0) || beside || std::pow(2 * radius / grid.edge + 1, 3) > kLargeStatic) return;
  const Cell first = grid.cell_of(low), last = grid.cell_of(high);
  for (std::int32_t z = first[2]; z <= last[2]; ++z)
    for (std::int32_t y = first[1]; y <= last[1]; ++y)
      for (std::int32_t x = first[0]; x <= last[0]; ++x) weights.push_back({{2 * x, 2 * y, 2 * z}, kStaticCost});
}

class Bisector {
 public:
  // `last_axis` is cut only where no other can be; -1: all axes are alike.
  Bisector(const Grid& grid, int last_axis, std::vector<WorldId>& owner)
      : grid_(grid), last_axis_(last_axis), owner_(owner) {}

  // Gives `region`, in which `weights` are, to `count` worlds from `first` on. Reorders the weights.
  void split(const Region& region, std::span<Weight> weights, WorldId first, WorldId count) {
    if (count == 1) {
      for_each(region, [&](const Cell& c) { owner_[grid_.index(c)] = first; });
      return;
    }
    const WorldId lower = count / 2;
    const Cut cut = best_cut(region, weights, lower, count);
    Region below = region, above = region;
    below.high[cut.axis] = above.low[cut.axis] = cut.at;
    const auto axis = static_cast<std::size_t>(cut.axis);
    const auto middle =
        std::partition(weights.begin(), weights.end(), [&](const Weight& w) { return w.at[axis] < 2 * cut.at; });
    split(below, {weights.begin(), middle}, first, lower);
    split(above, {middle, weights.end()}, first + lower, count - lower);
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
  Cut best_cut(const Region& region, std::span<const Weight> weights, WorldId lower, WorldId count) const {
    Cut best;
    bool found = false;
    std::tuple<bool, std::uint64_t, std::uint64_t> best_cost;
    for (int axis = 0; axis < 3; ++axis) {
      const std::int32_t length = region.high[axis] - region.low[axis];
      if (length < 2) continue;
      std::vector<std::uint64_t> slice(2 * static_cast<std::size_t>(length), 0);  // by half cell
      std::uint64_t total = 0;
      for (const Weight& w : weights) {
        slice[static_cast<std::size_t>(w.at[static_cast<std::size_t>(axis)] - 2 * region.low[axis])] += w.cost;
        total += w.cost;
      }
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
    throw std::invalid_argument(
        "territories: " + std::to_string(worlds) + " worlds for " + std::to_string(grid.cells()) +
        " cells; use fewer worlds (--worlds), or a smaller territory_cell or max_speed in the scene (a cell is "
        "at least max_speed x dt wide)");
  std::vector<Weight> weights;
  for (const Body& body : scene.bodies) {
    if (body.is_static)
      add_static(scene, grid, body, weights);
    else
      weights.push_back(
          weight_at(grid, body.pose.position + body.pose.orientation * body.inertial.centre, kDynamicCost));
  }
  TerritoryMap map{grid, worlds, std::vector<WorldId>(grid.cells(), 0)};
  Bisector(grid, axis_of_gravity(scene.gravity), map.owner)
      .split({{0, 0, 0}, {grid.size[0], grid.size[1], grid.size[2]}}, weights, 0, worlds);
  return map;
}

TerritoryMap initial_territories(const Scene& scene, const Grid& grid, WorldId worlds) {
  if (scene.territories.empty() || worlds == 1) return bisect(scene, grid, worlds);
  WorldId given = 0;
  for (const Territory& t : scene.territories) given = std::max(given, t.world + 1);
  if (given != worlds)
    throw std::invalid_argument("territories: they are given to " + std::to_string(given) +
                                " worlds, but the session has " + std::to_string(worlds));
  TerritoryMap map{grid, worlds, std::vector<WorldId>(grid.cells(), 0)};
  std::vector<std::uint8_t> has(worlds, 0);
  for (std::int32_t z = 0; z < grid.size[2]; ++z)
    for (std::int32_t y = 0; y < grid.size[1]; ++y)
      for (std::int32_t x = 0; x < grid.size[0]; ++x) {
        const Vec3 centre = grid.origin + grid.edge * Vec3(x + 0.5, y + 0.5, z + 0.5);
        // The last region that it lies in, else the nearest.
        double least = HUGE_VAL;
        WorldId owner = 0;
        for (const Territory& t : scene.territories) {
          const double away = (centre - centre.cwiseMax(t.region.min).cwiseMin(t.region.max)).squaredNorm();
          if (away < least || away == 0) least = away, owner = t.world;
        }
        map.owner[grid.index({x, y, z})] = owner;
        has[owner] = 1;
      }
  for (WorldId w = 0; w < worlds; ++w)
    if (!has[w])
      throw std::invalid_argument("territories: world " + std::to_string(w) + " gets no cell; a cell has an edge of " +
                                  std::to_string(grid.edge) + " m");
  return map;
}

}  // namespace soda
