// One door for all scenes, whatever their format.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "common/scene/scene.h"

namespace soda {

// Called now and then during a long conversion: models done, models in all.
using ProgressFn = std::function<void(std::size_t done, std::size_t total)>;

// By extension: .txtpb and .scene (scene_file.h, with mesh files), .sdf and .world (SDF, kept in a cache).
// What the file asks for and SODA does not model is appended to `warnings`, each kind once. Throws SceneError.
Scene load_any_scene(const std::filesystem::path& path, const ProgressFn& progress, std::vector<std::string>& warnings);

}  // namespace soda
