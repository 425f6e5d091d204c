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

// Which bodies collide: see Body::collision_groups.
struct CollisionFilter {
  std::uint32_t groups = 1, mask = 0xffffffff;
  bool admits(const CollisionFilter& other) const { return (groups & other.mask) && (other.groups & mask); }
};

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
  double reach = 0;                                // m, likewise, with what its joints reach for
  double inner_extent = 0;          // m, smallest half extent of any child: the scale for recycling contacts
  double inverse_inner_extent = 0;  // 1/m
  bool is_ball = false;             // a sphere about its centre of mass, which looks the same however it turns
  bool fixed_rotation = false;      // nothing turns it: its inverse inertia is 0
  const Drive* drive = nullptr;
  const Body* kinematic = nullptr;  // one with a prescribed motion; its inverse mass and inertia are 0
  CollisionFilter filter;
  std::uint32_t first_joint = 0, joints = 0;    // range in Model::joints: those that its records name
  std::uint32_t first_anchor = 0, anchors = 0;  // range in Model::anchors: of all its joints
};

// A joint, of the body whose record it has.
struct JointModel {
  const Joint* joint;
  BodyId b;            // as in records: a dynamic body, or kStaticBit | a static one or kWorldBody
  std::uint32_t part;  // as in records
  double reach;        // m, along each axis, beyond which its ends do not look for each other; of dynamic bodies
  Pose at_a, at_b;     // about the centres of mass, in the bodies' axes; of what does not move: in the world
};

// Where a body's joint reaches for its other body.
struct Anchor {
  Vec3 place;    // m, from the centre of mass, body axes
  double reach;  // m
};

struct StaticModel {
  BodyId id = 0;
  Pose pose;
  Mat3 rotation = Mat3::Identity();  // of pose
  double friction = 0, restitution = 0;
  CollisionFilter filter;
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
  std::span<const JointModel> joints_of(const BodyModel& body) const {
    return std::span(joints_).subspan(body.first_joint, body.joints);
  }
  std::span<const Anchor> anchors_of(const BodyModel& body) const {
    return std::span(anchors_).subspan(body.first_anchor, body.anchors);
  }
  // The joint that a record is about, or null.
  const JointModel* find_joint(const ContactRecord& record) const;
  std::span<const BodyModel> bodies() const { return bodies_; }      // ascending by id
  std::span<const StaticModel> statics() const { return statics_; }  // ascending by id
  const ShapeStore& shapes() const { return shapes_; }
  BodySet initial_state() const;  // state 0 of the scene's dynamic bodies

  // A body that is not in the scene: `alone` is a scene of that one dynamic body, whose id is larger than all others.
  // Pointers and spans to bodies do not survive it. The scene's constants stay those of the scene.
  void add(std::shared_ptr<const Scene> alone);

  // State of a body where its scene puts it.
  BodyState state_of(const Body& body) const;

  double largest_ordinary_diameter() const { return diameter_; }  // m, D of the canonical constraint order

 private:
  void add_dynamic(const Scene& scene, const Body& body);
  void add_joints();
  Scene scene_;
  std::vector<std::shared_ptr<const Scene>> added_;
  ShapeStore shapes_;
  std::vector<BodyModel> bodies_;
  std::vector<StaticModel> statics_;
  StaticModel world_;  // what joints to the world hold on to
  std::vector<JointModel> joints_;
  std::vector<Anchor> anchors_;
  std::vector<std::uint32_t> index_;  // by id where ids are dense, else empty
  double diameter_ = 1;
};

}  // namespace soda::physics
