#include "common/scene/proto_scene.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <unordered_set>

#include "common/scene/mass_properties.h"
#include "common/scene/proto_geometry.h"
#include "common/scene/proto_joint.h"

namespace soda {
namespace {

std::string at(const char* field, std::size_t index) { return std::string(field) + "[" + std::to_string(index) + "]"; }

double read_density(double value, const std::string& field) {
  if (!(value >= kMinDensity && value <= kMaxDensity))
    throw FieldError(field, "must be between 0.001 and 1e+06 kg/m^3, is " + std::to_string(value));
  return value;
}

Drive read_drive(const pb::Drive& message) {
  refuse_unknown(message, "drive");
  Drive drive;
  drive.velocity = read_vec3(message.velocity(), "drive.velocity");
  drive.max_acceleration = message.max_acceleration();
  if (message.has_bounds()) {
    refuse_unknown(message.bounds(), "drive.bounds");
    drive.bounds = Aabb{read_vec3(message.bounds().min(), "drive.bounds.min"),
                        read_vec3(message.bounds().max(), "drive.bounds.max")};
  }
  return drive;
}

PrescribedMotion read_motion(const pb::PrescribedMotion& message) {
  refuse_unknown(message, "motion");
  PrescribedMotion motion;
  motion.velocity = read_vec3(message.velocity(), "motion.velocity");
  motion.amplitude = read_vec3(message.amplitude(), "motion.amplitude");
  motion.frequency = message.frequency();
  motion.phase = message.phase();
  motion.angular_velocity = read_vec3(message.angular_velocity(), "motion.angular_velocity");
  return motion;
}

void write_motion(const PrescribedMotion& motion, pb::PrescribedMotion* message) {
  write_vec3(motion.velocity, message->mutable_velocity());
  write_vec3(motion.amplitude, message->mutable_amplitude());
  message->set_frequency(motion.frequency);
  message->set_phase(motion.phase);
  write_vec3(motion.angular_velocity, message->mutable_angular_velocity());
}

// Whether to write a value at all: all-zero bits are what a missing field reads as (-0.0 is not).
bool is_zero(const Vec3& v) {
  return std::all_of(v.begin(), v.end(), [](double c) { return std::bit_cast<std::uint64_t>(c) == 0; });
}

bool is_identity(const Pose& pose) {
  return is_zero(pose.position) && is_zero(pose.orientation.vec()) && pose.orientation.w() == 1;
}

class SceneReader {
 public:
  SceneReader(const pb::Scene& message, std::string_view source, const MeshLoader& mesh_loader)
      : message_(message), source_(source), mesh_loader_(mesh_loader), masses_(scene_) {}

  Scene read() {
    try {
      read_scene();
      read_materials();
      read_shared_geometry();
    } catch (const FieldError& e) {
      throw SceneError(source_, "", e.field, e.reason);
    }
    assign_ids();
    for (int b = 0; b < message_.body_size(); ++b) {
      Body body;
      body.id = ids_[b];
      body.name = message_.body(b).name();
      try {
        read_body(message_.body(b), body);
      } catch (const FieldError& e) {
        fail(b, label_of(body), e.field, e.reason);
      }
      scene_.bodies.push_back(std::move(body));
    }
    const std::vector<std::size_t> bodies = sort_bodies();
    const std::vector<std::size_t> joints = read_joints();
    try {
      validate(scene_, source_, joints);
    } catch (SceneError& e) {
      if (e.body_index != SceneError::kNoBody) e.body_index = bodies[e.body_index];
      throw;
    }
    return std::move(scene_);
  }

 private:
  [[noreturn]] void fail(std::size_t index, const std::string& label, const std::string& field,
                         const std::string& reason) const {
    throw SceneError(source_, label, field, reason, 0, index);
  }

  void read_scene() {
    refuse_unknown(message_, "");
    scene_.name = message_.name();
    if (message_.has_gravity()) scene_.gravity = read_vec3(message_.gravity(), "gravity");
    if (message_.has_dt()) scene_.dt = message_.dt();
    if (message_.has_model()) read_model(message_.model());
    scene_.territories = read_territories(message_.territory());
    if (message_.has_sleeping()) scene_.sleeping = message_.sleeping();
    if (message_.has_max_speed()) scene_.max_speed = message_.max_speed();
    scene_.territory_cell = message_.territory_cell();
    if (message_.has_body_count() && message_.body_count() != static_cast<std::uint64_t>(message_.body_size()))
      throw FieldError("body_count", "says " + std::to_string(message_.body_count()) + ", but there are " +
                                         std::to_string(message_.body_size()) + " bodies: is the file cut short?");
    if (message_.has_joint_count() && message_.joint_count() != static_cast<std::uint64_t>(message_.joint_size()))
      throw FieldError("joint_count", "says " + std::to_string(message_.joint_count()) + ", but there are " +
                                          std::to_string(message_.joint_size()) + " joints: is the file cut short?");
  }

  void read_model(const pb::Model& model) {
    refuse_unknown(model, "model");
    if (model.has_substeps()) {
      if (model.substeps() == 0)
        throw FieldError("model.substeps", "must be between 1 and " + std::to_string(kMaxSubsteps) +
                                               ", is 0; left out, it is chosen for each island");
      scene_.substeps = model.substeps();
    }
    switch (model.joints()) {
      case pb::Model::CHOSEN:
        return;
      case pb::Model::DIRECT:
        scene_.joint_method = JointMethod::kDirect;
        return;
      case pb::Model::ITERATED:
        scene_.joint_method = JointMethod::kIterated;
        return;
      default:
        throw FieldError("model.joints", "is " + std::to_string(model.joints()) + ", which means nothing");
    }
  }

  void read_materials() {
    for (int m = 0; m < message_.material_size(); ++m) {
      const pb::Material& material = message_.material(m);
      const std::string field = at("material", m);
      refuse_unknown(material, field);
      if (material.name().empty()) throw FieldError(field + ".name", "must not be empty");
      if (material.has_density()) read_density(material.density(), field + ".density");
      if (material.has_friction() && !(material.friction() >= 0 && material.friction() <= kMaxFriction))
        throw FieldError(field + ".friction", "must be between 0 and 100, is " + std::to_string(material.friction()));
      if (material.has_restitution() && !(material.restitution() >= 0 && material.restitution() <= 1))
        throw FieldError(field + ".restitution",
                         "must be between 0 and 1, is " + std::to_string(material.restitution()));
      if (!materials_.emplace(material.name(), &material).second)
        throw FieldError(field + ".name", "is used twice: \"" + material.name() + "\"");
    }
  }

  void read_shared_geometry() {
    for (int g = 0; g < message_.geometry_size(); ++g) {
      const std::string field = at("geometry", g);
      Geometry geometry = read_geometry(message_.geometry(g), field);
      // Whether a plane or mesh may be used is seen at the body that uses it.
      if (auto p = problem_in(geometry, true)) throw FieldError(field + "." + p->field, p->reason);
      intern(std::move(geometry), true);
    }
  }

  // Index of a geometry in the scene's table; equal ones share an entry, except those that the file lists itself.
  std::uint32_t intern(Geometry geometry, bool always_new) {
    pb::Geometry key;
    write_geometry(geometry, &key);
    const auto next = static_cast<std::uint32_t>(scene_.geometries.size());
    const auto [entry, is_new] = geometry_index_.emplace(key.SerializeAsString(), next);
    if (!is_new && !always_new) return entry->second;
    scene_.geometries.push_back(std::move(geometry));
    return next;
  }

  // Given ids stay; bodies without one get the lowest free ones, in order. Two bodies of one id are found by validate.
  void assign_ids() {
    std::unordered_set<BodyId> taken;
    for (const pb::Body& body : message_.body())
      if (body.has_id()) taken.insert(body.id());
    BodyId next = 1;
    for (const pb::Body& body : message_.body()) {
      if (body.has_id()) {
        ids_.push_back(body.id());
        continue;
      }
      while (taken.contains(next)) ++next;
      ids_.push_back(next++);
    }
  }

  void read_body(const pb::Body& message, Body& body) {
    refuse_unknown(message, "");
    body.is_static = message.static_();
    if (message.has_pose()) body.pose = read_pose(message.pose(), "pose");
    if (message.has_linear_velocity()) body.linear_velocity = read_vec3(message.linear_velocity(), "linear_velocity");
    if (message.has_angular_velocity())
      body.angular_velocity = read_vec3(message.angular_velocity(), "angular_velocity");
    body.linear_damping = message.linear_damping();
    body.angular_damping = message.angular_damping();
    if (message.has_drive()) body.drive = read_drive(message.drive());
    if (message.has_motion()) body.motion = read_motion(message.motion());
    body.fixed_rotation = message.fixed_rotation();

    double density = kDefaultDensity;
    if (!message.material().empty()) {
      const auto found = materials_.find(message.material());
      if (found == materials_.end())
        throw FieldError("material", "names no material of this scene: \"" + message.material() + "\"");
      const pb::Material& material = *found->second;
      if (material.has_density()) density = material.density();
      if (material.has_friction()) body.friction = material.friction();
      if (material.has_restitution()) body.restitution = material.restitution();
      if (material.has_colour()) body.colour = material.colour();
    }
    if (message.has_density()) density = read_density(message.density(), "density");
    if (message.has_friction()) body.friction = message.friction();
    if (message.has_restitution()) body.restitution = message.restitution();
    if (message.has_colour()) body.colour = message.colour();
    if (message.has_collision_groups()) body.collision_groups = message.collision_groups();
    if (message.has_collision_mask()) body.collision_mask = message.collision_mask();

    std::vector<double> densities;
    for (int s = 0; s < message.shape_size(); ++s)
      read_shape(message.shape(s), Pose{}, at("shape", s), density, body, densities);
    if (body.is_static) {
      if (message.has_inertial()) refuse_unknown(message.inertial(), "inertial");
    } else {
      read_inertial(message.inertial(), densities, body);
    }
  }

  void read_shape(const pb::Shape& message, const Pose& parent, const std::string& field, double density, Body& body,
                  std::vector<double>& densities) {
    refuse_unknown(message, field);
    Shape shape;
    shape.pose = parent;
    if (message.has_pose()) {
      const Pose own = read_pose(message.pose(), field + ".pose");
      // Products only within compounds, so that a plain shape's pose keeps its bits.
      shape.pose = in_compound_ ? parent * own : own;
      const double drift = shape.pose.orientation.squaredNorm() - 1;
      if (!(drift >= -1e-12 && drift <= 1e-12)) shape.pose.orientation = normalized(shape.pose.orientation);
    }
    if (message.has_density()) density = read_density(message.density(), field + ".density");
    if (message.has_compound()) {
      refuse_unknown(message.compound(), field + ".compound");
      if (message.compound().shape_size() == 0) throw FieldError(field + ".compound", "must have at least one shape");
      const bool outer = std::exchange(in_compound_, true);
      for (int s = 0; s < message.compound().shape_size(); ++s)
        read_shape(message.compound().shape(s), shape.pose, field + ".compound." + at("shape", s), density, body,
                   densities);
      in_compound_ = outer;
      return;
    }
    if (message.kind_case() == pb::Shape::kShared) {
      shape.geometry = message.shared();
      if (shape.geometry >= static_cast<std::uint32_t>(message_.geometry_size()))
        throw FieldError(field + ".shared", "names geometry " + std::to_string(shape.geometry) + " of " +
                                                std::to_string(message_.geometry_size()));
      if (!body.is_static)  // the table was checked for static bodies, which may have more kinds
        if (auto p = problem_in_kind(scene_.geometries[shape.geometry]))
          throw FieldError(field + "." + p->field, p->reason);
    } else {
      Geometry geometry = message.has_mesh_file() ? read_mesh_file(message.mesh_file(), field, body.is_static)
                                                  : read_geometry(message, field);
      if (auto p = problem_in(geometry, body.is_static)) throw FieldError(field + "." + p->field, p->reason);
      shape.geometry = intern(std::move(geometry), false);
    }
    body.shapes.push_back(shape);
    densities.push_back(density);
  }

  // Only what depends on the body being dynamic, without building hulls again.
  static std::optional<Problem> problem_in_kind(const Geometry& geometry) {
    if (std::holds_alternative<ConvexHull>(geometry)) return {};
    return problem_in(geometry, false);
  }

  Geometry read_mesh_file(const pb::MeshFile& file, const std::string& field, bool is_static) const {
    refuse_unknown(file, field + ".mesh_file");
    if (!mesh_loader_)
      throw FieldError(field + ".mesh_file",
                       "mesh files are read by the soda command only: convert the scene with `soda scene convert`");
    try {
      return mesh_loader_(file, file.convex() || !is_static);
    } catch (const std::exception& e) {
      throw FieldError(field + ".mesh_file", e.what());
    }
  }

  void read_inertial(const pb::Inertial& message, const std::vector<double>& densities, Body& body) {
    refuse_unknown(message, "inertial");
    if (message.has_inertia() && !message.has_mass())
      throw FieldError("inertial.mass", "must be given with an inertia");
    if (message.has_centre() && !message.has_inertia())
      throw FieldError("inertial.inertia", "must be given with a centre of mass");
    if (body.shapes.empty()) return;  // refused by validate
    if (message.has_inertia()) {
      const pb::Inertia& i = message.inertia();
      refuse_unknown(i, "inertial.inertia");
      body.inertial.mass = message.mass();
      body.inertial.inertia << i.xx(), i.xy(), i.xz(), i.xy(), i.yy(), i.yz(), i.xz(), i.yz(), i.zz();
      body.inertial.centre = message.has_centre() ? read_vec3(message.centre(), "inertial.centre")
                                                  : masses_.of(body.shapes, densities).centre;
      return;
    }
    body.inertial = masses_.of(body.shapes, densities);
    if (!message.has_mass()) return;
    if (!(message.mass() >= kMinMass && message.mass() <= kMaxMass))
      throw FieldError("inertial.mass", "must be between 1e-09 and 1e+12 kg, is " + std::to_string(message.mass()));
    body.inertial = with_mass(body.inertial, message.mass());
  }

  // By id. Returns, for each, its position in the file.
  std::vector<std::size_t> sort_bodies() {
    std::vector<std::size_t> order(scene_.bodies.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const auto& bodies = scene_.bodies;
    if (!std::is_sorted(bodies.begin(), bodies.end(), [](const Body& l, const Body& r) { return l.id < r.id; })) {
      std::stable_sort(order.begin(), order.end(), [&](auto l, auto r) { return bodies[l].id < bodies[r].id; });
      std::vector<Body> sorted;
      sorted.reserve(order.size());
      for (std::size_t i : order) sorted.push_back(std::move(scene_.bodies[i]));
      scene_.bodies = std::move(sorted);
    }
    return order;
  }

  // Returns, for each in the order of the scene, its position in the file.
  std::vector<std::size_t> read_joints() {
    for (int j = 0; j < message_.joint_size(); ++j) {
      const pb::Joint& joint = message_.joint(j);
      try {
        scene_.joints.push_back(read_joint(joint, scene_));
      } catch (const FieldError& e) {
        throw SceneError(source_, "", joint_field(j, joint.name(), e.field), e.reason);
      }
    }
    std::vector<std::size_t> order(scene_.joints.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t l, std::size_t r) {  // as finish_joints does
      const Joint &left = scene_.joints[l], &right = scene_.joints[r];
      return std::tie(left.a, left.b) < std::tie(right.a, right.b);
    });
    finish_joints(scene_);
    return order;
  }

  const pb::Scene& message_;
  std::string source_;
  const MeshLoader& mesh_loader_;
  Scene scene_;
  MassTable masses_;
  std::vector<BodyId> ids_;  // by position in the file
  std::unordered_map<std::string, const pb::Material*> materials_;
  std::unordered_map<std::string, std::uint32_t> geometry_index_;  // by serialised geometry
  bool in_compound_ = false;
};

}  // namespace

std::vector<Territory> read_territories(const google::protobuf::RepeatedPtrField<pb::Territory>& messages) {
  std::vector<Territory> territories;
  for (int i = 0; i < messages.size(); ++i) {
    const std::string field = "territory[" + std::to_string(i) + "]";
    const pb::Territory& message = messages[i];
    refuse_unknown(message, field);
    if (!message.has_min() || !message.has_max()) throw FieldError(field, "min and max must be given");
    territories.push_back(
        {message.world(), {read_vec3(message.min(), field + ".min"), read_vec3(message.max(), field + ".max")}});
  }
  return territories;
}

pb::Scene to_proto(const Scene& scene) {
  pb::Scene message;
  message.set_body_count(scene.bodies.size());
  message.set_name(scene.name);
  write_vec3(scene.gravity, message.mutable_gravity());
  message.set_dt(scene.dt);
  for (const Territory& t : scene.territories) {
    pb::Territory* out = message.add_territory();
    out->set_world(t.world);
    write_vec3(t.region.min, out->mutable_min());
    write_vec3(t.region.max, out->mutable_max());
  }
  if (scene.substeps != 0) message.mutable_model()->set_substeps(scene.substeps);
  if (scene.joint_method == JointMethod::kDirect) message.mutable_model()->set_joints(pb::Model::DIRECT);
  if (scene.joint_method == JointMethod::kIterated) message.mutable_model()->set_joints(pb::Model::ITERATED);
  message.set_sleeping(scene.sleeping);
  message.set_max_speed(scene.max_speed);
  message.set_territory_cell(scene.territory_cell);
  for (const Geometry& geometry : scene.geometries) write_geometry(geometry, message.add_geometry());
  for (const Body& body : scene.bodies) {
    pb::Body* out = message.add_body();
    out->set_id(body.id);
    out->set_name(body.name);
    out->set_static_(body.is_static);
    write_pose(body.pose, out->mutable_pose());
    for (const Shape& shape : body.shapes) {
      pb::Shape* s = out->add_shape();
      s->set_shared(shape.geometry);
      if (!is_identity(shape.pose)) write_pose(shape.pose, s->mutable_pose());
    }
    out->set_friction(body.friction);
    out->set_restitution(body.restitution);
    out->set_linear_damping(body.linear_damping);
    out->set_angular_damping(body.angular_damping);
    out->set_colour(body.colour);
    if (body.collision_groups != Body{}.collision_groups) out->set_collision_groups(body.collision_groups);
    if (body.collision_mask != Body{}.collision_mask) out->set_collision_mask(body.collision_mask);
    if (body.is_static) continue;
    if (!is_zero(body.linear_velocity)) write_vec3(body.linear_velocity, out->mutable_linear_velocity());
    if (!is_zero(body.angular_velocity)) write_vec3(body.angular_velocity, out->mutable_angular_velocity());
    out->mutable_inertial()->set_mass(body.inertial.mass);
    write_vec3(body.inertial.centre, out->mutable_inertial()->mutable_centre());
    pb::Inertia* inertia = out->mutable_inertial()->mutable_inertia();
    const Mat3& i = body.inertial.inertia;
    inertia->set_xx(i(0, 0)), inertia->set_yy(i(1, 1)), inertia->set_zz(i(2, 2));
    inertia->set_xy(i(0, 1)), inertia->set_xz(i(0, 2)), inertia->set_yz(i(1, 2));
    if (body.motion) write_motion(*body.motion, out->mutable_motion());
    out->set_fixed_rotation(body.fixed_rotation);
    if (!body.drive) continue;
    write_vec3(body.drive->velocity, out->mutable_drive()->mutable_velocity());
    out->mutable_drive()->set_max_acceleration(body.drive->max_acceleration);
    if (!body.drive->bounds) continue;
    write_vec3(body.drive->bounds->min, out->mutable_drive()->mutable_bounds()->mutable_min());
    write_vec3(body.drive->bounds->max, out->mutable_drive()->mutable_bounds()->mutable_max());
  }
  for (const Joint& joint : scene.joints) write_joint(joint, message.add_joint());
  if (!scene.joints.empty()) message.set_joint_count(scene.joints.size());
  return message;
}

Scene from_proto(const pb::Scene& message, std::string_view source, const MeshLoader& mesh_loader) {
  return SceneReader(message, source, mesh_loader).read();
}

}  // namespace soda
