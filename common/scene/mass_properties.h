// Mass, centre of mass and inertia of shapes.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "common/scene/scene.h"

namespace soda {

constexpr double kDefaultDensity = 1000;  // kg/m^3, water

// Of a solid body of the given density (kg/m^3) in the geometry's own frame. Exact formulas; a convex hull is
// integrated over its faces. Planes, meshes and height fields have no volume of their own: std::invalid_argument.
Inertial mass_of(const Geometry& geometry, double density);

// Adds up the shapes of bodies. Keeps what it has worked out of each of the scene's geometries, because many bodies
// share one and hulls are costly. The scene must outlive it; geometries may be appended meanwhile.
class MassTable {
 public:
  explicit MassTable(const Scene& scene) : scene_(scene) {}

  // Of shapes with their densities (kg/m^3, one each), in the body's frame. Where shapes overlap both count.
  Inertial of(std::span<const Shape> shapes, std::span<const double> densities);
  // All of one density.
  Inertial of(std::span<const Shape> shapes, double density);

 private:
  const Scene& scene_;
  std::vector<std::optional<Inertial>> unit_;  // by geometry: at 1 kg/m^3
};

// The same body with another mass: the inertia is scaled along.
Inertial with_mass(Inertial inertial, double mass);

// m^2 * kg: inertia about the centre of mass, moved by an offset (parallel axes).
Mat3 shifted_inertia(const Mat3& inertia, double mass, const Vec3& offset);

// The three principal moments of inertia, ascending, kg m^2. For checks; not part of any state.
Vec3 principal_moments(const Mat3& inertia);

}  // namespace soda
