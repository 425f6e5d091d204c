#include "common/scene/joint.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "common/grid.h"
#include "common/scene/scene.h"

namespace soda {
namespace {

constexpr double kSlackShare = 0.5;  // of the smaller body's bounding radius
constexpr double kLeastSlack = 0.02;  // m

Body* find(Scene& scene, BodyId id) {
  const auto it = std::lower_bound(scene.bodies.begin(), scene.bodies.end(), id,
                                   [](const Body& body, BodyId wanted) { return body.id < wanted; });
  return it != scene.bodies.end() && it->id == id ? &*it : nullptr;
}

double radius_of(const Scene& scene, BodyId id) {
  const Body* const body = find(const_cast<Scene&>(scene), id);
  return body && !body->is_static ? bounding_radius(scene, *body) : HUGE_VAL;
}

}  // namespace

double joint_slack(const Scene& scene, const Joint& joint) {
  return std::max(kLeastSlack, kSlackShare * std::min(radius_of(scene, joint.a), radius_of(scene, joint.b)));
}

double joint_reach_a(const Scene& scene, const Joint& joint) {
  double travel = 0;
  if (joint.kind == JointKind::kSlider || joint.kind == JointKind::kDistance)
    if (joint.limits) travel = std::max(std::abs(joint.limits->lower), std::abs(joint.limits->upper));
  return joint_slack(scene, joint) + travel;
}

double joint_reach_b(const Scene& scene, const Joint& joint) { return joint_slack(scene, joint); }

void finish_joints(Scene& scene) {
  std::stable_sort(scene.joints.begin(), scene.joints.end(), [](const Joint& l, const Joint& r) {
    return std::tie(l.a, l.b) < std::tie(r.a, r.b);
  });
  for (Body& body : scene.bodies) body.joint_reach = 0;
  for (const Joint& joint : scene.joints) {
    Body* const a = find(scene, joint.a);
    Body* const b = find(scene, joint.b);
    const auto reach = [](Body* body, const Pose& frame, double beyond) {
      if (!body || body->is_static) return;
      body->joint_reach = std::max(body->joint_reach, (frame.position - body->inertial.centre).norm() + beyond);
    };
    reach(a, joint.frame_a, joint_reach_a(scene, joint));
    reach(b, joint.frame_b, joint_reach_b(scene, joint));
  }
}

}  // namespace soda
