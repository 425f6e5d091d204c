#include "common/scene/convex_hull.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace soda {
namespace {

using Int3 = std::array<std::int64_t, 3>;

constexpr double kGrid = 1 << 20;
constexpr std::uint32_t kNone = 0xffffffffu;

Int3 operator-(const Int3& a, const Int3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

// Components are below 2^20 in size, so those of the product are at most 2^41.
Int3 cross(const Int3& a, const Int3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Of such a product with a difference of points: below 3 * 2^61, which still fits.
std::int64_t dot(const Int3& a, const Int3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

__int128 squared_length(const Int3& a) {
  return static_cast<__int128>(a[0]) * a[0] + static_cast<__int128>(a[1]) * a[1] + static_cast<__int128>(a[2]) * a[2];
}

bool same_direction(const Int3& a, const Int3& b) {
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    if (static_cast<__int128>(a[i]) * b[j] != static_cast<__int128>(a[j]) * b[i]) return false;
  }
  const __int128 along =
      static_cast<__int128>(a[0]) * b[0] + static_cast<__int128>(a[1]) * b[1] + static_cast<__int128>(a[2]) * b[2];
  return along > 0;
}

struct Face {
  std::array<std::uint32_t, 3> corner;     // counter-clockwise seen from outside
  std::array<std::uint32_t, 3> neighbour;  // neighbour[i] is across the edge corner[i], corner[i + 1]
  Int3 normal;
  std::vector<std::uint32_t> outside;  // points above the face that no earlier face has
  bool alive = true;
  std::uint32_t visited = 0;
};

class Builder {
 public:
  explicit Builder(std::span<const Vec3> points) { round(points); }

  HullMesh build() {
    HullMesh mesh;
    if (!first_tetrahedron()) return mesh;
    // Faces are only appended, so going through them once, and staying at each until nothing is outside, is enough.
    for (std::uint32_t f = 0; f < faces_.size(); ++f)
      if (faces_[f].alive && !faces_[f].outside.empty()) add_point(f, furthest(faces_[f]));
    for (const Face& face : faces_)
      if (face.alive) mesh.triangles.push_back(face.corner);
    mesh.corners = true_corners();
    return mesh;
  }

 private:
  void round(std::span<const Vec3> points) {
    if (points.empty()) return;
    Vec3 low = points[0], high = points[0];
    for (const Vec3& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
    const double extent = (high - low).maxCoeff();
    if (!(extent > 0)) return;
    for (std::size_t i = 0; i < points.size(); ++i) {
      Int3 cell;
      for (int axis = 0; axis < 3; ++axis)
        cell[axis] = static_cast<std::int64_t>(std::floor((points[i][axis] - low[axis]) / extent * kGrid + 0.5));
      at_.push_back(cell);
      points_.push_back(static_cast<std::uint32_t>(i));
    }
    // Of points that round to one place, the first counts.
    std::stable_sort(points_.begin(), points_.end(), [&](auto l, auto r) { return at_[l] < at_[r]; });
    points_.erase(std::unique(points_.begin(), points_.end(), [&](auto l, auto r) { return at_[l] == at_[r]; }),
                  points_.end());
  }

  // Positive above the face, zero in its plane.
  std::int64_t height(const Face& face, std::uint32_t point) const {
    return dot(face.normal, at_[point] - at_[face.corner[0]]);
  }

  template <class Measure>
  std::uint32_t largest(Measure measure) const {
    std::uint32_t best = kNone;
    __int128 best_value = 0;
    for (std::uint32_t p : points_) {
      const __int128 value = measure(at_[p]);
      if (value > best_value) best_value = value, best = p;
    }
    return best;
  }

  bool first_tetrahedron() {
    if (points_.size() < 4) return false;
    const std::uint32_t a = points_.front();  // the lowest coordinates in lexicographic order: a corner for certain
    const std::uint32_t b = largest([&](const Int3& p) { return squared_length(p - at_[a]); });
    const std::uint32_t c = largest([&](const Int3& p) { return squared_length(cross(at_[b] - at_[a], p - at_[a])); });
    if (c == kNone) return false;
    const Int3 normal = cross(at_[b] - at_[a], at_[c] - at_[a]);
    const std::uint32_t d =
        largest([&](const Int3& p) { return static_cast<__int128>(std::llabs(dot(normal, p - at_[a]))); });
    if (d == kNone) return false;
    std::array<std::uint32_t, 4> t{a, b, c, d};
    if (dot(normal, at_[d] - at_[a]) > 0) std::swap(t[1], t[2]);
    // Face k lies opposite of corner 3 - k; neighbours follow from which two corners an edge has.
    add_face({t[0], t[1], t[2]}, {1, 2, 3});
    add_face({t[1], t[0], t[3]}, {0, 3, 2});
    add_face({t[2], t[1], t[3]}, {0, 1, 3});
    add_face({t[0], t[2], t[3]}, {0, 2, 1});
    for (std::uint32_t p : points_) assign(p, 0);
    return true;
  }

  void add_face(const std::array<std::uint32_t, 3>& corner, const std::array<std::uint32_t, 3>& neighbour) {
    Face face;
    face.corner = corner;
    face.neighbour = neighbour;
    face.normal = cross(at_[corner[1]] - at_[corner[0]], at_[corner[2]] - at_[corner[0]]);
    faces_.push_back(std::move(face));
  }

  // Gives a point to the first face from `first` on that it is above of; one above none is inside the hull.
  void assign(std::uint32_t point, std::size_t first) {
    for (std::size_t f = first; f < faces_.size(); ++f)
      if (height(faces_[f], point) > 0) {
        faces_[f].outside.push_back(point);
        return;
      }
  }

  std::uint32_t furthest(const Face& face) const {
    std::uint32_t best = face.outside.front();
    for (std::uint32_t p : face.outside)
      if (height(face, p) > height(face, best)) best = p;
    return best;
  }

  struct Edge {
    std::uint32_t from, to, beyond;  // beyond: the face on the far side, which stays
  };

  // Replaces all faces that the point sees by a cone from their outline to the point.
  void add_point(std::uint32_t start, std::uint32_t point) {
    ++round_;
    std::vector<std::uint32_t> seen{start}, orphans;
    faces_[start].visited = round_;
    std::vector<Edge> outline;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const Face& face = faces_[seen[i]];
      for (int e = 0; e < 3; ++e) {
        const std::uint32_t next = face.neighbour[e];
        if (faces_[next].visited == round_) continue;
        if (height(faces_[next], point) > 0) {
          faces_[next].visited = round_;
          seen.push_back(next);
        }
      }
    }
    for (std::uint32_t f : seen) {
      Face& face = faces_[f];
      face.alive = false;
      for (int e = 0; e < 3; ++e)
        if (faces_[face.neighbour[e]].visited != round_)
          outline.push_back({face.corner[e], face.corner[(e + 1) % 3], face.neighbour[e]});
      for (std::uint32_t p : face.outside)
        if (p != point) orphans.push_back(p);
      std::vector<std::uint32_t>().swap(face.outside);
    }
    // The outline is one closed loop; put its edges in order, so that neighbours in the cone are neighbours in the
    // list.
    std::sort(outline.begin(), outline.end(), [](const Edge& l, const Edge& r) { return l.from < r.from; });
    std::vector<Edge> loop{outline[0]};
    while (loop.size() < outline.size())
      loop.push_back(*std::lower_bound(outline.begin(), outline.end(), loop.back().to,
                                       [](const Edge& l, std::uint32_t corner) { return l.from < corner; }));
    const std::uint32_t first = static_cast<std::uint32_t>(faces_.size()), n = static_cast<std::uint32_t>(loop.size());
    for (std::uint32_t i = 0; i < n; ++i) {
      const Edge& edge = loop[i];
      add_face({edge.from, edge.to, point}, {edge.beyond, first + (i + 1) % n, first + (i + n - 1) % n});
      Face& beyond = faces_[edge.beyond];
      for (int e = 0; e < 3; ++e)
        if (beyond.corner[e] == edge.to && beyond.corner[(e + 1) % 3] == edge.from) beyond.neighbour[e] = first + i;
    }
    for (std::uint32_t p : orphans) assign(p, first);
  }

  // A point of a convex polyhedron lies in one of its planes if it is inside a face, in two if inside an edge, in more
  // if it is a corner.
  std::vector<std::uint32_t> true_corners() const {
    std::vector<std::vector<std::uint32_t>> around(at_.size());
    for (std::uint32_t f = 0; f < faces_.size(); ++f)
      if (faces_[f].alive)
        for (std::uint32_t c : faces_[f].corner) around[c].push_back(f);
    std::vector<std::uint32_t> corners;
    for (std::uint32_t p = 0; p < around.size(); ++p) {
      std::vector<const Int3*> planes;
      for (std::uint32_t f : around[p]) {
        const Int3& normal = faces_[f].normal;
        if (std::none_of(planes.begin(), planes.end(), [&](const Int3* n) { return same_direction(*n, normal); }))
          planes.push_back(&normal);
        if (planes.size() >= 3) break;
      }
      if (planes.size() >= 3) corners.push_back(p);
    }
    return corners;
  }

  std::vector<Int3> at_;               // by point
  std::vector<std::uint32_t> points_;  // those that count
  std::vector<Face> faces_;
  std::uint32_t round_ = 0;
};

}  // namespace

HullMesh convex_hull(std::span<const Vec3> points) { return Builder(points).build(); }

std::vector<Vec3> hull_corners(std::vector<Vec3> points) {
  // Dropping points may move the corner of the bounding box, and so the rounding, by a hair: repeat until nothing
  // changes.
  for (;;) {
    const HullMesh mesh = convex_hull(points);
    if (mesh.corners.size() == points.size()) return points;
    if (mesh.corners.empty()) return {};
    std::vector<Vec3> kept;
    for (std::uint32_t corner : mesh.corners) kept.push_back(points[corner]);
    points = std::move(kept);
  }
}

}  // namespace soda
