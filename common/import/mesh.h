// Mesh files (whatever assimp reads: OBJ, STL, DAE, glTF, ...) as geometry.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/scene/scene.h"

namespace soda {

struct MeshRequest {
  std::filesystem::path file;
  Vec3 scale = Vec3::Ones();
  bool convex = false;  // the convex hull, else the triangles
  // One mesh of the file by its name, empty for all; `centre_submesh` moves the middle of its bounding box to the
  // origin.
  std::string submesh;
  bool centre_submesh = false;
};

// Coordinates are taken as the file has them: no axes are swapped. Files hold single precision at best, so each number
// becomes the double of its shortest decimal: what the author wrote. Throws std::runtime_error with the reason.
// The names of all files read (a glTF file has its data in another) are appended to `files_read` where given.
Geometry load_mesh(const MeshRequest& request, std::vector<std::filesystem::path>* files_read = nullptr);

}  // namespace soda
