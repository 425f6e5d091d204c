#include "client/viewer/scene_model.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace soda::viewer {
namespace {

static_assert(std::endian::native == std::endian::little, "packed arrays are written as they are in memory");

constexpr std::uint32_t kNoMesh = 0xffffffff;
constexpr std::uint32_t kUnknownColour = 0x808080ff;

// A plane is shown as a square that reaches well beyond all bodies.
TessellationOptions options_for(const Scene& scene) {
  Eigen::AlignedBox3d box;
  for (const Body& body : scene.bodies)
    if (!body.is_static) box.extend(body.pose.position);
  TessellationOptions options;
  if (!box.isEmpty()) options.plane_edge = std::max(options.plane_edge, 4 * box.diagonal().norm());
  return options;
}

template <class T>
std::string packed(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

// Half of the box about the origin that holds it; 1 along an axis in which it is flat.
Vec3 extents(const DisplayMesh& mesh) {
  Vec3 size = Vec3::Zero();
  for (std::size_t k = 0; k < mesh.positions.size(); ++k)
    size[static_cast<int>(k % 3)] = std::max<double>(size[static_cast<int>(k % 3)], std::abs(mesh.positions[k]));
  for (int axis = 0; axis < 3; ++axis)
    if (!(size[axis] > 0)) size[axis] = 1;
  return size;
}

// Equal for meshes that are equal once they are stretched to extents of 1. Rounded, because sizes are.
std::string shape_key(const DisplayMesh& mesh, const Vec3& size) {
  std::vector<std::int16_t> rounded(mesh.positions.size());
  for (std::size_t k = 0; k < rounded.size(); ++k)
    rounded[k] = static_cast<std::int16_t>(std::lround(8192 * mesh.positions[k] / size[static_cast<int>(k % 3)]));
  return packed(rounded) + packed(mesh.indices);
}

template <class List>
void add_vector(List& list, const Vec3& v) {
  for (int i = 0; i < 3; ++i) list.Add(v[i]);
}

}  // namespace

SceneModel::SceneModel(const Scene& scene, WorldId worlds) : meshes_(options_for(scene)) {
  welcome_.set_scene(scene.name);
  welcome_.set_dt(scene.dt);
  add_vector(*welcome_.mutable_gravity(), scene.gravity);
  Eigen::AlignedBox3d box;
  for (const Body& body : scene.bodies) {
    const Looks what = looks(scene, body);
    const Pose pose = display_pose(body);
    if (!body.is_static) {
      bodies_.emplace(body.id, what);
      const Vec3 radius = Vec3::Constant(bounding_radius(scene, body));
      box.extend(pose.position - radius);
      box.extend(pose.position + radius);
      continue;
    }
    view::Static& still = *welcome_.add_statics();
    still.set_mesh(what.mesh);
    add_vector(*still.mutable_position(), pose.position);
    for (int i = 0; i < 4; ++i) still.add_orientation(pose.orientation.coeffs()[i]);
    still.set_colour(what.colour);
  }
  compare_meshes();
  if (box.isEmpty()) box.extend(Vec3::Zero());
  add_vector(*welcome_.mutable_low(), box.min());
  add_vector(*welcome_.mutable_high(), box.max());
  if (worlds == 0) return;
  const TerritoryMap map = initial_territories(scene, make_grid(scene), worlds);
  view::Grid& grid = *welcome_.mutable_grid();
  add_vector(*grid.mutable_origin(), map.grid.origin);
  grid.set_edge(map.grid.edge);
  for (const std::int32_t cells : map.grid.size) grid.add_size(cells);
  for (const WorldId owner : map.owner) append(*grid.mutable_owner(), static_cast<std::uint16_t>(owner));
}

SceneModel::Looks SceneModel::looks(const Scene& scene, const Body& body) {
  return {meshes_.index_of(scene, body), display_colour(body), body.inertial.mass};
}

void SceneModel::add(BodyId id, const Scene& shape) {
  bodies_.emplace(id, looks(shape, shape.bodies.front()));
  compare_meshes();
}

void SceneModel::compare_meshes() {
  for (auto number = static_cast<std::uint32_t>(like_.size()); number < meshes(); ++number) {
    const DisplayMesh& mesh = meshes_.meshes()[number];
    const Vec3 size = extents(mesh);
    const std::uint32_t first = of_shape_.try_emplace(shape_key(mesh, size), number).first->second;
    like_.push_back({first, size.cwiseQuotient(extents(meshes_.meshes()[first]))});
  }
}

void SceneModel::fill(view::Welcome& welcome) const {
  welcome.MergeFrom(welcome_);
  for (std::uint32_t number = 0; number < meshes(); ++number) add_mesh(number, *welcome.add_meshes());
}

void SceneModel::add_mesh(std::uint32_t number, view::Mesh& mesh) const {
  const DisplayMesh& from = meshes_.meshes().at(number);
  if (const Likeness& like = like_.at(number); like.mesh != number) {
    mesh.set_like(like.mesh);
    add_vector(*mesh.mutable_stretch(), like.stretch);
  } else {
    mesh.set_positions(packed(from.positions));
    mesh.set_normals(packed(from.normals));
    mesh.set_indices(packed(from.indices));
  }
  double radius = 0;
  for (std::size_t v = 0; v < from.vertices(); ++v)
    radius = std::max<double>(radius,
                              std::hypot(from.positions[3 * v], from.positions[3 * v + 1], from.positions[3 * v + 2]));
  mesh.set_radius(radius);
}

void SceneModel::list(BodyId id, view::BodyList& list) const {
  const auto known = bodies_.find(id);
  const Looks what = known != bodies_.end() ? known->second : Looks{kNoMesh, kUnknownColour, 0};
  list.add_id(id);
  list.add_mesh(what.mesh);
  list.add_colour(what.colour);
  list.add_mass(what.mass);
}

}  // namespace soda::viewer
