#include "server/physics/model.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/grid.h"
#include "server/physics/kinematics.h"

namespace soda::physics {
namespace {

// Ids up to this many times the number of bodies are looked up in a table, else by bisection.
constexpr std::size_t kTableFactor = 8;
constexpr std::uint32_t kNone = 0xffffffffu;

bool is_isotropic(const Mat3& inertia) {
  const double scale = inertia(0, 0);
  return (inertia - scale * Mat3::Identity()).cwiseAbs().maxCoeff() <= 1e-12 * std::abs(scale);
}

template <typename T>
const T* find_by_id(const std::vector<T>& sorted, BodyId id) {
  const auto it = std::lower_bound(sorted.begin(), sorted.end(), id, [](const T& t, BodyId i) { return t.id < i; });
  return it != sorted.end() && it->id == id ? &*it : nullptr;
}

}  // namespace

Model::Model(Scene scene) : scene_(std::move(scene)) {
  std::sort(scene_.bodies.begin(), scene_.bodies.end(), [](const Body& l, const Body& r) { return l.id < r.id; });
  std::vector<double> radii;
  for (const Body& body : scene_.bodies) {
    if (body.is_static) {
      const auto children = static_cast<std::uint32_t>(body.shapes.size());
      const std::uint32_t first = shapes_.add(scene_, body);
      StaticModel s;
      s.id = body.id;
      s.pose = {body.pose.position, normalized(body.pose.orientation)};
      s.rotation = s.pose.orientation.toRotationMatrix();
      s.friction = body.friction;
      s.restitution = body.restitution;
      s.filter = {body.collision_groups, body.collision_mask};
      s.first_child = first;
      s.children = children;
      s.box = bounding_box(shapes_.children(first, children), s.pose.position, s.rotation);
      statics_.push_back(s);
      continue;
    }
    add_dynamic(scene_, body);
    radii.push_back(bodies_.back().reach);
  }
  if (radii.empty()) return;
  diameter_ = 2 * largest_ordinary_radius(radii);
  const BodyId last = bodies_.back().id;
  if (last / kTableFactor <= bodies_.size()) {
    index_.assign(last + 1, kNone);
    for (std::uint32_t i = 0; i < bodies_.size(); ++i) index_[bodies_[i].id] = i;
  }
  add_joints();
}

void Model::add_joints() {
  struct End {
    std::size_t body;
    Anchor anchor;
  };
  std::vector<End> ends;
  std::vector<std::pair<std::size_t, JointModel>> owned;
  const auto place_of = [&](BodyId id) { return static_cast<std::size_t>(find(id) - bodies_.data()); };
  const auto centred = [&](const Pose& frame, BodyId id) {
    const Pose unit{frame.position, normalized(frame.orientation)};
    if (id == kWorldBody) return unit;
    if (const StaticModel* const fixed = find_static(id)) return fixed->pose * unit;
    return Pose{unit.position - find_body(scene_, id)->inertial.centre, unit.orientation};
  };
  for (const Joint& joint : scene_.joints) {
    const bool moves = joint.b != kWorldBody && find(joint.b);
    JointModel m{&joint,
                 moves ? joint.b : kStaticBit | joint.b,
                 kJointPart,
                 joint_reach_a(scene_, joint) + joint_reach_b(scene_, joint),
                 centred(joint.frame_a, joint.a),
                 centred(joint.frame_b, joint.b)};
    // What does not move is looked for at any distance.
    if (moves) ends.push_back({place_of(joint.a), {m.at_a.position, joint_reach_a(scene_, joint)}});
    if (moves) ends.push_back({place_of(joint.b), {m.at_b.position, joint_reach_b(scene_, joint)}});
    owned.emplace_back(place_of(joint.a), m);
  }
  std::stable_sort(owned.begin(), owned.end(), [](const auto& l, const auto& r) {
    return l.first != r.first ? l.first < r.first : l.second.b < r.second.b;
  });
  for (const auto& [body, joint] : owned) {
    BodyModel& a = bodies_[body];
    if (a.joints++ == 0) a.first_joint = static_cast<std::uint32_t>(joints_.size());
    joints_.push_back(joint);
    if (a.joints > 1 && joints_[joints_.size() - 2].b == joint.b)
      joints_.back().part = joints_[joints_.size() - 2].part + 1;
  }
  std::stable_sort(ends.begin(), ends.end(), [](const End& l, const End& r) { return l.body < r.body; });
  for (const End& end : ends) {
    BodyModel& body = bodies_[end.body];
    if (body.anchors++ == 0) body.first_anchor = static_cast<std::uint32_t>(anchors_.size());
    anchors_.push_back(end.anchor);
  }
}

const JointModel* Model::find_joint(const ContactRecord& record) const {
  const BodyModel* const a = find(record.a);
  if (!a) return nullptr;
  for (const JointModel& joint : joints_of(*a))
    if (joint.b == record.b && joint.part == record.part) return &joint;
  return nullptr;
}

void Model::add_dynamic(const Scene& scene, const Body& body) {
  const auto children = static_cast<std::uint32_t>(body.shapes.size());
  const std::uint32_t first = shapes_.add(scene, body);
  BodyModel m;
  m.id = body.id;
  m.mass = body.inertial.mass;
  m.inverse_mass = 1 / m.mass;
  m.inertia = body.inertial.inertia;
  m.inverse_inertia = m.inertia.inverse();
  m.isotropic = is_isotropic(m.inertia);
  m.friction = body.friction;
  m.restitution = body.restitution;
  m.filter = {body.collision_groups, body.collision_mask};
  m.linear_damping = body.linear_damping;
  m.angular_damping = body.angular_damping;
  m.first_child = first;
  m.children = children;
  m.radius = bounding_radius(scene, body);
  m.reach = std::max(m.radius, body.joint_reach);
  m.inner_extent = m.radius;
  for (const Child& child : shapes_.children(first, children))
    m.inner_extent = std::min(m.inner_extent, child.inner_extent);
  m.inverse_inner_extent = 1 / m.inner_extent;
  const Child& only = shapes_.children(first, 1)[0];
  m.is_ball = children == 1 && only.kind == ShapeKind::kSphere && only.pose.position.isZero(0);
  m.drive = body.drive ? &*body.drive : nullptr;
  m.fixed_rotation = body.fixed_rotation;
  if (body.motion) {
    m.kinematic = &body;
    m.inverse_mass = 0;
  }
  if (body.motion || body.fixed_rotation) {
    m.inverse_inertia.setZero();
    m.isotropic = true;
  }
  bodies_.push_back(m);
}

void Model::add(std::shared_ptr<const Scene> alone) {
  const Body& body = alone->bodies.at(0);
  if (body.is_static || (!bodies_.empty() && body.id <= bodies_.back().id))
    throw std::invalid_argument("a body added to a model must be dynamic and have the largest id");
  add_dynamic(*alone, body);
  added_.push_back(std::move(alone));
  if (index_.empty()) return;
  if (body.id / kTableFactor > bodies_.size()) return index_.clear();
  index_.resize(body.id + 1, kNone);
  index_[body.id] = static_cast<std::uint32_t>(bodies_.size() - 1);
}

const BodyModel* Model::find(BodyId id) const {
  if (index_.empty()) return find_by_id(bodies_, id);
  if (id >= index_.size() || index_[id] == kNone) return nullptr;
  return &bodies_[index_[id]];
}

const StaticModel* Model::find_static(BodyId id) const { return id == kWorldBody ? &world_ : find_by_id(statics_, id); }

BodyState Model::state_of(const Body& body) const {
  BodyState s;
  s.id = body.id;
  const Quat q = normalized(body.pose.orientation);
  s.set_x(body.pose.position + q * body.inertial.centre);
  s.set_q(q);
  s.set_v(body.linear_velocity);
  s.set_w(body.angular_velocity);
  if (body.motion) follow(body, 0, scene_.dt, s);
  return s;
}

BodySet Model::initial_state() const {
  BodySet set;
  set.bodies.reserve(bodies_.size());
  for (const Body& body : scene_.bodies)
    if (!body.is_static) set.bodies.push_back(state_of(body));
  return set;
}

}  // namespace soda::physics
