#include "common/scene/tessellation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/scene/convex_hull.h"
#include "common/scene/generator_parts.h"
#include "common/scene/proto_geometry.h"

namespace soda {
namespace {

// Adds shapes at their places to a mesh. In double until the end, so that what is one point stays one point.
class Tessellator {
 public:
  Tessellator(const TessellationOptions& options, const Pose& pose, DisplayMesh& mesh)
      : plane_edge_(options.plane_edge),
        segments_(std::max(2u, (options.segments + 3) / 4) * 4),
        turn_(pose.orientation.toRotationMatrix()),
        position_(pose.position),
        mesh_(mesh) {}

  void operator()(const Sphere& s) {
    std::vector<Ring> profile;
    add_half_ball(profile, s.radius, 0, -1);
    profile.pop_back();  // the upper half has the equator, too
    add_half_ball(profile, s.radius, 0, 1);
    revolve(profile);
  }
  void operator()(const Capsule& c) {
    std::vector<Ring> profile;
    add_half_ball(profile, c.radius, -0.5 * c.length, -1);
    add_half_ball(profile, c.radius, 0.5 * c.length, 1);
    revolve(profile);
  }
  void operator()(const Cylinder& c) {
    const double h = 0.5 * c.length;
    revolve({{0, -h, 0, -1}, {c.radius, -h, 0, -1}});
    revolve({{c.radius, -h, 1, 0}, {c.radius, h, 1, 0}});
    revolve({{c.radius, h, 0, 1}, {0, h, 0, 1}});
  }
  void operator()(const Box& b) {
    const Vec3 half = 0.5 * b.size;
    for (int axis = 0; axis < 3; ++axis)
      for (const double side : {-1.0, 1.0}) {
        Vec3 normal = Vec3::Zero(), u = Vec3::Zero(), v = Vec3::Zero();  // u, v, normal: right-handed
        normal[axis] = side;
        u[(axis + 1) % 3] = side * half[(axis + 1) % 3];
        v[(axis + 2) % 3] = half[(axis + 2) % 3];
        square(half[axis] * normal, u, v, normal);
      }
  }
  void operator()(const ConvexHull& h) {
    for (const auto& t : convex_hull(h.points).triangles) flat(h.points[t[0]], h.points[t[1]], h.points[t[2]]);
  }
  void operator()(const Plane& p) {
    mesh_.two_sided = true;
    const Mat3 axes = Quat::FromTwoVectors(Vec3::UnitZ(), p.normal).toRotationMatrix();
    square(Vec3::Zero(), 0.5 * plane_edge_ * axes.col(0), 0.5 * plane_edge_ * axes.col(1), p.normal);
  }
  void operator()(const TriangleMesh& m) {
    mesh_.two_sided = true;
    for (const auto& t : m.triangles) flat(m.vertices[t[0]], m.vertices[t[1]], m.vertices[t[2]]);
  }
  // Smooth: ground. The cells are divided as the simulation divides them (server/physics/triangle_surface.cpp).
  void operator()(const HeightField& f) {
    mesh_.two_sided = true;
    std::vector<Vec3> points, normals(std::size_t{f.columns} * f.rows, Vec3::Zero());
    for (std::uint32_t j = 0; j < f.rows; ++j)
      for (std::uint32_t i = 0; i < f.columns; ++i)
        points.emplace_back((i - 0.5 * (f.columns - 1)) * f.spacing_x, (j - 0.5 * (f.rows - 1)) * f.spacing_y,
                            f.heights[std::size_t{j} * f.columns + i]);
    const auto first = static_cast<std::uint32_t>(mesh_.vertices());
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      const Vec3 normal = (points[b] - points[a]).cross(points[c] - points[a]);  // long as the triangle is large
      for (const std::uint32_t corner : {a, b, c}) normals[corner] += normal;
      triangle(first + a, first + b, first + c);
    };
    for (std::uint32_t j = 0; j + 1 < f.rows; ++j)
      for (std::uint32_t i = 0; i + 1 < f.columns; ++i) {
        const std::uint32_t a = j * f.columns + i, b = a + 1, c = a + f.columns, d = c + 1;
        add(a, b, c);
        add(b, d, c);
      }
    for (std::size_t p = 0; p < points.size(); ++p) vertex(points[p], normals[p].normalized());
  }

 private:
  struct Ring {            // a circle about z; of radius 0, one point of it
    double radius, z;      // m
    double across, along;  // the normal's components away from the axis and along it
  };

  std::uint32_t vertex(const Vec3& position, const Vec3& normal) {
    const auto index = static_cast<std::uint32_t>(mesh_.vertices());
    const Vec3 at = turn_ * position + position_, n = turn_ * normal;
    for (int i = 0; i < 3; ++i) mesh_.positions.push_back(static_cast<float>(at[i]));
    for (int i = 0; i < 3; ++i) mesh_.normals.push_back(static_cast<float>(n[i]));
    return index;
  }
  void triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    mesh_.indices.insert(mesh_.indices.end(), {a, b, c});
  }

  void flat(const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 across = (b - a).cross(c - a);
    const double length = across.stableNorm();
    if (!(length > 0)) return;
    const std::uint32_t first = vertex(a, across / length);
    vertex(b, across / length);
    vertex(c, across / length);
    triangle(first, first + 1, first + 2);
  }

  // With half edges u and v.
  void square(const Vec3& middle, const Vec3& u, const Vec3& v, const Vec3& normal) {
    const std::uint32_t first = vertex(middle - u - v, normal);
    vertex(middle + u - v, normal);
    vertex(middle + u + v, normal);
    vertex(middle - u + v, normal);
    triangle(first, first + 1, first + 2);
    triangle(first, first + 2, first + 3);
  }

  // The rings of half a ball about (0, 0, z), from below to above; side: -1 the lower, 1 the upper half.
  void add_half_ball(std::vector<Ring>& profile, double radius, double z, int side) const {
    const auto n = static_cast<int>(segments_ / 4);
    for (int i = 0; i <= n; ++i) {
      const int latitude = side < 0 ? i - n : i;  // -n .. n, quarters of a circle
      const double angle = std::numbers::pi / 2 * latitude / n;
      const bool pole = latitude == n || latitude == -n;
      const double across = pole ? 0 : std::cos(angle), along = std::sin(angle);
      profile.push_back({across * radius, z + along * radius, across, along});
    }
  }

  // The surface between rings that follow each other, each above or inside the one before.
  void revolve(const std::vector<Ring>& profile) {
    std::uint32_t below = 0;
    for (std::size_t r = 0; r < profile.size(); ++r) {
      const Ring& ring = profile[r];
      const std::uint32_t n = ring.radius > 0 ? segments_ : 1;
      const auto first = static_cast<std::uint32_t>(mesh_.vertices());
      for (std::uint32_t j = 0; j < n; ++j) {
        const double angle = 2 * std::numbers::pi * j / segments_;
        const double x = std::cos(angle), y = std::sin(angle);
        vertex(Vec3(ring.radius * x, ring.radius * y, ring.z), Vec3(ring.across * x, ring.across * y, ring.along));
      }
      const std::uint32_t n_below = r > 0 && profile[r - 1].radius > 0 ? segments_ : 1;
      for (std::uint32_t j = 0; r > 0 && j < segments_; ++j) {
        const std::uint32_t a = below + j % n_below, b = below + (j + 1) % n_below;
        const std::uint32_t c = first + (j + 1) % n, d = first + j % n;
        if (a != b) triangle(a, b, c);
        if (c != d) triangle(a, c, d);
      }
      below = first;
    }
  }

  double plane_edge_;
  std::uint32_t segments_;
  Mat3 turn_;
  Vec3 position_;
  DisplayMesh& mesh_;
};

// Of a shape, from the body's centre of mass.
Pose centred(const Body& body, const Shape& shape) {
  return {shape.pose.position - body.inertial.centre, shape.pose.orientation};
}

}  // namespace

DisplayMesh tessellate(const Geometry& geometry, const TessellationOptions& options) {
  DisplayMesh mesh;
  std::visit(Tessellator(options, Pose{}, mesh), geometry);
  return mesh;
}

DisplayMesh tessellate(const Scene& scene, const Body& body, const TessellationOptions& options) {
  DisplayMesh mesh;
  for (const Shape& shape : body.shapes)
    std::visit(Tessellator(options, centred(body, shape), mesh), scene.geometries[shape.geometry]);
  return mesh;
}

std::uint32_t DisplayMeshTable::index_of(const Scene& scene, const Body& body) {
  std::string key;
  for (const Shape& shape : body.shapes) {
    pb::Geometry geometry;
    write_geometry(scene.geometries[shape.geometry], &geometry);
    const Pose pose = centred(body, shape);
    key += std::to_string(geometry.ByteSizeLong()) + ':' + geometry.SerializeAsString();
    key.append(reinterpret_cast<const char*>(pose.position.data()), sizeof(Vec3));
    key.append(reinterpret_cast<const char*>(pose.orientation.coeffs().data()), 4 * sizeof(double));
  }
  const auto [entry, is_new] = index_.emplace(std::move(key), static_cast<std::uint32_t>(meshes_.size()));
  if (is_new) meshes_.push_back(tessellate(scene, body, options_));
  return entry->second;
}

Pose display_pose(const Body& body) {
  return {body.pose.position + body.pose.orientation * body.inertial.centre, body.pose.orientation};
}

std::uint32_t display_colour(const Body& body) {
  return body.is_static || body.colour != Body{}.colour ? body.colour
                                                        : generator::colour(static_cast<std::uint32_t>(body.id));
}

}  // namespace soda
