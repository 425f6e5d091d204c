// Scenes of any size from a name, a number of bodies and a seed. The same arguments give the same bytes on every
// machine.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "common/scene/scene.h"

namespace soda {

struct Generator {
  const char* name;
  const char* summary;  // one line, for --help and docs
};

std::span<const Generator> generators();

constexpr std::uint32_t kMaxGenerated = 4'000'000;

// A scene with exactly `bodies` dynamic bodies, ids 1 .. bodies, and the static bodies that it stands on after them.
// Throws std::invalid_argument for an unknown name (the message lists those known) or an impossible number of bodies.
Scene generate(const std::string& name, std::uint32_t bodies, std::uint64_t seed);

}  // namespace soda
