// Puts a scene together body by body: for generators, importers and tests.
#pragma once

#include <string>
#include <unordered_map>
#include <vector>

#include "common/scene/mass_properties.h"
#include "common/scene/scene.h"

namespace soda {

class SceneBuilder {
 public:
  explicit SceneBuilder(std::string name) { scene.name = std::move(name); }

  // Index of this geometry in the scene's table; equal ones share an entry.
  std::uint32_t geometry(const Geometry& geometry);

  // A dynamic body of one shape. The reference holds until the next body is added.
  Body& add(const Geometry& geometry, const Vec3& position, const Quat& orientation = Quat::Identity(),
            double density = kDefaultDensity);
  // A static one.
  Body& add_static(const Geometry& geometry, const Vec3& position, const Quat& orientation = Quat::Identity());

  // A static box 2 m thick with its top at z = 0 about the origin, `edge` m wide.
  Body& add_ground(double edge, double friction = 0.5);

  static constexpr std::size_t kWorld = static_cast<std::size_t>(-1);
  // A joint between two dynamic bodies, by their places in the order in which they were added, or a body and the world
  // (kWorld, as b). `at` (m) and `axis` are in world axes: z of both frames is along the axis, of a slider x. Poses
  // count as they are now. A slider's limits are to be set. The reference holds until the next joint is added.
  Joint& add_joint(JointKind kind, std::size_t a, std::size_t b, const Vec3& at, const Vec3& axis = Vec3::UnitZ());
  // A distance joint that keeps two places (m, in world axes) as far apart as they are.
  Joint& add_rod(std::size_t a, std::size_t b, const Vec3& at_a, const Vec3& at_b);

  // Ids: dynamic bodies 1 .. N in the order in which they were added, then static ones. Inertials that were not set
  // come from the shapes. Joints get their order. Validates. The builder is empty afterwards.
  Scene finish();

  std::size_t dynamic_count() const { return densities_.size(); }

  Scene scene;  // its settings may be changed at will; its bodies have no ids before finish()

 private:
  const Pose& pose_of(std::size_t dynamic) const;  // identity of kWorld

  std::unordered_map<std::string, std::uint32_t> index_;  // by serialised geometry
  std::vector<double> densities_;                         // of the dynamic bodies, in order
  std::vector<std::size_t> places_;                       // likewise: where they are in scene.bodies
};

}  // namespace soda
