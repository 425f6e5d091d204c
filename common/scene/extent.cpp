#include "common/scene/extent.h"

#include <algorithm>
#include <cmath>

namespace soda {
namespace {

struct Extent {
  const Pose& pose;
  Mat3 turn = pose.orientation.toRotationMatrix();

  std::optional<Aabb> about_centre(const Vec3& half) const { return Aabb{pose.position - half, pose.position + half}; }
  std::optional<Aabb> of_points(const std::vector<Vec3>& points) const {
    Aabb box{Vec3::Constant(HUGE_VAL), Vec3::Constant(-HUGE_VAL)};
    for (const Vec3& p : points) {
      const Vec3 at = turn * p;
      box.min = box.min.cwiseMin(at);
      box.max = box.max.cwiseMax(at);
    }
    return Aabb{box.min + pose.position, box.max + pose.position};
  }

  std::optional<Aabb> operator()(const Sphere& s) const { return about_centre(Vec3::Constant(s.radius)); }
  std::optional<Aabb> operator()(const Box& b) const { return about_centre(turn.cwiseAbs() * (0.5 * b.size)); }
  std::optional<Aabb> operator()(const Capsule& c) const {
    const Vec3 axis = turn.col(2);
    return about_centre(0.5 * c.length * axis.cwiseAbs() + Vec3::Constant(c.radius));
  }
  std::optional<Aabb> operator()(const Cylinder& c) const {
    const Vec3 axis = turn.col(2);
    Vec3 half;
    for (int i = 0; i < 3; ++i)
      half[i] = 0.5 * c.length * std::abs(axis[i]) + c.radius * std::sqrt(std::max(0.0, 1 - axis[i] * axis[i]));
    return about_centre(half);
  }
  std::optional<Aabb> operator()(const ConvexHull& h) const { return of_points(h.points); }
  std::optional<Aabb> operator()(const Plane&) const { return {}; }
  std::optional<Aabb> operator()(const TriangleMesh& m) const { return of_points(m.vertices); }
  std::optional<Aabb> operator()(const HeightField& h) const {
    std::vector<Vec3> points;
    for (std::uint32_t j = 0; j < h.rows; ++j)
      for (std::uint32_t i = 0; i < h.columns; ++i)
        points.emplace_back((i - 0.5 * (h.columns - 1)) * h.spacing_x, (j - 0.5 * (h.rows - 1)) * h.spacing_y,
                            h.heights[std::size_t{j} * h.columns + i]);
    return of_points(points);
  }
};

}  // namespace

Aabb merged(const Aabb& a, const Aabb& b) { return {a.min.cwiseMin(b.min), a.max.cwiseMax(b.max)}; }

std::optional<Aabb> extent_of(const Geometry& geometry, const Pose& pose) { return std::visit(Extent{pose}, geometry); }

std::optional<Aabb> extent_of(const Scene& scene, const Body& body) {
  std::optional<Aabb> all;
  for (const Shape& shape : body.shapes)
    if (const auto box = extent_of(scene.geometries[shape.geometry], body.pose * shape.pose))
      all = all ? merged(*all, *box) : *box;
  return all;
}

}  // namespace soda
