// SDF worlds (sdformat.org) as scenes. docs/scenes.md says what maps to what.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/import/load.h"
#include "common/scene/scene.h"

namespace soda {

struct SdfOptions {
  ProgressFn progress;
  // libsdformat is slow (about 5 ms for each model that differs from all others), so converted scenes are kept under
  // ${XDG_CACHE_HOME:-~/.cache}/soda, by the content of the SDF file and of every file that it refers to.
  bool use_cache = true;
};

// Throws SceneError. Warnings come from the cache, too.
Scene load_sdf(const std::filesystem::path& path, const SdfOptions& options, std::vector<std::string>& warnings);

}  // namespace soda
