#include "bench/accuracy/measures.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace soda::bench {

std::vector<const Body*> dynamic_bodies(const Scene& scene) {
  std::vector<const Body*> bodies;
  for (const Body& body : scene.bodies)
    if (!body.is_static) bodies.push_back(&body);
  return bodies;
}

Mechanics::Mechanics(const Scene& scene) : gravity_(scene.gravity) {
  for (const Body* body : dynamic_bodies(scene)) {
    masses_.push_back(body->inertial.mass);
    inertias_.push_back(body->inertial.inertia);
  }
}

Vec3 Mechanics::spin_of(const BodyState& body, std::size_t i) const {
  const Quat q = body.q();
  return q * (inertias_[i] * (q.conjugate() * body.w()));
}

double Mechanics::kinetic(Bodies bodies) const {
  double sum = 0;
  for (std::size_t i = 0; i < bodies.size(); ++i)
    sum += 0.5 * masses_[i] * bodies[i].v().squaredNorm() + 0.5 * bodies[i].w().dot(spin_of(bodies[i], i));
  return sum;
}

double Mechanics::potential(Bodies bodies) const {
  double sum = 0;
  for (std::size_t i = 0; i < bodies.size(); ++i) sum -= masses_[i] * gravity_.dot(bodies[i].x());
  return sum;
}

Vec3 Mechanics::momentum(Bodies bodies) const {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < bodies.size(); ++i) sum += masses_[i] * bodies[i].v();
  return sum;
}

Vec3 Mechanics::angular_momentum(Bodies bodies) const {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < bodies.size(); ++i)
    sum += masses_[i] * bodies[i].x().cross(bodies[i].v()) + spin_of(bodies[i], i);
  return sum;
}

void EnergyWatch::look(Bodies bodies) {
  last_ = mechanics_.energy(bodies);
  if (!started_) first_ = last_;
  started_ = true;
  rise_ = std::max(rise_, (last_ - first_) / std::abs(first_));
  squares_ += (last_ - first_) * (last_ - first_);
  ++looks_;
}

Penetration::Solid Penetration::solid_of(const Scene& scene, const Body& body) {
  const Shape& shape = body.shapes.at(0);
  if (body.shapes.size() == 1 && shape.pose.position.isZero(0)) {
    const Geometry& geometry = scene.geometries[shape.geometry];
    if (const auto* sphere = std::get_if<Sphere>(&geometry)) return {true, sphere->radius, Vec3::Zero()};
    if (const auto* box = std::get_if<Box>(&geometry)) return {false, 0.5 * box->size.norm(), 0.5 * box->size};
  }
  throw std::invalid_argument("penetration is measured of spheres and boxes only");
}

Penetration::Penetration(const Scene& scene) {
  for (const Body& body : scene.bodies)
    if (body.is_static)
      static_.push_back({solid_of(scene, body), body.pose.position, body.pose.orientation.toRotationMatrix()});
    else
      dynamic_.push_back(solid_of(scene, body));
}

namespace {

// Of a sphere in a box, with the sphere's centre in the box's frame.
double depth_in_box(const Vec3& centre, double radius, const Vec3& half) {
  const Vec3 nearest = centre.cwiseMax(-half).cwiseMin(half);
  const double outside = (centre - nearest).norm();
  if (outside > 0) return radius - outside;
  return radius + (half - centre.cwiseAbs()).minCoeff();
}

}  // namespace

double Penetration::depth(const Placed& a, const Placed& b) {
  const Vec3 apart = b.at - a.at;
  if (a.solid.sphere && b.solid.sphere) return a.solid.radius + b.solid.radius - apart.norm();
  if (a.solid.sphere) return depth_in_box(b.turn.transpose() * -apart, a.solid.radius, b.solid.half);
  if (b.solid.sphere) return depth_in_box(a.turn.transpose() * apart, b.solid.radius, a.solid.half);
  // Separating axes (S. Gottschalk, M. Lin, D. Manocha, "OBBTree", 1996): the least overlap of the projections.
  double least = std::numeric_limits<double>::infinity();
  const auto along = [&](const Vec3& axis) {
    const double reach = (a.turn.transpose() * axis).cwiseAbs().dot(a.solid.half) +
                         (b.turn.transpose() * axis).cwiseAbs().dot(b.solid.half);
    least = std::min(least, reach - std::abs(axis.dot(apart)));
    return least > 0;
  };
  for (int i = 0; i < 3; ++i)
    if (!along(a.turn.col(i)) || !along(b.turn.col(i))) return least;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Vec3 axis = a.turn.col(i).cross(b.turn.col(j));
      const double length = axis.norm();
      if (length > 1e-3 && !along(axis / length)) return least;  // nearly parallel edges say nothing new
    }
  return least;
}

Penetration::Depth Penetration::of(Bodies bodies) const {
  std::vector<Placed> placed;
  placed.reserve(bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i)
    placed.push_back({dynamic_[i], bodies[i].x(), bodies[i].q().toRotationMatrix()});
  Depth result;
  const auto count = [&](const Placed& a, const Placed& b) {
    const double d = depth(a, b);
    if (d <= 0) return;
    result.largest = std::max(result.largest, d);
    result.sum_of_squares += d * d;
  };
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const Placed& a = placed[i];
    for (const Placed& b : static_) count(a, b);
    for (std::size_t j = i + 1; j < placed.size(); ++j) {
      const double reach = a.solid.radius + placed[j].solid.radius;
      if ((placed[j].at - a.at).squaredNorm() < reach * reach) count(a, placed[j]);
    }
  }
  return result;
}

Displacement displacement(const Body& from, const BodyState& now) {
  const Vec3 moved = now.x() - from.pose.position - from.pose.orientation * from.inertial.centre;
  return {std::hypot(moved.x(), moved.y()), -moved.z(), moved.norm()};
}

}  // namespace soda::bench
