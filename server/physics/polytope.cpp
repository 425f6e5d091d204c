#include "server/physics/polytope.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "common/scene/convex_hull.h"

namespace soda::physics {
namespace {

constexpr double kCoplanarCosine =
    1 - 1e-9;  // triangles of a hull whose normals agree like this share a face (2.6 arc minutes)
constexpr double kFaceLike =
    0.996;  // cosine of 5 deg; edges that separate nearly along a face's normal are left to the face
constexpr double kParallel = 1e-6;  // squared sine; such edges have no useful cross product

Vec3 normal_of(const Vec3& a, const Vec3& b, const Vec3& c) { return (b - a).cross(c - a).normalized(); }

// The edges between faces whose loops run counter-clockwise seen from outside.
void find_edges(Polytope& p) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> left_of;
  for (std::uint32_t f = 0; f < p.faces.size(); ++f) {
    const Polytope::Face& face = p.faces[f];
    for (std::uint32_t i = 0; i < face.count; ++i)
      left_of[{p.corners[face.first + i], p.corners[face.first + (i + 1) % face.count]}] = f;
  }
  for (const auto& [ends, left] : left_of) {
    if (ends.first > ends.second) continue;
    const auto twin = left_of.find({ends.second, ends.first});
    if (twin != left_of.end()) p.edges.push_back({ends.first, ends.second, left, twin->second});
  }
}

double support(const Polytope& p, const Vec3& direction) {
  double least = HUGE_VAL;
  for (const Vec3& v : p.vertices) least = std::min(least, direction.dot(v));
  return least;
}

}  // namespace

Polytope box_polytope(const Vec3& half) {
  Polytope p;
  for (int i = 0; i < 8; ++i)
    p.vertices.push_back(
        Vec3(i & 1 ? half.x() : -half.x(), i & 2 ? half.y() : -half.y(), i & 4 ? half.z() : -half.z()));
  constexpr std::uint32_t kLoops[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                          {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (std::uint32_t f = 0; f < 6; ++f) {
    Vec3 normal = Vec3::Zero();
    normal[f / 2] = f % 2 ? 1 : -1;
    p.faces.push_back({normal, 4 * f, 4});
    p.corners.insert(p.corners.end(), std::begin(kLoops[f]), std::end(kLoops[f]));
  }
  find_edges(p);
  return p;
}

Polytope hull_polytope(std::span<const Vec3> points) {
  const HullMesh mesh = convex_hull(points);
  Polytope p;
  std::vector<std::uint32_t> vertex(points.size());
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t i : t) vertex[i] = 1;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (vertex[i]) vertex[i] = static_cast<std::uint32_t>(p.vertices.size()), p.vertices.push_back(points[i]);
  for (const Vec3& v : p.vertices) p.centre += v / static_cast<double>(p.vertices.size());

  // Triangles grow into faces over edges that do not bend.
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> left_of;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (int e = 0; e < 3; ++e) left_of[{mesh.triangles[t][e], mesh.triangles[t][(e + 1) % 3]}] = t;
  std::vector<Vec3> normals;
  for (const auto& t : mesh.triangles) normals.push_back(normal_of(points[t[0]], points[t[1]], points[t[2]]));
  std::vector<std::uint32_t> face(mesh.triangles.size(), 0xffffffffu);
  std::uint32_t faces = 0;
  for (std::uint32_t seed = 0; seed < face.size(); ++seed) {
    if (face[seed] != 0xffffffffu) continue;
    std::vector<std::uint32_t> members{seed};
    face[seed] = faces;
    for (std::size_t m = 0; m < members.size(); ++m)
      for (int e = 0; e < 3; ++e) {
        const auto& t = mesh.triangles[members[m]];
        const auto next = left_of.find({t[(e + 1) % 3], t[e]});
        if (next == left_of.end() || face[next->second] != 0xffffffffu) continue;
        if (normals[next->second].dot(normals[seed]) < kCoplanarCosine) continue;
        face[next->second] = faces;
        members.push_back(next->second);
      }
    // Its outline: edges whose far side is another face, put in a row.
    std::map<std::uint32_t, std::uint32_t> after;
    for (const std::uint32_t m : members)
      for (int e = 0; e < 3; ++e) {
        const auto& t = mesh.triangles[m];
        const auto next = left_of.find({t[(e + 1) % 3], t[e]});
        if (next == left_of.end() || face[next->second] != faces) after[t[e]] = t[(e + 1) % 3];
      }
    const auto first = static_cast<std::uint32_t>(p.corners.size());
    const std::uint32_t start = after.begin()->first;
    for (std::uint32_t c = start; p.corners.size() - first < after.size();) {
      p.corners.push_back(vertex[c]);
      c = after[c];
      if (c == start) break;
    }
    p.faces.push_back({normals[seed], first, static_cast<std::uint32_t>(p.corners.size()) - first});
    ++faces;
  }
  find_edges(p);
  return p;
}

void triangle_polytope(const std::array<Vec3, 3>& corner, const Vec3& normal, Polytope& out) {
  out.vertices.assign(corner.begin(), corner.end());
  out.centre = (corner[0] + corner[1] + corner[2]) / 3;
  out.corners = {0, 1, 2, 2, 1, 0, 0, 1, 1, 2, 2, 0};
  out.faces = {{normal, 0, 3}, {-normal, 3, 3}};
  out.edges.clear();
  for (std::uint32_t i = 0; i < 3; ++i) {
    const std::uint32_t j = (i + 1) % 3;
    out.faces.push_back({(corner[j] - corner[i]).cross(normal).normalized(), 6 + 2 * i, 2});
    out.edges.push_back({i, j, 0, 2 + i});
    out.edges.push_back({i, j, 2 + i, 1});
  }
}

void place(const Polytope& local, const Placement& at, Polytope& out) {
  out.vertices.resize(local.vertices.size());
  for (std::size_t i = 0; i < local.vertices.size(); ++i)
    out.vertices[i] = at.position + at.rotation * local.vertices[i];
  out.faces = local.faces;
  for (Polytope::Face& f : out.faces) f.normal = at.rotation * f.normal;
  out.corners = local.corners;
  out.edges = local.edges;
  out.centre = at.position + at.rotation * local.centre;
}

void face_of(const Polytope& p, std::uint32_t face, Feature& feature) {
  feature.normal = p.faces[face].normal;
  feature.points.clear();
  for (std::uint32_t i = 0; i < p.faces[face].count; ++i)
    feature.points.push_back(p.vertices[p.corners[p.faces[face].first + i]]);
}

void face_along(const Polytope& p, const Vec3& direction, Feature& feature) {
  constexpr double kBetter = 1e-6;
  std::uint32_t best = 0;
  double best_cosine = -2;
  for (std::uint32_t f = 0; f < p.faces.size(); ++f)
    if (const double cosine = p.faces[f].normal.dot(direction); cosine > best_cosine + kBetter)
      best = f, best_cosine = cosine;
  face_of(p, best, feature);
}

Vec3 corner_along(const Polytope& p, const Vec3& direction) {
  return *std::max_element(p.vertices.begin(), p.vertices.end(),
                           [&](const Vec3& l, const Vec3& r) { return direction.dot(l) < direction.dot(r); });
}

// Separating axes between convex polyhedra: face normals, and cross products of edges that meet on the Gauss map
// (D. Gregorius, "The Separating Axis Test between Convex Polyhedra", GDC 2013).
SeparatingAxes find_axes(const Polytope& a, const Polytope& b, double max_distance, double preference) {
  SeparatingAxis best;
  for (std::uint32_t f = 0; f < a.faces.size(); ++f) {
    const Vec3& n = a.faces[f].normal;
    const double s = support(b, n) - n.dot(a.vertices[a.corners[a.faces[f].first]]);
    if (s > max_distance) return {};
    if (s > best.separation + 1e-9) best = {SeparatingAxis::kFaceOfA, f, 0, n, s};
  }
  SeparatingAxis of_b;
  for (std::uint32_t f = 0; f < b.faces.size(); ++f) {
    const Vec3& n = b.faces[f].normal;
    const double s = support(a, n) - n.dot(b.vertices[b.corners[b.faces[f].first]]);
    if (s > max_distance) return {};
    if (s > of_b.separation + 1e-9) of_b = {SeparatingAxis::kFaceOfB, 0, f, -n, s};
  }
  if (of_b.separation > best.separation + preference) best = of_b;

  SeparatingAxis edges;
  for (std::uint32_t i = 0; i < a.edges.size(); ++i) {
    const Polytope::Edge& ea = a.edges[i];
    const Vec3 &n1 = a.faces[ea.left].normal, &n2 = a.faces[ea.right].normal;
    const Vec3 along_a = a.vertices[ea.to] - a.vertices[ea.from];
    for (std::uint32_t j = 0; j < b.edges.size(); ++j) {
      const Polytope::Edge& eb = b.edges[j];
      const Vec3 &m1 = b.faces[eb.left].normal, &m2 = b.faces[eb.right].normal;
      // The arc from n1 to n2 and that from -m1 to -m2 must cross.
      const double c = -m1.dot(along_a), d = -m2.dot(along_a);
      if (c * d >= 0) continue;
      const Vec3 along_b = b.vertices[eb.to] - b.vertices[eb.from];
      const double e = n1.dot(along_b), f = n2.dot(along_b);
      if (e * f >= 0) continue;
      Vec3 axis = along_a.cross(along_b);
      const double square = axis.squaredNorm();
      if (square < kParallel * along_a.squaredNorm() * along_b.squaredNorm()) continue;
      axis /= std::sqrt(square);
      if (axis.dot(n1 + n2) < 0) axis = -axis;
      if (axis.dot(m1 + m2) > 0) continue;  // they cross at the antipode
      const double s = axis.dot(b.vertices[eb.from] - a.vertices[ea.from]);
      if (s > max_distance) return {};
      const bool face_like = axis.dot(n1) > kFaceLike || axis.dot(n2) > kFaceLike || axis.dot(m1) < -kFaceLike ||
                             axis.dot(m2) < -kFaceLike;
      if (!face_like && s > edges.separation + 1e-9) edges = {SeparatingAxis::kEdges, i, j, axis, s};
    }
  }
  return {edges.separation > best.separation + preference ? edges : best, best};
}

DetectedPoint nearest_on_edges(const Polytope& a, std::uint32_t edge_a, const Polytope& b, std::uint32_t edge_b,
                               const Vec3& normal) {
  const Vec3 &p = a.vertices[a.edges[edge_a].from], &q = b.vertices[b.edges[edge_b].from];
  const Vec3 u = a.vertices[a.edges[edge_a].to] - p, v = b.vertices[b.edges[edge_b].to] - q, gap = q - p;
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), gu = gap.dot(u), gv = gap.dot(v);
  const double scale = 1 / (uu * vv - uv * uv);
  const double s = std::clamp((gu * vv - gv * uv) * scale, 0.0, 1.0);
  const double t = std::clamp((gu * uv - gv * uu) * scale, 0.0, 1.0);
  const Vec3 on_a = p + s * u, on_b = q + t * v;
  return {on_a, on_b, normal, normal.dot(on_b - on_a)};
}

}  // namespace soda::physics
