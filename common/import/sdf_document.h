// An SDF file taken apart before libsdformat sees it. libsdformat's time grows with the square of the models in one
// world, and it reads each model although most worlds repeat a few. So models that nothing refers to and that refer to
// nothing outside (nearly all) are taken out of the world and read once for all that are the same but for name and
// pose; what is left goes to libsdformat as it is.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/import/sdf_population.h"
#include "common/math.h"

namespace soda {

// A model to be read on its own, once.
struct SdfTemplate {
  std::string name;      // of its first instance
  std::string xml;       // the <model> or <include> element, under that name, without its pose
  int line = 0;          // of the first instance in the file
  std::size_t uses = 0;  // how many models it makes
};

// One top-level model (or population), in the order of the file.
struct SdfEntry {
  enum class Kind { kInstance, kPopulation, kInRest };
  Kind kind = Kind::kInstance;
  std::string name;  // not known for kInRest
  int line = 0;
  std::size_t model = 0;     // index of the template; of kInRest: which model of the rest
  std::optional<Pose> pose;  // kInstance: as given
  SdfPopulation population;  // kPopulation
};

struct SdfDocument {
  std::string version;  // of SDF
  std::vector<SdfTemplate> templates;
  std::vector<SdfEntry> entries;
  std::string rest;  // a whole SDF document with the world without those models; empty if the file has no world
};

// Throws SceneError with the line. Paths of <include> are made absolute where they can be found from `base`.
SdfDocument take_apart(const std::string& text, const std::string& source, const std::filesystem::path& base);

// The file or folder that a URI (model://, file://, a path) of a file in folder `base` names; empty if there is none.
// model:// is looked for in `base` and its parents and in the folders of SDF_PATH, GZ_SIM_RESOURCE_PATH,
// IGN_GAZEBO_RESOURCE_PATH and GAZEBO_MODEL_PATH.
std::filesystem::path resolve_uri(const std::string& uri, const std::filesystem::path& base);
// The values of those variables: what else the result depends on.
std::string resource_paths();

}  // namespace soda
