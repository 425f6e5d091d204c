#include "common/grid.h"

#include <algorithm>
#include <cmath>

namespace soda {
namespace {

constexpr double kMaxRadius = 1e7;  // m, of anything: as far as coordinates go

double geometry_radius(const Geometry& geometry, const Pose& pose, const Vec3& centre) {
  struct Visitor {
    Pose pose;
    Vec3 centre;
    double far(const Vec3& local) const { return (pose.position + pose.orientation * local - centre).norm(); }
    double operator()(const Sphere& s) const { return far(Vec3::Zero()) + s.radius; }
    double operator()(const Box& b) const {
      double r = 0;
      for (int i = 0; i < 8; ++i)
        r = std::max(r, far(0.5 * Vec3(i & 1 ? b.size.x() : -b.size.x(), i & 2 ? b.size.y() : -b.size.y(),
                                       i & 4 ? b.size.z() : -b.size.z())));
      return r;
    }
    double operator()(const Capsule& c) const {
      return std::max(far(Vec3(0, 0, 0.5 * c.length)), far(Vec3(0, 0, -0.5 * c.length))) + c.radius;
    }
    double operator()(const Cylinder& c) const {
      return far(Vec3::Zero()) + std::sqrt(c.radius * c.radius + 0.25 * c.length * c.length);
    }
    double operator()(const ConvexHull& h) const {
      double r = 0;
      for (const Vec3& p : h.points) r = std::max(r, far(p));
      return r;
    }
    double operator()(const Plane&) const { return 0; }  // static only, as are the two below
    double operator()(const TriangleMesh&) const { return 0; }
    double operator()(const HeightField&) const { return 0; }
  };
  return std::visit(Visitor{pose, centre}, geometry);
}

}  // namespace

double bounding_radius(const Scene& scene, const Body& body) {
  double radius = 0;
  for (const Shape& shape : body.shapes)
    radius = std::max(radius, geometry_radius(scene.geometries[shape.geometry], shape.pose, body.inertial.centre));
  return radius;
}

double reach_radius(const Scene& scene, const Body& body) {
  return std::max(bounding_radius(scene, body), body.joint_reach);
}

double largest_ordinary_radius(std::vector<double> radii) {
  constexpr double kWideRatio = 4;
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  const double usual = *middle;
  double largest = usual;
  for (double r : radii)
    if (r <= kWideRatio * usual) largest = std::max(largest, r);
  return largest;
}

Cell Grid::cell_of(const Vec3& position) const {
  Cell c;
  for (int axis = 0; axis < 3; ++axis) {
    const double f = (position[axis] - origin[axis]) / edge;
    // Not `f < 0` alone: a NaN must end in a cell, too.
    c[axis] = !(f > 0) ? 0 : f >= size[axis] ? size[axis] - 1 : static_cast<std::int32_t>(f);
  }
  return c;
}

Grid make_grid(const Scene& scene) {
  std::vector<double> radii;
  Vec3 low = Vec3::Constant(1e300), high = Vec3::Constant(-1e300);
  for (const Body& body : scene.bodies) {
    if (body.is_static) continue;
    radii.push_back(reach_radius(scene, body));
    const Vec3 centre = body.pose.position + body.pose.orientation * body.inertial.centre;
    low = low.cwiseMin(centre);
    high = high.cwiseMax(centre);
  }
  Grid grid;
  if (radii.empty()) return grid;
  double edge = scene.territory_cell;
  if (edge == 0) {
    // An ordinary body's reach box (its bounding box, swept over a step, with the contact margin) fits into a cell.
    constexpr double kReachMargin = 1.25, kContactMargin = 0.05;
    edge = 2 * (kReachMargin * largest_ordinary_radius(radii) + kContactMargin);
  }
  edge = std::max(edge, scene.max_speed * scene.dt);
  const Vec3 extent = high - low;
  for (;;) {
    double cells = 1;
    for (int axis = 0; axis < 3; ++axis) cells *= std::floor(extent[axis] / edge) + 1;
    if (cells <= static_cast<double>(kMaxCells)) break;
    edge *= 1.25;
  }
  grid.edge = edge;
  for (int axis = 0; axis < 3; ++axis) {
    grid.size[axis] = static_cast<std::int32_t>(std::floor(extent[axis] / edge)) + 1;
    // The bodies lie in the middle of the grid.
    grid.origin[axis] = low[axis] - 0.5 * (grid.size[axis] * edge - extent[axis]);
  }
  return grid;
}

namespace {

// A body's reach box reaches twice its radius at most (it may turn), and what it travels, and a margin: at least
// physics::kContactMargin.
constexpr double kMargin = 0.05;  // m

}  // namespace

int neighbour_range(const Scene& scene, const Grid& grid) {
  double radius = 0;
  for (const Body& body : scene.bodies)
    if (!body.is_static) radius = std::max(radius, reach_radius(scene, body));
  const double reach = 2 * radius + scene.max_speed * scene.dt + kMargin;
  const double most = std::max({grid.size[0], grid.size[1], grid.size[2]}) + 2.0;
  return std::max(2, static_cast<int>(std::ceil(std::min(reach / grid.edge, most) + 0.5)) + 1);
}

double largest_later_radius(const Scene& scene, const Grid& grid) {
  if (grid.cells() == 1) return kMaxRadius;  // one world, whatever there is
  const double reach = (neighbour_range(scene, grid) - 1.5) * grid.edge;
  // A little less, so that rounding cannot matter.
  return std::min(kMaxRadius, 0.5 * (1 - 1e-9) * (reach - scene.max_speed * scene.dt - kMargin));
}

}  // namespace soda
