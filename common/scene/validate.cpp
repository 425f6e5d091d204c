#include "common/scene/validate.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <unordered_set>

#include "common/scene/convex_hull.h"
#include "common/scene/mass_properties.h"
#include "common/scene/validate_parts.h"

namespace soda {

using namespace checks;

namespace {

std::string message(const std::string& source, const std::string& body, const std::string& field,
                    const std::string& reason, int line) {
  std::string text = source;
  if (line > 0) text += ":" + std::to_string(line);
  for (const std::string* part : {&body, &field, &reason})
    if (!part->empty()) text += (text.empty() ? "" : ": ") + *part;
  return text;
}

MaybeProblem size_in_range(const std::string& field, double value) {
  return in_range(field, value, kMinSize, kMaxSize, " m");
}

constexpr const char* kAxis[] = {"x", "y", "z"};

MaybeProblem vector_in_range(const std::string& field, const Vec3& value, double limit, const char* unit) {
  for (int axis = 0; axis < 3; ++axis)
    if (auto p = in_range(field + "." + kAxis[axis], value[axis], -limit, limit, unit)) return p;
  return {};
}

MaybeProblem coordinates(const std::string& field, const Vec3& value) {
  return vector_in_range(field, value, kMaxCoordinate, " m");
}

// Magnitude of a vector; the components first, so that NaN is named.
MaybeProblem length_in_range(const std::string& field, const Vec3& value, double limit, const char* unit) {
  for (int axis = 0; axis < 3; ++axis)
    if (!std::isfinite(value[axis]))
      return Problem{field + "." + kAxis[axis], "must be a finite number, is " + number(value[axis])};
  if (value.norm() <= limit) return {};
  return Problem{field, "must not be longer than " + number(limit) + unit + ", is " + number(value.norm())};
}

// Well-formed UTF-8 (Protobuf refuses to store anything else) without control characters.
bool is_printable_utf8(const std::string& text) {
  for (std::size_t i = 0; i < text.size();) {
    const unsigned char lead = static_cast<unsigned char>(text[i]);
    const int more = lead < 0x80 ? 0 : lead >> 5 == 6 ? 1 : lead >> 4 == 14 ? 2 : lead >> 3 == 30 ? 3 : -1;
    if (more < 0 || lead < 0x20 || lead == 0x7f || i + more >= text.size()) return false;
    std::uint32_t code = more == 0 ? lead : lead & (0x3fu >> more);
    for (int k = 1; k <= more; ++k) {
      const unsigned char next = static_cast<unsigned char>(text[i + k]);
      if (next >> 6 != 2) return false;
      code = code << 6 | (next & 0x3fu);
    }
    constexpr std::uint32_t kLowest[] = {0, 0x80, 0x800, 0x10000};
    if (code < kLowest[more] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return false;
    i += more + 1;
  }
  return true;
}

struct GeometryCheck {
  bool is_static;

  MaybeProblem operator()(const Sphere& s) const { return size_in_range("sphere.radius", s.radius); }
  MaybeProblem operator()(const Box& b) const {
    for (int axis = 0; axis < 3; ++axis)
      if (auto p = size_in_range(std::string("box.size.") + kAxis[axis], b.size[axis])) return p;
    return {};
  }
  MaybeProblem operator()(const Capsule& c) const {
    if (auto p = size_in_range("capsule.radius", c.radius)) return p;
    return size_in_range("capsule.length", c.length);
  }
  MaybeProblem operator()(const Cylinder& c) const {
    if (auto p = size_in_range("cylinder.radius", c.radius)) return p;
    return size_in_range("cylinder.length", c.length);
  }
  MaybeProblem operator()(const ConvexHull& h) const {
    const std::string field = "convex_hull.points";
    if (h.points.size() < 4) return Problem{field, "must be at least 4 points, are " + std::to_string(h.points.size())};
    if (h.points.size() > kMaxHullPoints)
      return Problem{field, "must be at most " + std::to_string(kMaxHullPoints) + " points"};
    if (auto p = points(field, h.points)) return p;
    if (auto p = extent(field, h.points)) return p;
    if (convex_hull(h.points).triangles.empty()) return Problem{field, "must not all lie in one plane"};
    return {};
  }
  MaybeProblem operator()(const Plane& plane) const {
    if (!is_static) return Problem{"plane", "is for static bodies only"};
    if (!plane.normal.allFinite()) return Problem{"plane.normal", "must be finite"};
    if (!(std::abs(plane.normal.norm() - 1) <= 1e-9)) return Problem{"plane.normal", "must not be zero"};
    return {};
  }
  MaybeProblem operator()(const TriangleMesh& mesh) const {
    if (!is_static) return Problem{"triangle_mesh", "is for static bodies only; a dynamic body needs a convex_hull"};
    if (mesh.vertices.size() < 3) return Problem{"triangle_mesh.vertices", "must be at least 3"};
    if (mesh.triangles.empty()) return Problem{"triangle_mesh.triangles", "must not be empty"};
    if (auto p = points("triangle_mesh.vertices", mesh.vertices)) return p;
    if (auto p = extent("triangle_mesh.vertices", mesh.vertices)) return p;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      for (std::uint32_t v : mesh.triangles[t])
        if (v >= mesh.vertices.size())
          return Problem{"triangle_mesh.triangles[" + std::to_string(3 * t) + "]",
                         "names vertex " + std::to_string(v) + " of " + std::to_string(mesh.vertices.size())};
    return {};
  }
  MaybeProblem operator()(const HeightField& h) const {
    if (!is_static) return Problem{"height_field", "is for static bodies only"};
    for (auto [name, value] : {std::pair{"columns", h.columns}, std::pair{"rows", h.rows}})
      if (auto p = in_range(std::string("height_field.") + name, value, 2, 1 << 16)) return p;
    if (auto p = size_in_range("height_field.spacing_x", h.spacing_x)) return p;
    if (auto p = size_in_range("height_field.spacing_y", h.spacing_y)) return p;
    const std::size_t wanted = std::size_t{h.columns} * h.rows;
    if (h.heights.size() != wanted)
      return Problem{"height_field.heights", "must be columns * rows = " + std::to_string(wanted) + " values, are " +
                                                 std::to_string(h.heights.size())};
    for (std::size_t i = 0; i < h.heights.size(); ++i)
      if (auto p = in_range("height_field.heights[" + std::to_string(i) + "]", h.heights[i], -kMaxCoordinate,
                            kMaxCoordinate, " m"))
        return p;
    if (auto p = in_range("height_field.spacing_x", h.spacing_x * (h.columns - 1), 0, 2 * kMaxCoordinate, " m in all"))
      return p;
    return in_range("height_field.spacing_y", h.spacing_y * (h.rows - 1), 0, 2 * kMaxCoordinate, " m in all");
  }

 private:
  static MaybeProblem points(const std::string& field, const std::vector<Vec3>& values) {
    for (std::size_t i = 0; i < values.size(); ++i)
      if (auto p = coordinates(field + "[" + std::to_string(i) + "]", values[i])) return p;
    return {};
  }
  static MaybeProblem extent(const std::string& field, const std::vector<Vec3>& values) {
    Vec3 low = values[0], high = values[0];
    for (const Vec3& v : values) low = low.cwiseMin(v), high = high.cwiseMax(v);
    return in_range(field, (high - low).maxCoeff(), kMinSize, kMaxSize, " m across");
  }
};

MaybeProblem inertial_problem(const Inertial& inertial) {
  if (auto p = in_range("inertial.mass", inertial.mass, kMinMass, kMaxMass, " kg")) return p;
  if (auto p = coordinates("inertial.centre", inertial.centre)) return p;
  const Mat3& i = inertial.inertia;
  const std::string field = "inertial.inertia";
  if (!i.allFinite()) return Problem{field, "must be finite"};
  if (i != i.transpose()) return Problem{field, "must be symmetric"};
  const Vec3 moments = principal_moments(i);
  if (!(moments[0] > 0))
    return Problem{field, "must be positive definite, its smallest principal moment is " + number(moments[0])};
  if (auto p = in_range(field, std::sqrt(moments[0] / inertial.mass), kMinGyration, kMaxGyration,
                        " m as radius of gyration sqrt(I / m)"))
    return p;
  return in_range(field, std::sqrt(moments[2] / inertial.mass), kMinGyration, kMaxGyration,
                  " m as radius of gyration sqrt(I / m)");
}

MaybeProblem drive_problem(const Drive& drive, double max_speed) {
  if (auto p = length_in_range("drive.velocity", drive.velocity, max_speed, " m/s (the scene's max_speed)")) return p;
  if (auto p = in_range("drive.max_acceleration", drive.max_acceleration, 0, kMaxAcceleration, " m/s^2")) return p;
  if (drive.max_acceleration == 0) return Problem{"drive.max_acceleration", "must be positive, is 0"};
  if (!drive.bounds) return {};
  if (auto p = coordinates("drive.bounds.min", drive.bounds->min)) return p;
  if (auto p = coordinates("drive.bounds.max", drive.bounds->max)) return p;
  for (int axis = 0; axis < 3; ++axis)
    if (!(drive.bounds->min[axis] < drive.bounds->max[axis]))
      return Problem{std::string("drive.bounds.max.") + kAxis[axis], "must be above min"};
  return {};
}

MaybeProblem motion_problem(const Body& body, double max_speed) {
  const PrescribedMotion& motion = *body.motion;
  if (body.drive) return Problem{"drive", "a body that follows a motion has none"};
  if (body.linear_velocity != Vec3::Zero()) return Problem{"linear_velocity", "the body's motion says it"};
  if (body.angular_velocity != Vec3::Zero()) return Problem{"angular_velocity", "the body's motion says it"};
  if (body.fixed_rotation) return Problem{"fixed_rotation", "the body's motion says how it turns"};
  if (auto p = coordinates("motion.velocity", motion.velocity)) return p;
  if (auto p = coordinates("motion.amplitude", motion.amplitude)) return p;
  if (auto p = in_range("motion.frequency", motion.frequency, 0, kMaxFrequency, " Hz")) return p;
  if (motion.frequency == 0 && motion.amplitude != Vec3::Zero())
    return Problem{"motion.frequency", "must be positive where there is an amplitude, is 0"};
  if (auto p = in_range("motion.phase", motion.phase, -100, 100, " rad")) return p;
  if (auto p = length_in_range("motion.angular_velocity", motion.angular_velocity, kMaxSpin, " rad/s")) return p;
  const double fastest = motion.velocity.norm() + 2 * std::numbers::pi * motion.frequency * motion.amplitude.norm() +
                         motion.angular_velocity.norm() * body.inertial.centre.norm();
  if (!(fastest <= max_speed))
    return Problem{"motion", "reaches " + number(fastest) + " m/s; the scene's max_speed is " + number(max_speed)};
  return {};
}

MaybeProblem scene_problem(const Scene& scene) {
  if (auto p = name_problem(scene.name)) return p;
  if (auto p = length_in_range("gravity", scene.gravity, kMaxAcceleration, " m/s^2")) return p;
  if (auto p = in_range("dt", scene.dt, kMinStep, kMaxStep, " s")) return p;
  if (scene.substeps > kMaxSubsteps)
    return Problem{"model.substeps",
                   "must be between 1 and " + std::to_string(kMaxSubsteps) + ", is " + std::to_string(scene.substeps)};
  if (scene.joint_method > JointMethod::kIterated) return Problem{"model.joints", "is of no known kind"};
  if (auto p = in_range("max_speed", scene.max_speed, 0, kMaxSpeedLimit, " m/s")) return p;
  if (scene.max_speed == 0) return Problem{"max_speed", "must be positive, is 0"};
  if (scene.territory_cell != 0)
    if (auto p = size_in_range("territory_cell", scene.territory_cell)) return p;
  for (std::size_t i = 0; i < scene.territories.size(); ++i) {
    const std::string field = "territory[" + std::to_string(i) + "]";
    const Territory& t = scene.territories[i];
    if (auto p = in_range(field + ".world", t.world, 0, kMaxWorlds - 1)) return p;
    if (auto p = coordinates(field + ".min", t.region.min)) return p;
    if (auto p = coordinates(field + ".max", t.region.max)) return p;
    if (!(t.region.min.array() <= t.region.max.array()).all()) return Problem{field + ".max", "must not be below min"};
  }
  if (scene.bodies.empty()) return Problem{"body", "the scene has no bodies"};
  return {};
}

MaybeProblem body_problem(const Scene& scene, const Body& body) {
  if (body.id == 0 || body.id > kMaxBodyId) return Problem{"id", "must be between 1 and 2^63 - 1"};
  if (auto p = name_problem(body.name)) return p;
  if (auto p = pose_problem("pose", body.pose)) return p;
  if (auto p =
          length_in_range("linear_velocity", body.linear_velocity, scene.max_speed, " m/s (the scene's max_speed)"))
    return p;
  if (auto p = length_in_range("angular_velocity", body.angular_velocity, kMaxSpin, " rad/s")) return p;
  if (body.shapes.empty()) return Problem{"shape", "a body needs at least one shape"};
  if (body.shapes.size() > kMaxShapes)
    return Problem{"shape",
                   std::to_string(body.shapes.size()) + " shapes; a body has at most " + std::to_string(kMaxShapes)};
  for (std::size_t s = 0; s < body.shapes.size(); ++s) {
    const Shape& shape = body.shapes[s];
    const std::string field = "shape[" + std::to_string(s) + "]";
    if (shape.geometry >= scene.geometries.size())
      return Problem{field + ".shared", "names geometry " + std::to_string(shape.geometry) + " of " +
                                            std::to_string(scene.geometries.size())};
    if (auto p = pose_problem(field + ".pose", shape.pose)) return p;
  }
  if (auto p = in_range("friction", body.friction, 0, kMaxFriction)) return p;
  if (auto p = in_range("restitution", body.restitution, 0, 1)) return p;
  if (auto p = in_range("linear_damping", body.linear_damping, 0, kMaxDamping, " 1/s")) return p;
  if (auto p = in_range("angular_damping", body.angular_damping, 0, kMaxDamping, " 1/s")) return p;
  if (!body.is_static) {
    if (auto p = inertial_problem(body.inertial)) return p;
    if (body.motion) return motion_problem(body, scene.max_speed);
    if (body.fixed_rotation && body.angular_velocity != Vec3::Zero())
      return Problem{"angular_velocity", "the body has a fixed_rotation"};
    return body.drive ? drive_problem(*body.drive, scene.max_speed) : std::nullopt;
  }
  if (body.motion) return Problem{"motion", "a static body does not move"};
  if (body.fixed_rotation) return Problem{"fixed_rotation", "a static body does not move"};
  if (body.drive) return Problem{"drive", "a static body does not move"};
  if (body.linear_velocity != Vec3::Zero()) return Problem{"linear_velocity", "a static body does not move"};
  if (body.angular_velocity != Vec3::Zero()) return Problem{"angular_velocity", "a static body does not move"};
  return {};
}

}  // namespace

namespace checks {

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

MaybeProblem in_range(const std::string& field, double value, double low, double high, const char* unit) {
  if (value >= low && value <= high) return {};
  const std::string range = "must be between " + number(low) + " and " + number(high) + unit;
  if (!std::isfinite(value)) return Problem{field, "must be a finite number, is " + number(value)};
  return Problem{field, range + ", is " + number(value)};
}

MaybeProblem pose_problem(const std::string& field, const Pose& pose) {
  if (auto p = coordinates(field + ".position", pose.position)) return p;
  const auto& q = pose.orientation.coeffs();
  for (int i = 0; i < 4; ++i)
    if (!std::isfinite(q[i]))
      return Problem{field + ".orientation", "must be a finite quaternion, has a component " + number(q[i])};
  const double length = q.norm();
  if (length == 0) return Problem{field + ".orientation", "must not be the zero quaternion"};
  if (!(std::abs(length - 1) <= 1e-9))
    return Problem{field + ".orientation", "must be a unit quaternion, its length is " + number(length)};
  return {};
}

MaybeProblem name_problem(const std::string& name) {
  if (name.size() > kMaxNameLength)
    return Problem{"name", "must not be longer than " + std::to_string(kMaxNameLength) + " bytes"};
  if (!is_printable_utf8(name)) return Problem{"name", "must be UTF-8 text without control characters"};
  return {};
}

}  // namespace checks

SceneError::SceneError(std::string source_, std::string body_, std::string field_, std::string reason_, int line_,
                       std::size_t body_index_)
    : std::runtime_error(message(source_, body_, field_, reason_, line_)),
      source(std::move(source_)),
      body(std::move(body_)),
      field(std::move(field_)),
      reason(std::move(reason_)),
      line(line_),
      body_index(body_index_) {}

std::string label_of(const Body& body) {
  std::string label = "body " + std::to_string(body.id);
  if (!body.name.empty()) label += " \"" + body.name + "\"";
  return label;
}

std::optional<Problem> problem_in(const Geometry& geometry, bool is_static) {
  return std::visit(GeometryCheck{is_static}, geometry);
}

void validate(const Scene& scene, std::string_view source, std::span<const std::size_t> joint_numbers) {
  if (auto p = scene_problem(scene)) throw SceneError(std::string(source), "", p->field, p->reason);
  // Shared geometry once for each kind of body: hulls are costly to check.
  std::vector<bool> checked[2] = {std::vector<bool>(scene.geometries.size()),
                                  std::vector<bool>(scene.geometries.size())};
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Body& body = scene.bodies[b];
    const auto refuse = [&](const Problem& p) {
      throw SceneError(std::string(source), label_of(body), p.field, p.reason, 0, b);
    };
    if (auto p = body_problem(scene, body)) refuse(*p);
    if (b > 0 && scene.bodies[b - 1].id == body.id) {
      const std::string& other = scene.bodies[b - 1].name;
      refuse({"id", "is also the id of " + (other.empty() ? "another body" : "\"" + other + "\"")});
    }
    if (b > 0 && scene.bodies[b - 1].id > body.id) refuse({"id", "bodies must be in ascending order of their ids"});
    for (std::size_t s = 0; s < body.shapes.size(); ++s) {
      const std::uint32_t g = body.shapes[s].geometry;
      if (checked[body.is_static][g]) continue;
      checked[body.is_static][g] = true;
      if (auto p = problem_in(scene.geometries[g], body.is_static))
        refuse({"shape[" + std::to_string(s) + "]." + p->field, p->reason});
    }
  }
  for (std::size_t g = 0; g < scene.geometries.size(); ++g)
    if (!checked[0][g] && !checked[1][g])  // used by nobody, but it must be sound all the same
      if (auto p = problem_in(scene.geometries[g], true))
        throw SceneError(std::string(source), "", "geometry[" + std::to_string(g) + "]." + p->field, p->reason);
  if (const auto p = problem_in_joints(scene)) {
    const std::size_t number = joint_numbers.empty() ? p->joint : joint_numbers[p->joint];
    throw SceneError(std::string(source), "", joint_field(number, scene.joints[p->joint].name, p->field), p->reason);
  }
}

}  // namespace soda
