#include "server/physics/triangle_surface.h"

#include <algorithm>
#include <map>
#include <numeric>

namespace soda::physics {
namespace {

constexpr double kFlatSine = 0.05;  // of the angle between two triangles; less bent is flat
constexpr std::uint32_t kLeafTriangles = 4;

Vec3 normal_of(const Vec3& a, const Vec3& b, const Vec3& c) { return (b - a).cross(c - a).normalized(); }

}  // namespace

TriangleSurface::TriangleSurface(const TriangleMesh& mesh) : vertices_(mesh.vertices), triangles_(mesh.triangles) {
  find_bends();
  build_tree();
}

// Each cell of the field is two triangles, divided from its right lower to its left upper corner.
TriangleSurface::TriangleSurface(const HeightField& field) : one_sided_(true) {
  for (std::uint32_t j = 0; j < field.rows; ++j)
    for (std::uint32_t i = 0; i < field.columns; ++i)
      vertices_.emplace_back((i - 0.5 * (field.columns - 1)) * field.spacing_x,
                             (j - 0.5 * (field.rows - 1)) * field.spacing_y,
                             field.heights[std::size_t{j} * field.columns + i]);
  for (std::uint32_t j = 0; j + 1 < field.rows; ++j)
    for (std::uint32_t i = 0; i + 1 < field.columns; ++i) {
      const std::uint32_t a = j * field.columns + i, b = a + 1, c = a + field.columns, d = c + 1;
      triangles_.push_back({a, b, c});
      triangles_.push_back({b, d, c});
    }
  find_bends();
  build_tree();
}

void TriangleSurface::find_bends() {
  // Meshes often repeat a vertex for each triangle: edges meet where positions do.
  std::map<std::array<double, 3>, std::uint32_t> places;
  std::vector<std::uint32_t> place(vertices_.size());
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const Vec3& v = vertices_[i];
    place[i] = places.try_emplace({v.x() + 0.0, v.y() + 0.0, v.z() + 0.0}, static_cast<std::uint32_t>(i)).first->second;
  }
  struct Side {
    std::uint64_t edge;  // both places, the lower first
    std::uint32_t triangle, which;
  };
  std::vector<Side> sides;
  for (std::uint32_t t = 0; t < triangles_.size(); ++t)
    for (std::uint32_t e = 0; e < 3; ++e) {
      const std::uint64_t p = place[triangles_[t][e]], q = place[triangles_[t][(e + 1) % 3]];
      sides.push_back({std::min(p, q) << 32 | std::max(p, q), t, e});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& l, const Side& r) {
    return l.edge != r.edge ? l.edge < r.edge : l.triangle != r.triangle ? l.triangle < r.triangle : l.which < r.which;
  });
  bends_.assign(triangles_.size(), {Bend::kOpen, Bend::kOpen, Bend::kOpen});
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i;
    while (end < sides.size() && sides[end].edge == sides[i].edge) ++end;
    if (end - i == 2) {
      const Side &s = sides[i], &o = sides[i + 1];
      const auto &t = triangles_[s.triangle], &u = triangles_[o.triangle];
      // Neighbours that are wound alike pass their edge in opposite directions.
      const bool alike = place[t[s.which]] == place[u[(o.which + 1) % 3]];
      const Vec3 n = normal_of(vertices_[t[0]], vertices_[t[1]], vertices_[t[2]]);
      const Vec3 m = (alike ? 1 : -1) * normal_of(vertices_[u[0]], vertices_[u[1]], vertices_[u[2]]);
      const Vec3 edge = (vertices_[t[(s.which + 1) % 3]] - vertices_[t[s.which]]).normalized();
      const double sine = n.cross(m).dot(edge);  // positive where the surface bends away from the front
      const Bend bend = n.dot(m) > 0 && std::abs(sine) < kFlatSine ? Bend::kFlat
                        : sine > 0                                 ? Bend::kConvex
                                                                   : Bend::kConcave;
      bends_[s.triangle][s.which] = bend;
      const Bend turned = bend == Bend::kConvex ? Bend::kConcave : bend == Bend::kConcave ? Bend::kConvex : bend;
      bends_[o.triangle][o.which] = alike ? bend : turned;
    }
    i = end;
  }
}

void TriangleSurface::build_tree() {
  std::vector<Aabb> boxes(triangles_.size());
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const auto& [a, b, c] = triangles_[t];
    boxes[t].min = vertices_[a].cwiseMin(vertices_[b]).cwiseMin(vertices_[c]);
    boxes[t].max = vertices_[a].cwiseMax(vertices_[b]).cwiseMax(vertices_[c]);
  }
  order_.resize(triangles_.size());
  std::iota(order_.begin(), order_.end(), 0u);
  nodes_.push_back({{}, 0, static_cast<std::uint32_t>(order_.size())});
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    const std::uint32_t first = nodes_[n].first, count = nodes_[n].count;
    Aabb box = boxes[order_[first]];
    for (std::uint32_t i = first; i < first + count; ++i) {
      box.min = box.min.cwiseMin(boxes[order_[i]].min);
      box.max = box.max.cwiseMax(boxes[order_[i]].max);
    }
    nodes_[n].box = box;
    if (count <= kLeafTriangles) continue;
    int axis = 0;
    (box.max - box.min).maxCoeff(&axis);
    const auto middle = [&](std::uint32_t t) { return boxes[t].min[axis] + boxes[t].max[axis]; };
    std::nth_element(
        order_.begin() + first, order_.begin() + first + count / 2, order_.begin() + first + count,
        [&](std::uint32_t l, std::uint32_t r) { return middle(l) != middle(r) ? middle(l) < middle(r) : l < r; });
    nodes_[n].first = static_cast<std::uint32_t>(nodes_.size());
    nodes_[n].count = 0;
    nodes_.push_back({{}, first, count / 2});
    nodes_.push_back({{}, first + count / 2, count - count / 2});
  }
  bounds_ = nodes_[0].box;
}

void TriangleSurface::find(const Aabb& box, std::vector<std::uint32_t>& out) const {
  out.clear();
  std::array<std::uint32_t, 96> waiting;  // the tree halves: its depth is below 32
  std::size_t left = 0;
  waiting[left++] = 0;
  while (left > 0) {
    const Node& node = nodes_[waiting[--left]];
    if (!node.box.overlaps(box)) continue;
    if (node.count == 0) {
      waiting[left++] = node.first;
      waiting[left++] = node.first + 1;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const auto& [a, b, c] = triangles_[order_[i]];
      const Aabb own{vertices_[a].cwiseMin(vertices_[b]).cwiseMin(vertices_[c]),
                     vertices_[a].cwiseMax(vertices_[b]).cwiseMax(vertices_[c])};
      if (own.overlaps(box)) out.push_back(order_[i]);
    }
  }
  std::sort(out.begin(), out.end());
}

Triangle TriangleSurface::triangle(std::uint32_t index) const {
  const auto& [a, b, c] = triangles_[index];
  return {{vertices_[a], vertices_[b], vertices_[c]}, bends_[index]};
}

}  // namespace soda::physics
