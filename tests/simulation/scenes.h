// Scenes that are hard on the protocol, each for a reason of its own.
#pragma once

#include <string>
#include <vector>

#include "common/scene/scene.h"

namespace soda::test {

struct HardScene {
  const char* name;
  Scene (*make)();
  int steps;
  bool mixes;  // islands of several worlds must occur with every number of worlds above one
};
const std::vector<HardScene>& hard_scenes();
const HardScene& hard_scene(const std::string& name);

}  // namespace soda::test
