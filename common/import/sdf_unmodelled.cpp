#include "common/import/sdf_unmodelled.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <sdf/sdf.hh>
#include <vector>

namespace soda {
namespace {

// What the import looks at, by parent. A child with an entry of its own is gone into; the others are used whole.
const std::map<std::string, std::vector<std::string>>& understood() {
  static const std::map<std::string, std::vector<std::string>> table = {
      {"world", {"gravity", "physics", "frame", "model", "include", "population"}},
      {"physics", {"max_step_size"}},
      {"model", {"pose", "static", "frame", "link", "model", "include", "joint"}},
      {"joint", {"pose", "parent", "child", "axis", "axis2"}},
      {"axis", {"xyz", "limit", "dynamics"}},
      {"axis2", {"xyz", "limit", "dynamics"}},
      {"limit", {"lower", "upper"}},
      {"dynamics", {}},
      {"link", {"pose", "inertial", "collision", "visual"}},
      {"inertial", {"pose", "mass", "inertia"}},
      {"collision", {"pose", "geometry", "surface"}},
      {"surface", {"friction", "bounce"}},
      {"friction", {"ode", "bullet"}},
      {"ode", {"mu", "mu2"}},
      {"bullet", {"friction"}},
      {"bounce", {"restitution_coefficient"}},
      {"visual", {"material"}},
      {"material", {"diffuse"}},
  };
  return table;
}

// Elements whose absence changes nothing, or that say what SODA does anyway.
bool is_harmless(sdf::Element& element, const std::string& parent) {
  const std::string name = element.GetName();
  if (name == "self_collide" && (parent == "model" || parent == "link")) return element.Get<bool>();
  if (name == "gravity" && parent == "link") return element.Get<bool>();
  for (const char* off : {"kinematic", "enable_wind", "must_be_base_link"})
    if (name == off) return !element.Get<bool>();
  if (parent == "dynamics") return element.Get<double>() == 0;
  // SDF's ways to say that there is no bound.
  if (parent == "limit" && (name == "effort" || name == "velocity"))
    return element.Get<double>() < 0 || element.Get<double>() >= 1e16;
  if (name == "allow_auto_disable") return element.Get<bool>();
  return false;
}

}  // namespace

void warn_of_unmodelled(sdf::Element& element, const std::string& place, std::size_t uses, Warnings& warnings) {
  const std::string parent = element.GetName();
  const auto known = understood().find(parent);
  if (known == understood().end()) return;
  for (sdf::ElementPtr child = element.GetFirstElement(); child; child = child->GetNextElement()) {
    if (!child->GetExplicitlySetInFile()) continue;
    const std::string name = child->GetName();
    std::string where = place;
    if (child->HasAttribute("name")) where += (where.empty() ? "" : "::") + child->Get<std::string>("name");
    if (std::find(known->second.begin(), known->second.end(), name) != known->second.end()) {
      if (name == "visual") {
        warnings.add("<visual> gives its colour only: SODA shows the shapes that collide", where, uses);
      } else {
        warn_of_unmodelled(*child, where, uses, warnings);
      }
    } else if (!is_harmless(*child, parent)) {
      warnings.add("<" + name + "> in <" + parent + "> is not modelled", where, uses);
    }
  }
}

}  // namespace soda
