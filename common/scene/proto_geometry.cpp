#include "common/scene/proto_geometry.h"

#include <google/protobuf/unknown_field_set.h>

#include <cmath>

#include "common/scene/convex_hull.h"

namespace soda {
namespace {

std::vector<Vec3> read_points(const google::protobuf::RepeatedField<double>& values, const std::string& field) {
  if (values.size() % 3 != 0)
    throw FieldError(field,
                     "must be x, y, z of each point; " + std::to_string(values.size()) + " numbers do not divide by 3");
  std::vector<Vec3> points;
  points.reserve(values.size() / 3);
  for (int i = 0; i < values.size(); i += 3) points.emplace_back(values[i], values[i + 1], values[i + 2]);
  return points;
}

template <class Kinds>
Geometry read_kind(const Kinds& kinds, const std::string& field) {
  switch (kinds.kind_case()) {
    case Kinds::kSphere:
      refuse_unknown(kinds.sphere(), field + ".sphere");
      return Sphere{kinds.sphere().radius()};
    case Kinds::kBox:
      refuse_unknown(kinds.box(), field + ".box");
      return Box{read_vec3(kinds.box().size(), field + ".box.size")};
    case Kinds::kCapsule:
      refuse_unknown(kinds.capsule(), field + ".capsule");
      return Capsule{kinds.capsule().radius(), kinds.capsule().length()};
    case Kinds::kCylinder:
      refuse_unknown(kinds.cylinder(), field + ".cylinder");
      return Cylinder{kinds.cylinder().radius(), kinds.cylinder().length()};
    case Kinds::kConvexHull: {
      refuse_unknown(kinds.convex_hull(), field + ".convex_hull");
      ConvexHull hull{read_points(kinds.convex_hull().points(), field + ".convex_hull.points")};
      // What is wrong with the points as given is told in the file's own numbers.
      if (auto p = problem_in(hull, false)) throw FieldError(field + "." + p->field, p->reason);
      hull.points = hull_corners(std::move(hull.points));
      return hull;
    }
    case Kinds::kPlane: {
      refuse_unknown(kinds.plane(), field + ".plane");
      if (!kinds.plane().has_normal()) return Plane{};
      const Vec3 normal = read_vec3(kinds.plane().normal(), field + ".plane.normal");
      const double squared = normal.squaredNorm();
      if (!(squared > 1e-12 && squared < 1e12)) throw FieldError(field + ".plane.normal", "must be a direction");
      if (std::abs(squared - 1) <= 1e-12) return Plane{normal};
      return Plane{normal / std::sqrt(squared)};
    }
    case Kinds::kTriangleMesh: {
      refuse_unknown(kinds.triangle_mesh(), field + ".triangle_mesh");
      TriangleMesh mesh{read_points(kinds.triangle_mesh().vertices(), field + ".triangle_mesh.vertices"), {}};
      const auto& t = kinds.triangle_mesh().triangles();
      if (t.size() % 3 != 0)
        throw FieldError(field + ".triangle_mesh.triangles", "must be three indices for each triangle");
      for (int i = 0; i < t.size(); i += 3) mesh.triangles.push_back({t[i], t[i + 1], t[i + 2]});
      return mesh;
    }
    case Kinds::kHeightField: {
      const pb::HeightField& h = kinds.height_field();
      refuse_unknown(h, field + ".height_field");
      return HeightField{h.columns(), h.rows(), h.spacing_x(), h.spacing_y(), {h.heights().begin(), h.heights().end()}};
    }
    default:
      throw FieldError(field,
                       "has no shape that this version of SODA knows (sphere, box, capsule, cylinder, "
                       "convex_hull, compound, plane, triangle_mesh, height_field)");
  }
}

struct Writer {
  pb::Geometry* out;

  void operator()(const Sphere& s) const { out->mutable_sphere()->set_radius(s.radius); }
  void operator()(const Box& b) const { write_vec3(b.size, out->mutable_box()->mutable_size()); }
  void operator()(const Capsule& c) const {
    out->mutable_capsule()->set_radius(c.radius);
    out->mutable_capsule()->set_length(c.length);
  }
  void operator()(const Cylinder& c) const {
    out->mutable_cylinder()->set_radius(c.radius);
    out->mutable_cylinder()->set_length(c.length);
  }
  void operator()(const ConvexHull& h) const { write_points(h.points, out->mutable_convex_hull()->mutable_points()); }
  void operator()(const Plane& p) const { write_vec3(p.normal, out->mutable_plane()->mutable_normal()); }
  void operator()(const TriangleMesh& m) const {
    write_points(m.vertices, out->mutable_triangle_mesh()->mutable_vertices());
    for (const auto& t : m.triangles)
      for (std::uint32_t v : t) out->mutable_triangle_mesh()->add_triangles(v);
  }
  void operator()(const HeightField& h) const {
    pb::HeightField* o = out->mutable_height_field();
    o->set_columns(h.columns);
    o->set_rows(h.rows);
    o->set_spacing_x(h.spacing_x);
    o->set_spacing_y(h.spacing_y);
    o->mutable_heights()->Add(h.heights.begin(), h.heights.end());
  }

 private:
  static void write_points(const std::vector<Vec3>& points, google::protobuf::RepeatedField<double>* values) {
    for (const Vec3& p : points)
      for (int axis = 0; axis < 3; ++axis) values->Add(p[axis]);
  }
};

}  // namespace

void refuse_unknown(const google::protobuf::Message& message, const std::string& field) {
  const auto& unknown = message.GetReflection()->GetUnknownFields(message);
  if (!unknown.empty())
    throw FieldError(field, "has a part that this version of SODA does not know (number " +
                                std::to_string(unknown.field(0).number()) + ")");
}

Vec3 read_vec3(const pb::Vec3& v, const std::string& field) {
  refuse_unknown(v, field);
  return Vec3(v.x(), v.y(), v.z());
}

void write_vec3(const Vec3& v, pb::Vec3* out) {
  out->set_x(v.x());
  out->set_y(v.y());
  out->set_z(v.z());
}

Pose read_pose(const pb::Pose& pose, const std::string& field) {
  refuse_unknown(pose, field);
  Pose result;
  if (pose.has_position()) result.position = read_vec3(pose.position(), field + ".position");
  if (!pose.has_orientation()) return result;
  const pb::Quaternion& o = pose.orientation();
  const std::string name = field + ".orientation";
  refuse_unknown(o, name);
  const Quat q(o.w(), o.x(), o.y(), o.z());
  const double squared = q.squaredNorm();
  if (squared == 0) throw FieldError(name, "must not be the zero quaternion");
  if (!q.coeffs().allFinite()) throw FieldError(name, "must be finite");
  if (!(squared > 1e-12 && squared < 1e12)) throw FieldError(name, "must be about of unit length");
  // One that is already of unit length, as far as doubles go, keeps its bits.
  result.orientation = std::abs(squared - 1) <= 1e-12 ? q : normalized(q);
  return result;
}

void write_pose(const Pose& pose, pb::Pose* out) {
  write_vec3(pose.position, out->mutable_position());
  out->mutable_orientation()->set_x(pose.orientation.x());
  out->mutable_orientation()->set_y(pose.orientation.y());
  out->mutable_orientation()->set_z(pose.orientation.z());
  out->mutable_orientation()->set_w(pose.orientation.w());
}

Geometry read_geometry(const pb::Shape& shape, const std::string& field) { return read_kind(shape, field); }

Geometry read_geometry(const pb::Geometry& geometry, const std::string& field) {
  refuse_unknown(geometry, field);
  return read_kind(geometry, field);
}

void write_geometry(const Geometry& geometry, pb::Geometry* out) { std::visit(Writer{out}, geometry); }

}  // namespace soda
