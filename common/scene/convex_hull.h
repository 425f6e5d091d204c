// The convex hull of points, built with exact predicates: never fails, never depends on the order of evaluation.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/math.h"

namespace soda {

struct HullMesh {
  // Indices into the points given; counter-clockwise seen from outside. Closed. Empty when the points lie in one plane.
  // Several triangles may make up one flat face.
  std::vector<std::array<std::uint32_t, 3>> triangles;
  // The corners of the hull, ascending indices: points within a face or an edge are left out. Empty likewise.
  std::vector<std::uint32_t> corners;
};

// Quickhull (Barber, Dobkin, Huhdanpaa, "The quickhull algorithm for convex hulls", 1996) on coordinates rounded to
// 2^-20 of the largest extent, where orientations fit into 64-bit integers and are exact. So points that differ from a
// plane, or from each other, by less than a millionth of the extent count as being on it, or as one point (the first).
// The points must be finite.
HullMesh convex_hull(std::span<const Vec3> points);

// The corners alone, in their given order. Taking the hull of the result again changes nothing. Empty when the points
// lie in one plane.
std::vector<Vec3> hull_corners(std::vector<Vec3> points);

}  // namespace soda
