#include "common/import/sdf_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sdf/sdf.hh>

#include "common/import/sdf_document.h"
#include "common/import/sdf_pose.h"
#include "common/scene/convex_hull.h"
#include "common/scene/extent.h"
#include "common/scene/validate.h"

namespace soda {
namespace {

constexpr double kSdfFriction = 1;  // SDF's default of <mu>

// A child that the file really has.
sdf::ElementPtr child(const sdf::ElementPtr& element, const char* name) {
  if (!element || !element->HasElement(name)) return nullptr;
  sdf::ElementPtr found = element->GetElement(name);
  return found->GetExplicitlySetInFile() ? found : nullptr;
}

// An ellipsoid by 178 points of its surface.
ConvexHull ellipsoid(const Vec3& radii) {
  constexpr int kRings = 12, kSegments = 16;
  constexpr double kPi = std::numbers::pi;
  ConvexHull hull;
  for (int ring = 0; ring <= kRings; ++ring) {
    double sin_ring = 0, cos_ring = 0;
    sin_cos(kPi * ring / kRings, sin_ring, cos_ring);
    for (int s = 0; s < (ring == 0 || ring == kRings ? 1 : kSegments); ++s) {
      double sin_s = 0, cos_s = 0;
      sin_cos(2 * kPi * s / kSegments, sin_s, cos_s);
      hull.points.push_back(radii.cwiseProduct(Vec3(sin_ring * cos_s, sin_ring * sin_s, cos_ring)));
    }
  }
  hull.points = hull_corners(std::move(hull.points));
  return hull;
}

std::uint32_t colour_of(const ignition::math::Color& c) {
  std::uint32_t rgba = 0;
  for (float part : {c.R(), c.G(), c.B(), c.A()})
    rgba = rgba << 8 | static_cast<std::uint32_t>(std::lround(255 * std::clamp(part, 0.0f, 1.0f)));
  return rgba;
}

}  // namespace

void SdfModelConverter::fail(const std::string& place, const std::string& field, const std::string& reason) const {
  throw SceneError(source_, place, field, reason);
}

ConvertedModel SdfModelConverter::convert(const sdf::Model& model, std::size_t uses) {
  top_ = model.Name();
  uses_ = uses;
  bodies_.clear();
  joints_.clear();
  ConvertedModel result;
  ignition::math::Pose3d in_world;
  for (const sdf::Error& e : model.SemanticPose().Resolve(in_world))
    fail("model \"" + top_ + "\"", "pose", e.Message());
  result.pose = pose_of(in_world);
  if (!model.PlacementFrameName().empty())
    result.placement = compose(inverse(pose_of(model.SemanticPose().RawPose())), result.pose);
  add_model(model, "", Pose{}, false);
  add_joints(model, "");
  for (const Body& body : bodies_) {
    if (body.is_static) continue;
    if (const auto box = extent_of(builder_.scene, body))
      result.radius = std::max(result.radius, box->min.cwiseAbs().cwiseMax(box->max.cwiseAbs()).norm());
  }
  result.bodies = std::move(bodies_);
  result.joints = std::move(joints_);
  return result;
}

// Of an included model; its folder's model.config chose the file. What libsdformat was given as text has no file.
void SdfModelConverter::note_file(const std::filesystem::path& file) {
  std::error_code error;
  if ((!files_.empty() && files_.back() == file) || !std::filesystem::is_regular_file(file, error)) return;
  files_.push_back(file.parent_path() / "model.config");
  files_.push_back(file);
}

void SdfModelConverter::add_model(const sdf::Model& model, const std::string& scope, const Pose& pose, bool is_static) {
  const std::string place = top_ + (scope.empty() ? "" : "::" + scope.substr(0, scope.size() - 2));
  is_static = is_static || model.Static();
  // In the order of the file.
  for (sdf::ElementPtr e = model.Element()->GetFirstElement(); e; e = e->GetNextElement()) {
    note_file(e->FilePath());
    if (e->GetName() == "link") {
      const sdf::Link* link = model.LinkByName(e->Get<std::string>("name"));
      if (link) add_link(*link, scope + link->Name(), pose, is_static);
    } else if (e->GetName() == "model") {
      const sdf::Model* nested = model.ModelByName(e->Get<std::string>("name"));
      if (!nested) continue;
      ignition::math::Pose3d in_parent;
      for (const sdf::Error& error : nested->SemanticPose().Resolve(in_parent))
        fail("model \"" + place + "::" + nested->Name() + "\"", "pose", error.Message());
      add_model(*nested, scope + nested->Name() + "::", compose(pose, pose_of(in_parent)), is_static);
    }
  }
}

void SdfModelConverter::add_link(const sdf::Link& link, const std::string& name, const Pose& model_pose,
                                 bool is_static) {
  const std::string place = "link \"" + top_ + "::" + name + "\"";
  if (link.CollisionCount() == 0) {
    warnings_.add("a <link> without a <collision> is left out: nothing could touch it", top_ + "::" + name, uses_);
    return;
  }
  Body body;
  body.name = name;
  body.is_static = is_static;
  ignition::math::Pose3d in_model;
  for (const sdf::Error& e : link.SemanticPose().Resolve(in_model)) fail(place, "pose", e.Message());
  body.pose = compose(model_pose, pose_of(in_model));
  for (std::uint64_t c = 0; c < link.CollisionCount(); ++c) {
    const sdf::Collision& collision = *link.CollisionByIndex(c);
    const std::string field = "collision \"" + collision.Name() + "\"";
    ignition::math::Pose3d in_link;
    for (const sdf::Error& e : collision.SemanticPose().Resolve(in_link)) fail(place, field + ".pose", e.Message());
    Shape shape;
    shape.pose = pose_of(in_link);
    if (collision.Geom()->Type() == sdf::GeometryType::EMPTY && child(collision.Geom()->Element(), "empty")) continue;
    shape.geometry = read_geometry(*collision.Geom(), place, field + ".geometry", is_static);
    if (auto p = problem_in(builder_.scene.geometries[shape.geometry], is_static))
      fail(place, field + ".geometry." + p->field, p->reason);
    read_surface(collision, top_ + "::" + name + "::" + collision.Name(), body.shapes.empty(), body);
    body.shapes.push_back(shape);
  }
  if (body.shapes.empty()) {
    warnings_.add("a <link> whose geometry is <empty> is left out: nothing could touch it", top_ + "::" + name, uses_);
    return;
  }
  if (!is_static) read_inertial(link, name, body);
  for (std::uint64_t v = 0; v < link.VisualCount(); ++v)
    if (const sdf::Material* material = link.VisualByIndex(v)->Material()) {
      body.colour = colour_of(material->Diffuse());
      break;
    }
  bodies_.push_back(std::move(body));
}

std::uint32_t SdfModelConverter::read_geometry(const sdf::Geometry& geometry, const std::string& place,
                                               const std::string& field, bool is_static) {
  switch (geometry.Type()) {
    case sdf::GeometryType::BOX:
      return builder_.geometry(Box{vec3_of(geometry.BoxShape()->Size())});
    case sdf::GeometryType::SPHERE:
      return builder_.geometry(Sphere{geometry.SphereShape()->Radius()});
    case sdf::GeometryType::CYLINDER:
      return builder_.geometry(Cylinder{geometry.CylinderShape()->Radius(), geometry.CylinderShape()->Length()});
    case sdf::GeometryType::CAPSULE:
      return builder_.geometry(Capsule{geometry.CapsuleShape()->Radius(), geometry.CapsuleShape()->Length()});
    case sdf::GeometryType::ELLIPSOID: {
      const Vec3 radii = vec3_of(geometry.EllipsoidShape()->Radii());
      for (int axis = 0; axis < 3; ++axis)
        if (!(radii[axis] >= kMinSize && radii[axis] <= kMaxSize))
          fail(place, field + ".ellipsoid.radii",
               "must be between 1e-05 and 1e+07 m, is " + std::to_string(radii[axis]));
      warnings_.add("an <ellipsoid> becomes the convex hull of 178 points of its surface", place, uses_);
      return builder_.geometry(ellipsoid(radii));
    }
    case sdf::GeometryType::PLANE: {
      if (!is_static) fail(place, field + ".plane", "is for static models only");
      const Vec3 normal = vec3_of(geometry.PlaneShape()->Normal());
      return builder_.geometry(Plane{normal.norm() > 0 ? normal.normalized() : normal});
    }
    case sdf::GeometryType::MESH:
      return read_mesh(*geometry.MeshShape(), place, field + ".mesh", is_static);
    case sdf::GeometryType::HEIGHTMAP:
      fail(place, field + ".heightmap",
           "heightmap images are not read; use a mesh, or a height_field in a .txtpb scene");
    default:
      break;
  }
  std::string kind;
  if (geometry.Element() && geometry.Element()->GetFirstElement())
    kind = geometry.Element()->GetFirstElement()->GetName();
  fail(place, field, "has no shape that SODA knows" + (kind.empty() ? "" : ": <" + kind + ">"));
}

std::uint32_t SdfModelConverter::read_mesh(const sdf::Mesh& mesh, const std::string& place, const std::string& field,
                                           bool is_static) {
  // Relative to the file that names it, which is another one for an included model.
  std::filesystem::path folder = base_;
  std::error_code error;
  if (std::filesystem::is_regular_file(mesh.FilePath(), error))
    folder = std::filesystem::path(mesh.FilePath()).parent_path();
  MeshRequest request;
  request.file = resolve_uri(mesh.Uri(), folder);
  if (request.file.empty()) request.file = resolve_uri(mesh.Uri(), base_);
  if (request.file.empty()) fail(place, field + ".uri", "is not found: " + mesh.Uri());
  request.scale = vec3_of(mesh.Scale());
  request.convex = !is_static;
  request.submesh = mesh.Submesh();
  request.centre_submesh = mesh.CenterSubmesh();
  std::string key = request.file.string() + "\n" + request.submesh + (request.centre_submesh ? "\ncentred" : "\n");
  for (int axis = 0; axis < 3; ++axis) key += "\n" + std::to_string(std::bit_cast<std::uint64_t>(request.scale[axis]));
  key += request.convex ? "\nhull" : "";
  if (const auto found = meshes_.find(key); found != meshes_.end()) return found->second;
  constexpr std::size_t kManyCorners = 256;  // beyond, the narrow phase becomes slow
  try {
    const Geometry geometry = load_mesh(request, &files_);
    if (const auto* hull = std::get_if<ConvexHull>(&geometry); hull && hull->points.size() > kManyCorners)
      warnings_.add("a convex hull has more than " + std::to_string(kManyCorners) + " corners and will be slow",
                    request.file.filename().string() + ", " + std::to_string(hull->points.size()) + " corners");
    return meshes_[key] = builder_.geometry(geometry);
  } catch (const SceneError&) {
    throw;
  } catch (const std::exception& e) {
    fail(place, field, e.what());
  }
}

// A body has one friction and one restitution: those of its first collision.
void SdfModelConverter::read_surface(const sdf::Collision& collision, const std::string& name, bool first, Body& body) {
  double friction = kSdfFriction, restitution = 0;
  const sdf::ElementPtr surface = child(collision.Element(), "surface");
  if (const sdf::ElementPtr f = child(surface, "friction")) {
    const sdf::ElementPtr ode = child(f, "ode"), bullet = child(f, "bullet");
    if (const sdf::ElementPtr mu = child(ode, "mu")) {
      friction = mu->Get<double>();
      if (const sdf::ElementPtr mu2 = child(ode, "mu2"); mu2 && mu2->Get<double>() != friction)
        warnings_.add("<mu2> differs from <mu>: friction is the same in all directions, <mu> counts", name, uses_);
    } else if (const sdf::ElementPtr coefficient = child(bullet, "friction")) {
      friction = coefficient->Get<double>();
    }
  }
  if (friction > kMaxFriction) {
    warnings_.add("a friction above " + std::to_string(static_cast<int>(kMaxFriction)) + " is taken as that", name,
                  uses_);
    friction = kMaxFriction;
  }
  if (const sdf::ElementPtr e = child(child(surface, "bounce"), "restitution_coefficient"))
    restitution = e->Get<double>();
  if (first) {
    body.friction = friction;
    body.restitution = restitution;
  } else if (friction != body.friction || restitution != body.restitution) {
    warnings_.add("the collisions of a link differ in friction or bounce: those of the first count for the body", name,
                  uses_);
  }
}

void SdfModelConverter::read_inertial(const sdf::Link& link, const std::string& name, Body& body) {
  const sdf::ElementPtr inertial = child(link.Element(), "inertial");
  const auto& given = link.Inertial();
  if (!inertial || !child(inertial, "inertia")) {
    // SDF's defaults (1 kg and 1 kg m^2, whatever the size) are hardly meant: take the shapes.
    body.inertial = masses_.of(body.shapes, kDefaultDensity);
    if (child(inertial, "mass")) {
      body.inertial = with_mass(body.inertial, given.MassMatrix().Mass());
      warnings_.add("an <inertial> without <inertia> gets that of its shapes, at its mass", top_ + "::" + name, uses_);
    } else {
      warnings_.add("a link without <inertial> gets that of its shapes at 1000 kg/m^3", top_ + "::" + name, uses_);
    }
    return;
  }
  body.inertial.mass = given.MassMatrix().Mass();
  body.inertial.centre = vec3_of(given.Pose().Pos());
  const ignition::math::Matrix3d i = given.Moi();  // about the centre of mass, in the link's axes
  for (int r = 0; r < 3; ++r)
    for (int c = r; c < 3; ++c) body.inertial.inertia(r, c) = body.inertial.inertia(c, r) = i(r, c);
}

}  // namespace soda
