#include "bench/bullet_world.h"

#include <btBulletDynamicsCommon.h>

#include <cmath>
#include <stdexcept>
#include <vector>

namespace soda::bench {
namespace {

btVector3 to_bullet(const Vec3& v) { return btVector3(v.x(), v.y(), v.z()); }
btTransform to_bullet(const Pose& p) {
  return btTransform(btQuaternion(p.orientation.x(), p.orientation.y(), p.orientation.z(), p.orientation.w()),
                     to_bullet(p.position));
}

constexpr double kPlaneExtent = 1000;  // m, half edge of the box that stands for a plane, as in our own step

struct MakeShape {
  std::unique_ptr<btCollisionShape> operator()(const Sphere& s) const {
    return std::make_unique<btSphereShape>(s.radius);
  }
  std::unique_ptr<btCollisionShape> operator()(const Box& b) const {
    return std::make_unique<btBoxShape>(to_bullet(0.5 * b.size));
  }
  std::unique_ptr<btCollisionShape> operator()(const Capsule& c) const {
    return std::make_unique<btCapsuleShapeZ>(c.radius, c.length);
  }
  std::unique_ptr<btCollisionShape> operator()(const Cylinder& c) const {
    return std::make_unique<btCylinderShapeZ>(btVector3(c.radius, c.radius, 0.5 * c.length));
  }
  std::unique_ptr<btCollisionShape> operator()(const ConvexHull& h) const {
    auto hull = std::make_unique<btConvexHullShape>();
    for (const Vec3& p : h.points) hull->addPoint(to_bullet(p));
    return hull;
  }
  std::unique_ptr<btCollisionShape> operator()(const Plane&) const {
    return std::make_unique<btBoxShape>(btVector3(kPlaneExtent, kPlaneExtent, kPlaneExtent));
  }
  template <typename Surface>
  std::unique_ptr<btCollisionShape> operator()(const Surface&) const {
    throw std::invalid_argument("stock Bullet: triangle meshes and height fields are not compared");
  }
};

}  // namespace

struct BulletWorld::World {
  explicit World(const Scene& s) : scene(s) {}
  const Scene& scene;
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld dynamics{&dispatcher, &broadphase, &solver, &configuration};
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> bodies;  // as in the scene
  struct Driven {
    btRigidBody* body;
    const Drive* drive;
    Vec3 target;
  };
  std::vector<Driven> driven;
  std::vector<std::size_t> dynamic;  // positions in `bodies`

  std::vector<std::unique_ptr<btTypedConstraint>> joints;

  ~World() {
    for (auto& joint : joints) dynamics.removeConstraint(joint.get());
    for (auto& body : bodies) dynamics.removeRigidBody(body.get());
  }

  void add(const Body& body, const std::vector<btCollisionShape*>& by_geometry) {
    auto compound = std::make_unique<btCompoundShape>();
    for (const Shape& shape : body.shapes) {
      Pose pose = shape.pose;
      if (const auto* plane = std::get_if<Plane>(&scene.geometries[shape.geometry])) {
        pose.orientation = pose.orientation * Quat::FromTwoVectors(Vec3::UnitZ(), plane->normal);
        pose.position -= pose.orientation * Vec3(0, 0, kPlaneExtent);
      }
      pose.position -= body.inertial.centre;
      compound->addChildShape(to_bullet(pose), by_geometry[shape.geometry]);
    }
    btCollisionShape* shape = compound.get();
    const btTransform only = compound->getChildTransform(0);
    if (body.shapes.size() == 1 && only == btTransform::getIdentity())
      shape = compound->getChildShape(0);
    else
      shapes.push_back(std::move(compound));
    // Bullet knows principal moments only; the scenes compared have no others.
    const Vec3 inertia = body.inertial.inertia.diagonal();
    btRigidBody::btRigidBodyConstructionInfo info(body.is_static ? 0 : body.inertial.mass, nullptr, shape,
                                                  body.is_static ? btVector3(0, 0, 0) : to_bullet(inertia));
    info.m_startWorldTransform = to_bullet(body.pose * Pose{body.inertial.centre, Quat::Identity()});
    info.m_friction = std::sqrt(body.friction);        // Bullet multiplies the two
    info.m_restitution = std::sqrt(body.restitution);  // likewise; as ours where both bodies have the same
    info.m_linearDamping = body.linear_damping;
    info.m_angularDamping = body.angular_damping;
    bodies.push_back(std::make_unique<btRigidBody>(info));
    btRigidBody& made = *bodies.back();
    made.setLinearVelocity(to_bullet(body.linear_velocity));
    made.setAngularVelocity(to_bullet(body.angular_velocity));
    if (!body.is_static) {
      made.setActivationState(DISABLE_DEACTIVATION);
      dynamic.push_back(bodies.size() - 1);
      if (body.drive) driven.push_back({&made, &*body.drive, body.drive->velocity});
    }
    dynamics.addRigidBody(&made);
  }

  void add(const Joint& joint) {
    // b is a body, or null for the world; frames about the centres of mass.
    const auto end = [&](BodyId id, const Pose& frame) -> std::pair<btRigidBody*, btTransform> {
      for (std::size_t i = 0; i < bodies.size(); ++i)
        if (scene.bodies[i].id == id)
          return {bodies[i].get(),
                  to_bullet(Pose{frame.position - scene.bodies[i].inertial.centre, frame.orientation})};
      return {nullptr, to_bullet(frame)};
    };
    const auto [a, in_a] = end(joint.a, joint.frame_a);
    const auto [b, in_b] = end(joint.b, joint.frame_b);
    // A rod to the world is the nearest thing that Bullet has: a ball joint at its far end.
    if (joint.kind == JointKind::kDistance && !b && joint.limits->lower == joint.limits->upper) {
      const btVector3 pivot = a->getWorldTransform().inverse() * in_b.getOrigin();
      joints.push_back(std::make_unique<btPoint2PointConstraint>(*a, pivot));
      dynamics.addConstraint(joints.back().get());
      return;
    }
    if (joint.limits || joint.motor || joint.spring || joint.cone_limit)
      throw std::invalid_argument("stock Bullet: limits, motors and springs are not compared");
    btRigidBody& other = b ? *b : btTypedConstraint::getFixedBody();
    if (joint.kind == JointKind::kBall)
      joints.push_back(std::make_unique<btPoint2PointConstraint>(*a, other, in_a.getOrigin(), in_b.getOrigin()));
    else if (joint.kind == JointKind::kHinge)
      joints.push_back(std::make_unique<btHingeConstraint>(*a, other, in_a, in_b));
    else
      throw std::invalid_argument("stock Bullet: only ball joints and hinges are compared");
    dynamics.addConstraint(joints.back().get(), !joint.bodies_collide);
  }

  // As in our integrator, once per step.
  void drive() {
    const Vec3 up = scene.gravity.isZero(0) ? Vec3(Vec3::Zero()) : Vec3(-scene.gravity.normalized());
    for (Driven& d : driven) {
      const btVector3 at = d.body->getWorldTransform().getOrigin(), now = d.body->getLinearVelocity();
      for (int axis = 0; axis < 3 && d.drive->bounds; ++axis)
        if ((at[axis] > d.drive->bounds->max[axis] && d.target[axis] > 0) ||
            (at[axis] < d.drive->bounds->min[axis] && d.target[axis] < 0))
          d.target[axis] = -d.target[axis];
      Vec3 change = d.target - Vec3(now.x(), now.y(), now.z());
      change -= up.dot(change) * up;
      const double most = d.drive->max_acceleration * scene.dt, length = change.norm();
      if (length > most) change *= most / length;
      d.body->setLinearVelocity(now + to_bullet(change));
    }
  }
};

BulletWorld::BulletWorld(const Scene& scene) : world_(std::make_unique<World>(scene)) {
  std::vector<btCollisionShape*> by_geometry;
  for (const Geometry& geometry : scene.geometries) {
    world_->shapes.push_back(std::visit(MakeShape{}, geometry));
    by_geometry.push_back(world_->shapes.back().get());
  }
  world_->dynamics.setGravity(to_bullet(scene.gravity));
  for (const Body& body : scene.bodies) world_->add(body, by_geometry);
  for (const Joint& joint : scene.joints) world_->add(joint);
}

BulletWorld::~BulletWorld() = default;

void BulletWorld::step() {
  world_->drive();
  world_->dynamics.stepSimulation(world_->scene.dt, 0);
}

Vec3 BulletWorld::position(std::size_t body) const {
  const btVector3& x = world_->bodies[world_->dynamic[body]]->getWorldTransform().getOrigin();
  return Vec3(x.x(), x.y(), x.z());
}

void BulletWorld::read(std::vector<BodyState>& states) const {
  const auto vec = [](const btVector3& v) { return Vec3(v.x(), v.y(), v.z()); };
  states.resize(world_->dynamic.size());
  for (std::size_t i = 0; i < states.size(); ++i) {
    const btRigidBody& body = *world_->bodies[world_->dynamic[i]];
    BodyState& state = states[i];
    const btQuaternion q = body.getOrientation();
    state.id = world_->scene.bodies[world_->dynamic[i]].id;
    state.set_x(vec(body.getCenterOfMassPosition()));
    state.set_q(Quat(q.w(), q.x(), q.y(), q.z()));
    state.set_v(vec(body.getLinearVelocity()));
    state.set_w(vec(body.getAngularVelocity()));
  }
}

}  // namespace soda::bench
