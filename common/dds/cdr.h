// The wire types of idl/soda.idl as bytes, and the one door through which everything that came from outside passes.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "idl/soda.h"

namespace soda::dds {

// Plain CDR with its 4 bytes of encapsulation, as DDS sends it.
template <class T>
std::vector<std::byte> encode(const T& sample);

// Takes apart and checks what came from outside. Returns "" and fills `out`, or returns why it is refused.
// A Session or Join of another protocol version passes, whatever else it holds, with only `protocol` to be relied on:
// the receiver compares it first and says so.
template <class T>
std::string decode(std::span<const std::byte> bytes, T& out);

}  // namespace soda::dds
