// SDF's <population>: many copies of a model, placed by a rule. libsdformat leaves it to us.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/math.h"

namespace tinyxml2 {
class XMLElement;
}

namespace soda {

class Warnings;

struct SdfPopulation {
  enum class Rule { kRandom, kUniform, kGrid, kLinearX, kLinearY, kLinearZ };
  std::string name;
  Rule rule = Rule::kRandom;
  Pose pose;                      // of the region
  std::optional<Vec3> box;        // m, edges of a box region
  double radius = 0, length = 0;  // m, of a cylinder region along z, where there is no box
  std::size_t count = 1;
  std::size_t rows = 1, columns = 1;  // kGrid, which does not use `count`
  Vec3 step = Vec3(0.5, 0.5, 0);      // m, kGrid
};

// Throws SceneError.
SdfPopulation read_population(const tinyxml2::XMLElement& element, const std::string& source);

// Where the copies are, in the world. Random places depend on the population's name only, and keep models of that
// radius (m) apart where they find room; where they do not, `warnings` says so.
std::vector<Pose> places(const SdfPopulation& population, double model_radius, Warnings& warnings);

// An SDF <pose> element. None if it is malformed or relative to something (`relative_to` and the like).
std::optional<Pose> read_plain_pose(const tinyxml2::XMLElement& element);

}  // namespace soda
