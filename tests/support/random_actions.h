// Actions as users might do them, out of one number: on bodies of the scene and on those that they spawn.
#pragma once

#include <cstdint>
#include <vector>

#include "common/actions/action.h"
#include "common/scene/scene.h"

namespace soda::test {

// At most `count`, at steps 1 .. `steps`. `ascending`: as a session logs what comes while it runs; else as a file may
// have them, in any order.
std::vector<LoggedAction> random_actions(const Scene& scene, Step steps, std::size_t count, bool ascending,
                                         std::uint64_t seed);

}  // namespace soda::test
