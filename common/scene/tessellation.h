// What a display needs of a scene's bodies: triangles of their shapes, and colours. Looks only: nothing here reaches a
// state. For whatever draws bodies (a viewer, files for other programs), in whatever format.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/scene/scene.h"

namespace soda {

// Vertices are shared where the surface is smooth, and there once for each face where it has an edge.
struct DisplayMesh {
  std::vector<float> positions;        // m, x y z for each vertex
  std::vector<float> normals;          // unit, outward, x y z for each vertex
  std::vector<std::uint32_t> indices;  // three for each triangle, counter-clockwise seen from outside
  // It has a shape that is a sheet (plane, triangle mesh, height field): may be seen from behind, too. Otherwise each
  // shape's surface is closed.
  bool two_sided = false;

  std::size_t vertices() const { return positions.size() / 3; }
};

struct TessellationOptions {
  double plane_edge = 200;      // m: a plane is endless, and shown as a square about its origin of this edge
  std::uint32_t segments = 24;  // of a full circle on spheres, cylinders, capsules; made a multiple of 4, at least 8
};

// In the geometry's own frame. Triangles without area are left out.
DisplayMesh tessellate(const Geometry& geometry, const TessellationOptions& options);

// All shapes of a body, in the frame that poses of bodies are told in while they move: the body's axes about its centre
// of mass. (That of static bodies is the origin of the body's frame.)
DisplayMesh tessellate(const Scene& scene, const Body& body, const TessellationOptions& options);

// Keeps one mesh for all bodies of the same shapes, whatever scenes they come from (each spawned body has its own).
class DisplayMeshTable {
 public:
  explicit DisplayMeshTable(const TessellationOptions& options) : options_(options) {}

  // Of the body's mesh, which is made if it is not there yet.
  std::uint32_t index_of(const Scene& scene, const Body& body);
  const std::vector<DisplayMesh>& meshes() const { return meshes_; }

 private:
  TessellationOptions options_;
  std::unordered_map<std::string, std::uint32_t> index_;  // by the bytes of the shapes
  std::vector<DisplayMesh> meshes_;
};

// The pose of a body where its scene has it, in the frame that its mesh is in.
Pose display_pose(const Body& body);

// RGBA, sRGB. Dynamic bodies for which the scene says no colour get different ones, so that they can be told apart.
std::uint32_t display_colour(const Body& body);

}  // namespace soda
