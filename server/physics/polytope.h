// Convex polyhedra: boxes, convex hulls and, as prisms without height, triangles; and where two of them touch.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "server/physics/contact_points.h"
#include "server/physics/face_clipping.h"

namespace soda::physics {

struct Polytope {
  struct Face {
    Vec3 normal;                 // unit, outwards
    std::uint32_t first, count;  // range in `corners`, in order round the face
  };
  struct Edge {
    std::uint32_t from, to;     // vertices
    std::uint32_t left, right;  // faces
  };
  std::vector<Vec3> vertices;  // m
  std::vector<Face> faces;
  std::vector<std::uint32_t> corners;
  std::vector<Edge> edges;
  Vec3 centre = Vec3::Zero();  // a point inside
};

Polytope box_polytope(const Vec3& half);
// Of the hull of points that are not in one plane; faces that lie in one plane are one.
Polytope hull_polytope(std::span<const Vec3> points);
// Replaces `out`. Faces 0 and 1 are the triangle's, face 2 + i and edges 2 i and 2 i + 1 belong to the side from corner
// i to corner i + 1.
void triangle_polytope(const std::array<Vec3, 3>& corner, const Vec3& normal, Polytope& out);

// The same in the world.
void place(const Polytope& local, const Placement& at, Polytope& out);

// The face that looks most along `direction`.
void face_along(const Polytope& polytope, const Vec3& direction, Feature& feature);
// The corner that is furthest along it.
Vec3 corner_along(const Polytope& polytope, const Vec3& direction);
void face_of(const Polytope& polytope, std::uint32_t face, Feature& feature);

// An axis along which two polytopes are apart, or overlap.
struct SeparatingAxis {
  enum Kind { kNone, kFaceOfA, kFaceOfB, kEdges } kind = kNone;
  std::uint32_t a = 0, b = 0;     // face of a, or of b, or an edge of each
  Vec3 normal = Vec3::Zero();     // unit, from a to b
  double separation = -HUGE_VAL;  // m
};
struct SeparatingAxes {
  SeparatingAxis best;  // along which they are furthest apart, or overlap least; kNone: further apart than asked for
  SeparatingAxis face;  // the best that is a face's normal
};

// `preference` (m): how much better a face of b must be than one of a, and a pair of edges than a face, so that near
// ties do not take turns.
SeparatingAxes find_axes(const Polytope& a, const Polytope& b, double max_distance, double preference);

// Where two edges are nearest to each other.
DetectedPoint nearest_on_edges(const Polytope& a, std::uint32_t edge_a, const Polytope& b, std::uint32_t edge_b,
                               const Vec3& normal);

}  // namespace soda::physics
