#include "common/scene/scene_builder.h"

#include <algorithm>

#include "common/scene/proto_geometry.h"
#include "common/scene/validate.h"

namespace soda {

std::uint32_t SceneBuilder::geometry(const Geometry& geometry) {
  pb::Geometry key;
  write_geometry(geometry, &key);
  const auto next = static_cast<std::uint32_t>(scene.geometries.size());
  const auto [entry, is_new] = index_.emplace(key.SerializeAsString(), next);
  if (is_new) scene.geometries.push_back(geometry);
  return entry->second;
}

Body& SceneBuilder::add(const Geometry& geometry_, const Vec3& position, const Quat& orientation, double density) {
  Body body;
  body.pose = {position, orientation};
  body.shapes = {Shape{geometry(geometry_), Pose{}}};
  densities_.push_back(density);
  places_.push_back(scene.bodies.size());
  scene.bodies.push_back(std::move(body));
  return scene.bodies.back();
}

Body& SceneBuilder::add_static(const Geometry& geometry_, const Vec3& position, const Quat& orientation) {
  Body body;
  body.is_static = true;
  body.pose = {position, orientation};
  body.shapes = {Shape{geometry(geometry_), Pose{}}};
  scene.bodies.push_back(std::move(body));
  return scene.bodies.back();
}

Body& SceneBuilder::add_ground(double edge, double friction) {
  Body& ground = add_static(Box{Vec3(edge, edge, 2)}, Vec3(0, 0, -1));
  ground.name = "ground";
  ground.friction = friction;
  ground.colour = 0x8a9a7bff;
  return ground;
}

const Pose& SceneBuilder::pose_of(std::size_t dynamic) const {
  static const Pose kIdentity;
  return dynamic == kWorld ? kIdentity : scene.bodies.at(places_.at(dynamic)).pose;
}

Joint& SceneBuilder::add_joint(JointKind kind, std::size_t a, std::size_t b, const Vec3& at, const Vec3& axis) {
  const Pose frame = joint_frame(kind, at, axis);
  Joint joint;
  joint.kind = kind;
  // The ids that finish() will give.
  joint.a = a + 1;
  joint.b = b == kWorld ? kWorldBody : b + 1;
  joint.frame_a = frame_in(pose_of(a), frame);
  joint.frame_b = frame_in(pose_of(b), frame);
  scene.joints.push_back(std::move(joint));
  return scene.joints.back();
}

Joint& SceneBuilder::add_rod(std::size_t a, std::size_t b, const Vec3& at_a, const Vec3& at_b) {
  Joint& joint = add_joint(JointKind::kDistance, a, b, at_a);
  joint.frame_b = frame_in(pose_of(b), Pose{at_b, Quat::Identity()});
  const double length = (at_b - at_a).norm();
  joint.limits = JointLimits{length, length};
  return joint;
}

Scene SceneBuilder::finish() {
  MassTable masses(scene);
  BodyId next = 1;
  std::size_t dynamic = 0;
  for (Body& body : scene.bodies) {
    if (body.is_static) continue;
    body.id = next++;
    const double density = densities_[dynamic++];
    if (body.inertial.mass == 0) body.inertial = masses.of(body.shapes, density);
  }
  for (Body& body : scene.bodies)
    if (body.is_static) body.id = next++;
  std::sort(scene.bodies.begin(), scene.bodies.end(), [](const Body& l, const Body& r) { return l.id < r.id; });
  for (Joint& joint : scene.joints) order_ends(scene, joint);
  finish_joints(scene);
  validate(scene, scene.name);
  densities_.clear();
  places_.clear();
  index_.clear();
  return std::exchange(scene, Scene{});
}

}  // namespace soda
