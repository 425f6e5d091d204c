// The territory grid: a uniform grid of cubes that covers the scene's bodies at the start. Whatever leaves it belongs
// to the nearest cell.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/math.h"
#include "common/scene/scene.h"

namespace soda {

using Cell = std::array<std::int32_t, 3>;

struct Grid {
  Vec3 origin = Vec3::Zero();                 // m, lower corner of cell (0, 0, 0)
  double edge = 1;                            // m
  std::array<std::int32_t, 3> size{1, 1, 1};  // cells along each axis

  Cell cell_of(const Vec3& position) const;  // clamped to the grid
  std::size_t index(const Cell& c) const { return (static_cast<std::size_t>(c[2]) * size[1] + c[1]) * size[0] + c[0]; }
  std::size_t cells() const { return static_cast<std::size_t>(size[0]) * size[1] * size[2]; }
};

// The grid of a scene: the cell edge that the scene names, or else one that holds the reach of all but the odd large
// body, and is at least max_speed * dt. A pure function of the scene. At most kMaxCells cells: the edge grows where the
// bodies are spread wider.
Grid make_grid(const Scene& scene);
constexpr std::size_t kMaxCells = std::size_t{1} << 22;

// Two worlds are neighbours if some of their cells are at most this many apart along each axis: the cells that a body
// may travel and reach in a step, and half a one. A constant of the session: what is spawned later may not change it.
int neighbour_range(const Scene& scene, const Grid& grid);
// The largest bounding radius, m, that a body spawned later may have.
double largest_later_radius(const Scene& scene, const Grid& grid);

// Radius of the sphere about a body's centre of mass that holds all its shapes, m.
double bounding_radius(const Scene& scene, const Body& body);
// The same, with what its joints reach for.
double reach_radius(const Scene& scene, const Body& body);

// Of the bounding radii of a scene's dynamic bodies (any order, not empty), the largest that is ordinary: at most four
// times the median. The few larger bodies are "wide": cells and blocks for their sake would be too coarse.
double largest_ordinary_radius(std::vector<double> radii);

}  // namespace soda
