// A scene as pages are told it: meshes, bodies, what stands still, territories.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/ids.h"
#include "common/scene/tessellation.h"
#include "common/territory.h"
#include "viewer.pb.h"

namespace soda::viewer {

class SceneModel {
 public:
  // `worlds` 0: there are no territories to show.
  SceneModel(const Scene& scene, WorldId worlds);

  void add(BodyId id, const Scene& shape);  // spawned: a scene of that body alone
  bool has(BodyId id) const { return bodies_.contains(id); }

  std::size_t cells() const { return welcome_.grid().owner().size() / sizeof(std::uint16_t); }  // of the territory grid
  void fill(view::Welcome& welcome) const;  // scene, dt, gravity, box, grid, statics, the meshes so far
  std::uint32_t meshes() const { return static_cast<std::uint32_t>(meshes_.meshes().size()); }
  void add_mesh(std::uint32_t number, view::Mesh& mesh) const;
  // Adds the body to the list; one that is not known has a mesh that there is not.
  void list(BodyId id, view::BodyList& list) const;

 private:
  struct Looks {
    std::uint32_t mesh = 0, colour = 0;
    double mass = 0;
  };
  Looks looks(const Scene& scene, const Body& body);
  void compare_meshes();

  DisplayMeshTable meshes_;
  // By mesh: one with triangles of its own, which it is like but for its size along the axes.
  struct Likeness {
    std::uint32_t mesh = 0;
    Vec3 stretch = Vec3::Ones();
  };
  std::vector<Likeness> like_;
  std::unordered_map<std::string, std::uint32_t> of_shape_;  // the first of each shape, whatever size
  std::unordered_map<BodyId, Looks> bodies_;
  view::Welcome welcome_;  // all but meshes
};

// Little-endian arrays as they are in messages.
template <class T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace soda::viewer
