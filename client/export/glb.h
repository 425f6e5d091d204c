// Tracks as a binary glTF 2.0 file (.glb), for Blender, three.js and whatever else reads it.
//
// A root node turns z up into glTF's y up; below it is one node for each body, with a mesh that equal bodies share.
// Bodies that move have channels of one animation; those that come or go during it are scaled to nothing while they are
// not there, for glTF has no other way to say so. Times are seconds from the first sample.
// Format: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
#pragma once

#include <cstdint>
#include <filesystem>

#include "client/export/tracks.h"

namespace soda::gltf {

struct GlbSummary {
  std::size_t bodies = 0;    // nodes below the root
  std::size_t meshes = 0;    // different shapes
  std::size_t animated = 0;  // bodies with channels
  std::size_t keys = 0;      // of poses, of all bodies together
  double seconds = 0;        // from the first sample to the last
  std::uint64_t bytes = 0;
};

// `progress` gets bytes. It may throw: then no file is written.
// Throws std::invalid_argument for what a .glb cannot hold (4 GiB, or so long that two steps are one in float seconds),
// FileError where the file cannot be written. A file of that name stays as it is until the new one is complete.
GlbSummary write_glb(const Tracks& tracks, const Scene& scene, const std::filesystem::path& path,
                     const Progress& progress = {});

}  // namespace soda::gltf
