#include "common/scene/mass_properties.h"

#include <Eigen/Eigenvalues>
#include <numbers>
#include <stdexcept>

#include "common/scene/convex_hull.h"

namespace soda {
namespace {

constexpr double kPi = std::numbers::pi;

Inertial diagonal(double mass, double xx, double yy, double zz) {
  Inertial i;
  i.mass = mass;
  i.inertia = Vec3(xx, yy, zz).asDiagonal();
  return i;
}

struct Solid {
  double density;

  Inertial operator()(const Sphere& s) const {
    const double m = density * (4.0 / 3.0) * kPi * s.radius * s.radius * s.radius;
    const double i = 0.4 * m * s.radius * s.radius;
    return diagonal(m, i, i, i);
  }
  Inertial operator()(const Box& b) const {
    const double m = density * b.size.x() * b.size.y() * b.size.z(), k = m / 12;
    const double xx = b.size.x() * b.size.x(), yy = b.size.y() * b.size.y(), zz = b.size.z() * b.size.z();
    return diagonal(m, k * (yy + zz), k * (xx + zz), k * (xx + yy));
  }
  Inertial operator()(const Cylinder& c) const {
    const double rr = c.radius * c.radius;
    const double m = density * kPi * rr * c.length;
    const double across = m * (0.25 * rr + c.length * c.length / 12);
    return diagonal(m, across, across, 0.5 * m * rr);
  }
  Inertial operator()(const Capsule& c) const {
    const double r = c.radius, rr = r * r, h = c.length;
    const double cylinder = density * kPi * rr * h;
    const double ball = density * (4.0 / 3.0) * kPi * rr * r;  // the two half balls together
    // A half ball's centre of mass is 3/8 r above its flat side.
    const double across = cylinder * (0.25 * rr + h * h / 12) + ball * (0.4 * rr + 0.25 * h * h + 0.375 * r * h);
    return diagonal(cylinder + ball, across, across, 0.5 * cylinder * rr + 0.4 * ball * rr);
  }
  // Sums the tetrahedra between the faces and a point inside (about which all sums are positive, so nothing cancels).
  Inertial operator()(const ConvexHull& hull) const {
    const HullMesh mesh = convex_hull(hull.points);
    if (mesh.triangles.empty()) throw std::invalid_argument("the convex hull is flat");
    Vec3 inside = Vec3::Zero();
    for (std::uint32_t corner : mesh.corners) inside += hull.points[corner];
    inside /= static_cast<double>(mesh.corners.size());
    double volume = 0;
    Vec3 first = Vec3::Zero();   // integral of x
    Mat3 second = Mat3::Zero();  // integral of x x^T
    for (const auto& t : mesh.triangles) {
      const Vec3 a = hull.points[t[0]] - inside, b = hull.points[t[1]] - inside, c = hull.points[t[2]] - inside;
      const double v = a.dot(b.cross(c)) / 6;
      const Vec3 s = a + b + c;
      volume += v;
      first += (v / 4) * s;
      second += (v / 20) * (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose());
    }
    const Vec3 centre = first / volume;
    Inertial i;
    i.mass = density * volume;
    i.centre = inside + centre;
    second -= volume * centre * centre.transpose();
    i.inertia = density * (second.trace() * Mat3::Identity() - second);
    i.inertia = (0.5 * (i.inertia + i.inertia.transpose())).eval();
    return i;
  }
  template <class Surface>
  Inertial operator()(const Surface&) const {
    throw std::invalid_argument("planes, triangle meshes and height fields have no mass");
  }
};

}  // namespace

Mat3 shifted_inertia(const Mat3& inertia, double mass, const Vec3& offset) {
  return inertia + mass * (offset.squaredNorm() * Mat3::Identity() - offset * offset.transpose());
}

Inertial mass_of(const Geometry& geometry, double density) { return std::visit(Solid{density}, geometry); }

Inertial MassTable::of(std::span<const Shape> shapes, double density) {
  return of(shapes, std::vector<double>(shapes.size(), density));
}

Inertial MassTable::of(std::span<const Shape> shapes, std::span<const double> densities) {
  unit_.resize(scene_.geometries.size());
  std::vector<Inertial> parts;
  for (std::size_t s = 0; s < shapes.size(); ++s) {
    std::optional<Inertial>& unit = unit_[shapes[s].geometry];
    if (!unit) unit = mass_of(scene_.geometries[shapes[s].geometry], 1);
    Inertial part = with_mass(*unit, unit->mass * densities[s]);
    const Pose& pose = shapes[s].pose;
    // Exactly the geometry's own values where it is not turned: no rounding for the commonest scenes.
    if (pose.orientation.coeffs() != Quat::Identity().coeffs()) {
      const Mat3 turn = pose.orientation.toRotationMatrix();
      part.inertia = (turn * part.inertia * turn.transpose()).eval();
      part.centre = turn * part.centre;
    }
    part.centre += pose.position;
    parts.push_back(part);
  }
  Inertial sum;
  if (parts.size() == 1) {
    sum = parts[0];
  } else {
    for (const Inertial& part : parts) sum.mass += part.mass, sum.centre += part.mass * part.centre;
    sum.centre /= sum.mass;
    for (const Inertial& part : parts)
      sum.inertia += shifted_inertia(part.inertia, part.mass, part.centre - sum.centre);
  }
  sum.inertia = (0.5 * (sum.inertia + sum.inertia.transpose())).eval();  // symmetric to the bit
  return sum;
}

Inertial with_mass(Inertial inertial, double mass) {
  const double factor = mass / inertial.mass;
  inertial.inertia *= factor;
  inertial.mass = mass;
  return inertial;
}

Vec3 principal_moments(const Mat3& inertia) {
  return Eigen::SelfAdjointEigenSolver<Mat3>(inertia, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace soda
