// The digest by which runs are compared.
#pragma once

#include <cstdint>
#include <span>

#include "common/body_set.h"

namespace soda {

// 64-bit hash (XXH3) of one body's id, position, quaternion, linear and angular velocity, raw bits.
std::uint64_t body_hash(const BodyState& body);

// Sum modulo 2^64 of the bodies' hashes: the sums of several worlds add up to that of the whole.
std::uint64_t bodies_hash(std::span<const BodyState> bodies);

// Hash of a body's whole state, sleep counter and flags included.
std::uint64_t record_hash(const BodyState& body);

// Hash of everything in a set, sleep counters, flags and contact records included: for purity tests and dumps.
std::uint64_t full_hash(const BodySet& set);

}  // namespace soda
