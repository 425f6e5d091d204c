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

  // Ids: dynamic bodies 1 .. N in the order in which they were added, then static ones. Inertials that were not set
  // come from the shapes. Validates. The builder is empty afterwards.
  Scene finish();

  std::size_t dynamic_count() const { return densities_.size(); }

  Scene scene;  // its settings may be changed at will; its bodies have no ids before finish()

 private:
  std::unordered_map<std::string, std::uint32_t> index_;  // by serialised geometry
  std::vector<double> densities_;                         // of the dynamic bodies, in order
};

}  // namespace soda
