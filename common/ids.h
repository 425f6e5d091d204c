// Names of things that cross processes.
#pragma once

#include <cstdint>

namespace soda {

using BodyId = std::uint64_t;   // unique in a scene, given by it; dynamic and static bodies share one space
using WorldId = std::uint32_t;  // 0 .. number of worlds - 1
using Step = std::int64_t;      // integer time; state 0 is the scene as loaded

constexpr WorldId kMaxWorlds = 4096;  // of a session
constexpr WorldId kNoWorld = 0xffffffffu;

// Ids stay below this bit, so that a contact record can name a static body in the same word (see contact_record.h).
constexpr BodyId kStaticBit = BodyId{1} << 63;
constexpr BodyId kWorldBody = 0;  // what a joint to the world names: no body
constexpr BodyId kMaxBodyId = kStaticBit - 1;

}  // namespace soda
