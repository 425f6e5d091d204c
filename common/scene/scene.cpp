#include "common/scene/scene.h"

#include <algorithm>

namespace soda {
namespace {

template <class Bodies>
auto* find_in(Bodies& bodies, BodyId id) {
  const auto it = std::lower_bound(bodies.begin(), bodies.end(), id,
                                   [](const Body& body, BodyId wanted) { return body.id < wanted; });
  return it != bodies.end() && it->id == id ? &*it : nullptr;
}

}  // namespace

const Body* find_body(const Scene& scene, BodyId id) { return find_in(scene.bodies, id); }
Body* find_body(Scene& scene, BodyId id) { return find_in(scene.bodies, id); }

}  // namespace soda
