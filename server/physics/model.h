// A scene prepared for stepping: everything that does not change during a run but by bodies that are added.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/body_set.h"
#include "common/scene/scene.h"
#include "server/physics/shape_store.h"

namespace soda::physics {

// What a dynamic body is, apart from its state. Its frame has its origin at the centre of mass and the axes of the
// scene's body frame.
struct BodyModel {
  BodyId id = 0;
  double mass = 0, inverse_mass = 0;    // kg, 1/kg
  Mat3 inertia = Mat3::Zero();          // kg m^2, about the centre of mass, body axes
  Mat3 inverse_inertia = Mat3::Zero();  // 1/(kg m^2)
  bool isotropic = false;               // inertia is a multiple of the identity: no gyroscopic terms
  double friction = 0, restitution = 0;
  double linear_damping = 0, angular_damping = 0;  // 1/s
  std::uint32_t first_child = 0, children = 0;     // range in ShapeStore::children
  double radius = 0;                               // m, of the sphere about the centre of mass that holds all shapes
  double inner_extent = 0;  // m, smallest half extent of any child: the scale for recycling contacts
  const Drive* drive = nullptr;
};

struct StaticModel {
  BodyId id = 0;
  Pose pose;
  Mat3 rotation = Mat3::Identity();  // of pose
  double friction = 0, restitution = 0;
  std::uint32_t first_child = 0, children = 0;
  Aabb box;  // of all children
};

class Model {
 public:
  // Throws SceneError for what this version cannot simulate. The scene must have been validated.
  explicit Model(Scene scene);
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;

  const Scene& scene() const { return scene_; }
  // The dynamic body of that id, or null.
  const BodyModel* find(BodyId id) const;
  const StaticModel* find_static(BodyId id) const;
  std::span<const BodyModel> bodies() const { return bodies_; }      // ascending by id
  std::span<const StaticModel> statics() const { return statics_; }  // ascending by id
  const ShapeStore& shapes() const { return shapes_; }
  BodySet initial_state() const;  // state 0 of the scene's dynamic bodies

  // A body that is not in the scene: `alone` is a scene of that one dynamic body, whose id is larger than all others.
  // Pointers and spans to bodies do not survive it. The scene's constants stay those of the scene.
  void add(std::shared_ptr<const Scene> alone);

  // State of a body where its scene puts it.
  static BodyState state_of(const Body& body);

  double largest_ordinary_diameter() const { return diameter_; }  // m, D of the canonical constraint order

 private:
  void add_dynamic(const Scene& scene, const Body& body);
  Scene scene_;
  std::vector<std::shared_ptr<const Scene>> added_;
  ShapeStore shapes_;
  std::vector<BodyModel> bodies_;
  std::vector<StaticModel> statics_;
  std::vector<std::uint32_t> index_;  // by id where ids are dense, else empty
  double diameter_ = 1;
};

}  // namespace soda::physics
