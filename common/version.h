// Versions that processes compare before they work together.
#pragma once

#include <cstdint>

namespace soda {

// Of everything that crosses between the processes of a session: idl/soda.idl and the payload of border messages.
// Raise it with any change of layout or meaning; daemons of different versions refuse each other.
constexpr std::uint32_t kProtocolVersion = 8;

constexpr const char* kVersion = "0.1.0";  // of the programs, for people

}  // namespace soda
