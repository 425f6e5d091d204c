#include "common/import/load.h"

#include "common/import/mesh.h"
#include "common/import/sdf.h"
#include "common/scene/scene_file.h"

namespace soda {

Scene load_any_scene(const std::filesystem::path& path, const ProgressFn& progress,
                     std::vector<std::string>& warnings) {
  const std::string extension = path.extension().string();
  if (extension == ".sdf" || extension == ".world") {
    SdfOptions options;
    options.progress = progress;
    return load_sdf(path, options, warnings);
  }
  if (extension != ".txtpb" && extension != ".scene")
    throw SceneError(path.string(), "", "",
                     "has not the extension of a scene: .txtpb (text), .scene (binary), .sdf or .world (SDF)");
  return load_scene(path, [&](const pb::MeshFile& file, bool convex) {
    MeshRequest request;
    if (file.path().empty()) throw std::runtime_error("path must not be empty");
    request.file = path.parent_path() / file.path();
    if (file.has_scale()) request.scale = Vec3(file.scale().x(), file.scale().y(), file.scale().z());
    request.convex = convex;
    return load_mesh(request);
  });
}

}  // namespace soda
