// Static surfaces of triangles: meshes and height fields. Finds the triangles near a box, and knows of each edge how
// the surface bends there, so that bodies slide over the seams between triangles without catching on them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/math.h"
#include "common/scene/scene.h"

namespace soda::physics {

enum class Bend : std::uint8_t {
  kFlat,    // hardly bent: no edge to catch on
  kConvex,  // seen from the front, where the corners run counter-clockwise
  kConcave,
  kOpen,  // no other triangle, or several
};

struct Triangle {
  std::array<Vec3, 3> corner;  // m, in the surface's frame
  std::array<Bend, 3> bend;    // of the edges corner[i] to corner[i + 1]
};

class TriangleSurface {
 public:
  explicit TriangleSurface(const TriangleMesh& mesh);
  explicit TriangleSurface(const HeightField& field);

  const Aabb& bounds() const { return bounds_; }
  // Meshes are sheets with two sides; below a height field everything is solid.
  bool one_sided() const { return one_sided_; }
  // The triangles whose bounding boxes overlap the box (which may be infinite), ascending by index. Thread-safe.
  void find(const Aabb& box, std::vector<std::uint32_t>& out) const;
  Triangle triangle(std::uint32_t index) const;

 private:
  struct Node {  // of a tree of bounding boxes
    Aabb box;
    std::uint32_t first, count;  // leaf: range of order_; else count is 0 and the children are at first and first + 1
  };
  void find_bends();
  void build_tree();

  std::vector<Vec3> vertices_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::vector<std::array<Bend, 3>> bends_;
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> order_;
  Aabb bounds_;
  bool one_sided_ = false;
};

}  // namespace soda::physics
