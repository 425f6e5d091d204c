#include "common/territory.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

namespace soda {
namespace {

struct Region {
  Cell low, high;        // cells low .. high - 1 along each axis
  unsigned borders = 0;  // bit 2 * axis: at `low` another world's cells begin; bit 2 * axis + 1: likewise at `high`
};

// Something that costs, and where it is, in half cells from the grid's origin.
struct Weight {
  std::array<std::int32_t, 3> at;
  std::uint32_t cost;
};
constexpr std::uint32_t kDynamicCost = 8, kStaticCost = 1;  // of a body; of a static one in each cell that it lies in
// What a body costs the world on the other side of a border, which hears of it, over what it costs its own, in eighths:
// in the half cell at the border, and in the next, from which only larger ones reach so far.
constexpr std::uint32_t kHeard = 3, kHeardOfSome = 1;
// By where it is along the axis across a border at cell `at`, in half cells: what those below it hear of it, and those
// above it. In eighths of its cost.
constexpr std::uint32_t heard_below(std::int32_t where, std::int32_t at) {
  return where == 2 * at ? kHeard : where == 2 * at + 1 ? kHeardOfSome : 0;
}
constexpr std::uint32_t heard_above(std::int32_t where, std::int32_t at) {
  return where == 2 * at - 1 ? kHeard : where == 2 * at - 2 ? kHeardOfSome : 0;
}
constexpr double kMostBorderShare = 0.125;  // of a world's own work: what one side of its territory may count
constexpr double kLargeStatic = 64;         // cells: what lies in more is everywhere

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
  // `last_axis` is cut only where no other can be; -1: all axes are alike. `owner`: all 0. `straight`: territories are
  // boxes of cells. `border`: the cost of a side of a territory behind which somebody is.
  Bisector(const Grid& grid, int last_axis, bool straight, double border, std::vector<WorldId>& owner)
      : grid_(grid), last_axis_(last_axis), straight_(straight), border_(border), owner_(owner) {}

  // Gives world `first`'s cells, which are in `region` with `weights`, to `count` worlds from it on. False: it has cut
  // itself off from a way to give each world a cell.
  bool split(const Region& region, std::span<const Weight> weights, WorldId first, WorldId count) {
    if (count == 1) return true;
    const WorldId lower = count / 2, second = first + lower;
    const std::optional<Cut> found = best_cut(region, weights, first, lower, count);
    if (!found) return false;
    const Cut& cut = *found;
    Region below = region, above = region;
    below.high[cut.axis] = above.low[cut.axis] = cut.at;
    below.borders |= 2u << 2 * cut.axis, above.borders |= 1u << 2 * cut.axis;
    for_each(above, [&](const Cell& c) {
      if (owner(c) == first) owner(c) = second;
    });
    if (!straight_) even_out(cut, weights, {first, lower}, {second, count - lower}, below, above);
    std::vector<Weight> below_weights, above_weights;
    const auto axis = static_cast<std::size_t>(cut.axis);
    for (const Weight& w : weights) {
      const WorldId here = owner(cell_of(w));
      (here == first ? below_weights : above_weights).push_back(w);
      if (border_ == 0) continue;
      for (const int way : {-1, 1}) {
        Cell next = cell_of(w);
        next[axis] += way;
        if (next[axis] < region.low[axis] || next[axis] >= region.high[axis]) continue;
        const WorldId there = owner(next);
        if (there == here || (there != first && there != second)) continue;
        Weight heard = w;
        heard.at[axis] = 2 * next[axis] + (way < 0);
        heard.cost =
            w.cost * (way < 0 ? heard_below(w.at[axis], next[axis] + 1) : heard_above(w.at[axis], next[axis])) / 8;
        if (heard.cost > 0) (there == first ? below_weights : above_weights).push_back(heard);
      }
    }
    return split(below, below_weights, first, lower) && split(above, above_weights, second, count - lower);
  }

  // Whether each world has cells, in one piece by faces.
  bool all_connected(WorldId worlds) const {
    std::vector<std::uint8_t> seen(owner_.size(), 0), begun(worlds, 0);
    std::vector<Cell> todo;
    bool connected = true;
    for_each({{0, 0, 0}, grid_.size, 0}, [&](const Cell& start) {
      if (seen[grid_.index(start)]) return;
      connected = connected && !std::exchange(begun[owner(start)], 1);
      todo.push_back(start);
      seen[grid_.index(start)] = 1;
      while (!todo.empty()) {
        const Cell c = todo.back();
        todo.pop_back();
        for (std::size_t axis = 0; axis < 3; ++axis)
          for (const int way : {-1, 1}) {
            Cell next = c;
            next[axis] += way;
            if (next[axis] < 0 || next[axis] >= grid_.size[axis] || owner(next) != owner(c)) continue;
            if (!std::exchange(seen[grid_.index(next)], 1)) todo.push_back(next);
          }
      }
    });
    return connected && std::count(begun.begin(), begun.end(), 0) == 0;
  }

 private:
  struct Cut {
    int axis = 0;
    std::int32_t at = 0;
    std::int64_t misplaced = 0;              // of the work below it, so much is too much
    std::size_t cells_below = 0, cells = 0;  // of the region's
  };
  struct Side {
    WorldId first, worlds;
  };

  template <typename F>
  static void for_each(const Region& r, F&& f) {
    for (std::int32_t z = r.low[2]; z < r.high[2]; ++z)
      for (std::int32_t y = r.low[1]; y < r.high[1]; ++y)
        for (std::int32_t x = r.low[0]; x < r.high[0]; ++x) f(Cell{x, y, z});
  }
  static Cell cell_of(const Weight& w) { return {w.at[0] >> 1, w.at[1] >> 1, w.at[2] >> 1}; }
  WorldId& owner(const Cell& c) { return owner_[grid_.index(c)]; }
  const WorldId& owner(const Cell& c) const { return owner_[grid_.index(c)]; }

  // How much work the part below a cut across `axis` should have, so that all worlds have as much to do with that and
  // their borders. Some square root of a part's worlds lie along one of its sides.
  std::int64_t wanted_below(const Region& region, int axis, std::uint64_t total, WorldId lower, WorldId count) const {
    const double mean = static_cast<double>(total) / count;
    const double border = std::min(border_, kMostBorderShare * mean);
    const auto at_borders = [&](unsigned borders, WorldId worlds) {
      return border * std::popcount(borders) * std::sqrt(static_cast<double>(worlds));
    };
    const double below = at_borders(region.borders | 2u << 2 * axis, lower),
                 above = at_borders(region.borders | 1u << 2 * axis, count - lower);
    return std::llround((static_cast<double>(total) + below + above) * lower / count - below);
  }

  // The cut that costs least: bodies on the wrong side are work that one half does while the other waits; bodies within
  // half a cell of the cut are told to the other side, and their islands are solved by both. Where that says nothing
  // (empty regions), short borders and even halves. Every process must come to the same: integers, and roots, which
  // IEEE 754 rounds in one way.
  std::optional<Cut> best_cut(const Region& region, std::span<const Weight> weights, WorldId first, WorldId lower,
                              WorldId count) const {
    std::array<std::vector<std::size_t>, 3> cells;  // by slice
    std::size_t all_cells = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) cells[axis].assign(region.high[axis] - region.low[axis], 0);
    for_each(region, [&](const Cell& c) {
      if (owner(c) != first) return;
      ++all_cells;
      for (std::size_t axis = 0; axis < 3; ++axis) ++cells[axis][c[axis] - region.low[axis]];
    });
    std::optional<Cut> best;
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
      const std::size_t face = all_cells / length;
      std::uint64_t below = 0;
      std::size_t cells_below = 0;
      for (std::int32_t i = 1; i < length; ++i) {
        below += slice[2 * i - 2] + slice[2 * i - 1];
        cells_below += cells[axis][i - 1];
        // Each side must have a cell for each of its worlds.
        if (cells_below < lower || all_cells - cells_below < count - lower) continue;
        const std::uint64_t heard_low =
                                border_ == 0 ? 0 : (kHeard * slice[2 * i] + kHeardOfSome * slice[2 * i + 1]) / 8,
                            heard_high =
                                border_ == 0 ? 0 : (kHeard * slice[2 * i - 1] + kHeardOfSome * slice[2 * i - 2]) / 8;
        const std::int64_t misplaced = static_cast<std::int64_t>(below + heard_low) -
                                       wanted_below(region, axis, total + heard_low + heard_high, lower, count);
        const std::uint64_t near = slice[2 * i - 1] + slice[2 * i];
        const auto uneven = static_cast<std::uint64_t>(std::abs(2 * static_cast<std::int64_t>(i) - length));
        const std::tuple cost{axis == last_axis_, 4 * static_cast<std::uint64_t>(std::abs(misplaced)) + near,
                              10 * face + uneven};
        if (best && cost >= best_cost) continue;
        best = {axis, region.low[axis] + i, misplaced, cells_below, all_cells};
        best_cost = cost;
      }
    }
    return best;
  }

  // Cells are coarse: of the slice at the cut on the side that has too much, some rows, from one end on, go to the
  // other side, if that is worth the longer border.
  void even_out(const Cut& cut, std::span<const Weight> weights, const Side& low, const Side& high, Region& below,
                Region& above) {
    const bool down = cut.misplaced > 0;  // the lower side gives
    const Side &giver = down ? low : high, &taker = down ? high : low;
    const auto axis = static_cast<std::size_t>(cut.axis);
    const std::int32_t slice = down ? cut.at - 1 : cut.at;
    std::size_t along = axis == 0 ? 1 : 0;  // the axis by which rows are counted: upright stay together what is
    const Region& region = down ? below : above;
    for (std::size_t a = 0; a < 3; ++a)
      if (a != axis && static_cast<int>(a) != last_axis_ &&
          (static_cast<int>(along) == last_axis_ ||
           region.high[a] - region.low[a] > region.high[along] - region.low[along]))
        along = a;
    if (region.high[axis] - region.low[axis] < 2) return;

    // By row: what there is in the slice; near the cut, and near where it would be if the row went over.
    struct Row {
      std::size_t cells = 0;
      std::int64_t work = 0, near_here = 0, near_there = 0;
      std::int64_t more_heard_low = 0, more_heard_high = 0;  // by each side if the row goes over, in eighths
      std::int64_t near_begin = 0, near_end = 0;             // in the slice, near the row's two ends
    };
    const auto count = static_cast<std::size_t>(region.high[along] - region.low[along]);
    std::vector<Row> rows(count);
    const std::int32_t there = down ? slice : slice + 1;
    for (const Weight& w : weights) {
      const std::int32_t at = cell_of(w)[along] - region.low[along];
      if (at < 0 || at >= static_cast<std::int32_t>(count)) continue;
      Row& row = rows[static_cast<std::size_t>(at)];
      const auto is_near = [&](std::int32_t cut_at) {
        return w.at[axis] == 2 * cut_at - 1 || w.at[axis] == 2 * cut_at;
      };
      if (is_near(cut.at)) row.near_here += w.cost;
      if (is_near(there)) row.near_there += w.cost;
      if (border_ > 0) {
        const auto change = [&](std::uint32_t (*heard)(std::int32_t, std::int32_t)) {
          return static_cast<std::int64_t>(w.cost) *
                 (static_cast<int>(heard(w.at[axis], there)) - static_cast<int>(heard(w.at[axis], cut.at)));
        };
        row.more_heard_low += change(heard_below);
        row.more_heard_high += change(heard_above);
      }
      if (cell_of(w)[axis] != slice || owner(cell_of(w)) != giver.first) continue;
      row.work += w.cost;
      (w.at[along] % 2 == 0 ? row.near_begin : row.near_end) += w.cost;
    }
    Region moved = region;
    moved.low[axis] = slice, moved.high[axis] = slice + 1;
    for_each(moved, [&](const Cell& c) {
      if (owner(c) == giver.first) ++rows[static_cast<std::size_t>(c[along] - region.low[along])].cells;
    });
    const std::size_t may_go = (down ? cut.cells_below : cut.cells - cut.cells_below) - giver.worlds;
    std::int64_t near_straight = 0;
    for (const Row& row : rows) near_straight += row.near_here;
    std::int64_t best = 4 * std::abs(cut.misplaced) + near_straight;
    std::size_t most = 0;
    bool from_end = false;
    for (const bool backwards : {false, true}) {
      std::int64_t work = 0, more_heard = 0, near = near_straight;  // gone below
      std::size_t cells = 0;
      for (std::size_t n = 1; n < count; ++n) {
        const Row &row = rows[backwards ? count - n : n - 1], &next = rows[backwards ? count - n - 1 : n];
        cells += row.cells;
        if (cells > may_go) break;
        work += down ? -row.work : row.work;
        more_heard += row.more_heard_low * high.worlds - row.more_heard_high * low.worlds;
        const std::int64_t misplaced = cut.misplaced + work + more_heard / (8 * std::int64_t{low.worlds + high.worlds});
        near += row.near_there - row.near_here;
        const std::int64_t end = backwards ? row.near_begin + next.near_end : row.near_end + next.near_begin;
        if (4 * std::abs(misplaced) + near + end < best)
          best = 4 * std::abs(misplaced) + near + end, most = n, from_end = backwards;
      }
    }
    if (most == 0) return;
    if (from_end)
      moved.low[along] = region.high[along] - static_cast<std::int32_t>(most);
    else
      moved.high[along] = region.low[along] + static_cast<std::int32_t>(most);
    for_each(moved, [&](const Cell& c) {
      if (owner(c) == giver.first) owner(c) = taker.first;
    });
    (down ? above.low : below.high)[axis] = down ? slice : slice + 1;
  }

  const Grid& grid_;
  int last_axis_;
  bool straight_;
  double border_;
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

TerritoryMap bisect(const Scene& scene, const Grid& grid, WorldId worlds, double border_bodies) {
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
  // Where cells are few, only the simplest cuts may leave some for everybody, and in one piece.
  struct Way {
    bool straight;
    double border_bodies;
  };
  for (const Way& way : {Way{false, border_bodies}, Way{true, border_bodies}, Way{true, 0}}) {
    TerritoryMap map{grid, worlds, std::vector<WorldId>(grid.cells(), 0)};
    Bisector bisector(grid, axis_of_gravity(scene.gravity), way.straight, way.border_bodies * kDynamicCost, map.owner);
    if (bisector.split({{0, 0, 0}, grid.size, 0}, weights, 0, worlds) && bisector.all_connected(worlds)) return map;
  }
  throw std::invalid_argument(
      "territories: fewer cells than worlds in a part of the grid; use fewer worlds (--worlds)");
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
