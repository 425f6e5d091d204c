#include "client/export/glb.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>

#include "client/export/glb_container.h"
#include "common/scene/extent.h"
#include "common/scene/tessellation.h"
#include "common/scene/validate.h"
#include "common/version.h"

namespace soda::gltf {
namespace {

constexpr double kSmallestPlane = 20;  // m, edge of the square that stands for a plane
constexpr double kRoughness = 0.8;     // of all materials; none is metal

// A plane is shown under all that the scene has at its start, and some more around it.
double plane_edge(const Scene& scene) {
  std::optional<Aabb> all;
  for (const Body& body : scene.bodies)
    if (const auto box = extent_of(scene, body)) all = all ? merged(*all, *box) : *box;
  double reach = 0;
  for (const Body& body : scene.bodies)
    for (const Shape& shape : body.shapes)
      if (all && std::holds_alternative<Plane>(scene.geometries[shape.geometry])) {
        const Vec3 at = (body.pose * shape.pose).position;
        reach = std::max(reach, (all->max - at).cwiseAbs().cwiseMax((all->min - at).cwiseAbs()).maxCoeff());
      }
  return std::max(kSmallestPlane, 2.5 * reach);
}

// Colours of scenes are sRGB, those of glTF linear (IEC 61966-2-1).
double linear(std::uint32_t channel) {
  const double v = (channel & 0xff) / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

template <class T, std::size_t N>
std::span<const T> flat(const std::vector<std::array<T, N>>& values) {
  return {reinterpret_cast<const T*>(values.data()), N * values.size()};
}

class Document {
 public:
  Document(const Tracks& tracks, const Scene& scene)
      : tracks_(tracks), dt_(scene.dt), table_(TessellationOptions{.plane_edge = plane_edge(scene)}) {
    glb_.json["asset"] = {{"version", "2.0"}, {"generator", std::string("soda ") + kVersion}};
    glb_.json["scene"] = 0;
    glb_.append("scenes", {{"nodes", Json::array({0})}});
    add_nodes(scene.name);
    add_animation(scene.name);
    summary_.bodies = tracks.bodies.size();
    summary_.meshes = table_.meshes().size();
    summary_.seconds = static_cast<double>(tracks.samples.back()) * dt_;
  }

  // Time is written in float, and must ascend.
  bool can_tell_steps_apart() const {
    const Step last = tracks_.samples.back();
    return last == 0 || seconds(last) > seconds(last - 1);
  }

  GlbSummary write(const std::filesystem::path& path, const Progress& progress) {
    summary_.bytes = glb_.write(path, progress);
    return summary_;
  }

 private:
  float seconds(Step step) const { return static_cast<float>(static_cast<double>(step) * dt_); }

  // Node 0 is the root, node i + 1 that of body i. All shapes come first: the table's meshes stay where they are then.
  void add_nodes(const std::string& name) {
    const double half = std::numbers::sqrt2 / 2;  // of a right angle about x
    Json root{{"name", name.empty() ? "scene" : name}, {"rotation", {-half, 0, 0, half}}};
    for (std::size_t i = 0; i < tracks_.bodies.size(); ++i) root["children"].push_back(i + 1);
    glb_.append("nodes", std::move(root));
    std::vector<std::uint32_t> shapes;
    for (const Track& track : tracks_.bodies) shapes.push_back(table_.index_of(*track.scene, *track.body));
    for (std::size_t i = 0; i < tracks_.bodies.size(); ++i) {
      const Track& track = tracks_.bodies[i];
      const Body& body = *track.body;
      Json node{{"name", body.name.empty() ? label_of(body) : body.name},
                {"translation", track.start.position},
                {"rotation", track.start.orientation},
                {"extras", {{"body", body.id}}}};
      if (track.appears > 0) node["scale"] = Json::array({0, 0, 0});
      if (const auto mesh = mesh_of(shapes[i], display_colour(body))) node["mesh"] = *mesh;
      glb_.append("nodes", std::move(node));
    }
  }

  // glTF's meshes have a material each: those of one shape and different colours share their arrays.
  std::optional<std::size_t> mesh_of(std::uint32_t shape, std::uint32_t colour) {
    const bool two_sided = table_.meshes()[shape].two_sided;
    if (table_.meshes()[shape].indices.empty()) return {};
    const auto [mesh, is_new] = meshes_.try_emplace({shape, colour});
    if (!is_new) return mesh->second;
    const auto [primitive, is_new_shape] = primitives_.try_emplace(shape);
    if (is_new_shape) primitive->second = primitive_of(shape);
    Json coloured = primitive->second;
    const auto [material, is_new_colour] = materials_.try_emplace({colour, two_sided});
    if (is_new_colour) material->second = add_material(colour, two_sided);
    coloured["material"] = material->second;
    mesh->second = glb_.append("meshes", {{"primitives", Json::array({std::move(coloured)})}});
    return mesh->second;
  }

  Json primitive_of(std::uint32_t shape) {
    const DisplayMesh& mesh = table_.meshes()[shape];
    const std::size_t positions = glb_.array<float>(View::kPositions, mesh.positions, 3);
    Json low = Json::array(), high = Json::array();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      float least = mesh.positions[axis], most = least;
      for (std::size_t i = axis; i < mesh.positions.size(); i += 3)
        least = std::min(least, mesh.positions[i]), most = std::max(most, mesh.positions[i]);
      low.push_back(least);
      high.push_back(most);
    }
    glb_.json["accessors"][positions]["min"] = std::move(low);
    glb_.json["accessors"][positions]["max"] = std::move(high);
    return {{"attributes", {{"POSITION", positions}, {"NORMAL", glb_.array<float>(View::kNormals, mesh.normals, 3)}}},
            {"indices", glb_.array<std::uint32_t>(View::kIndices, mesh.indices, 1)}};
  }

  std::size_t add_material(std::uint32_t colour, bool two_sided) {
    Json material{{"pbrMetallicRoughness",
                   {{"baseColorFactor",
                     {linear(colour >> 24), linear(colour >> 16), linear(colour >> 8), (colour & 0xff) / 255.0}},
                    {"metallicFactor", 0},
                    {"roughnessFactor", kRoughness}}}};
    if ((colour & 0xff) != 0xff) material["alphaMode"] = "BLEND";
    if (two_sided) material["doubleSided"] = true;
    return glb_.append("materials", std::move(material));
  }

  void add_animation(const std::string& name) {
    for (std::size_t i = 0; i < tracks_.bodies.size(); ++i) {
      const Track& track = tracks_.bodies[i];
      const std::size_t before = samplers_.size();
      const auto all = [](const auto& values, const auto& same) {
        return std::all_of(values.begin(), values.end(), [&](const auto& v) { return v == same; });
      };
      if (!all(track.positions, track.start.position))
        add_channel(i + 1, "translation", times_of(track.steps),
                    glb_.array<float>(View::kVectors, flat(track.positions), 3), "LINEAR");
      if (!all(track.orientations, track.start.orientation))
        add_channel(i + 1, "rotation", times_of(track.steps),
                    glb_.array<float>(View::kRotations, flat(track.orientations), 4), "LINEAR");
      if (track.appears > 0 || track.vanishes) add_presence(i + 1, track);
      summary_.keys += track.steps.size();
      summary_.animated += samplers_.size() > before;
    }
    if (samplers_.empty()) return;
    glb_.append("animations", {{"name", name.empty() ? "run" : name},
                               {"samplers", std::move(samplers_)},
                               {"channels", std::move(channels_)}});
  }

  // Its size is nothing while it is not there.
  void add_presence(std::size_t node, const Track& track) {
    std::vector<std::uint32_t>& steps = presence_.emplace_back(1, 0);
    std::vector<float>& scales = numbers_.emplace_back(3, track.appears > 0 ? 0.f : 1.f);
    const auto add = [&](std::uint32_t step, float scale) {
      steps.push_back(step);
      scales.insert(scales.end(), 3, scale);
    };
    if (track.appears > 0) add(track.appears, 1);
    if (track.vanishes) add(*track.vanishes, 0);
    add_channel(node, "scale", times_of(steps), glb_.array<float>(View::kVectors, scales, 3), "STEP");
  }

  void add_channel(std::size_t node, const char* path, std::size_t input, std::size_t output, const char* how) {
    channels_.push_back({{"sampler", samplers_.size()}, {"target", {{"node", node}, {"path", path}}}});
    samplers_.push_back({{"input", input}, {"output", output}, {"interpolation", how}});
  }

  // The accessor of the times of these steps. Most bodies have keys at all samples from one to another: they share the
  // one array of these; of the rest, those at the same steps share one.
  std::size_t times_of(std::span<const std::uint32_t> steps) {
    const auto [known, is_new] = times_.try_emplace(steps);
    if (!is_new) return known->second;
    const std::span<const std::uint32_t> samples = tracks_.samples;
    if (times_.size() == 1) glb_.add(View::kTimes, std::as_bytes(std::span(seconds_of(samples))));
    const auto first = std::lower_bound(samples.begin(), samples.end(), steps.front());
    const bool in_a_row = static_cast<std::size_t>(samples.end() - first) >= steps.size() &&
                          std::equal(steps.begin(), steps.end(), first);
    const std::uint64_t offset = in_a_row ? static_cast<std::uint64_t>(first - samples.begin()) * sizeof(float)
                                          : glb_.add(View::kTimes, std::as_bytes(std::span(seconds_of(steps))));
    known->second = glb_.accessor(View::kTimes, offset, steps.size(), "SCALAR");
    Json& accessor = glb_.json["accessors"][known->second];
    accessor["min"] = Json::array({seconds(steps.front())});
    accessor["max"] = Json::array({seconds(steps.back())});
    return known->second;
  }
  const std::vector<float>& seconds_of(std::span<const std::uint32_t> steps) {
    std::vector<float>& times = numbers_.emplace_back();
    for (const std::uint32_t step : steps) times.push_back(seconds(step));
    return times;
  }

  struct Before {
    bool operator()(std::span<const std::uint32_t> l, std::span<const std::uint32_t> r) const {
      return std::lexicographical_compare(l.begin(), l.end(), r.begin(), r.end());
    }
  };

  const Tracks& tracks_;
  double dt_;  // s
  GlbContainer glb_;
  GlbSummary summary_;
  DisplayMeshTable table_;
  std::map<std::uint32_t, Json> primitives_;                               // by shape: without material
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> meshes_;  // by shape and colour
  std::map<std::pair<std::uint32_t, bool>, std::size_t> materials_;        // by colour and whether two-sided
  Json samplers_ = Json::array(), channels_ = Json::array();
  std::map<std::span<const std::uint32_t>, std::size_t, Before> times_;  // by steps: accessors
  // What the arrays point into, besides tracks and meshes.
  std::deque<std::vector<float>> numbers_;
  std::deque<std::vector<std::uint32_t>> presence_;
};

}  // namespace

GlbSummary write_glb(const Tracks& tracks, const Scene& scene, const std::filesystem::path& path,
                     const Progress& progress) {
  Document document(tracks, scene);
  if (!document.can_tell_steps_apart())
    throw std::invalid_argument(path.string() + ": in glTF's times (float) its last steps are one: export parts of it");
  return document.write(path, progress);
}

}  // namespace soda::gltf
