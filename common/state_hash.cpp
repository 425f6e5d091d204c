#include "common/state_hash.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <cstddef>

namespace soda {

std::uint64_t body_hash(const BodyState& body) {
  // id, position, orientation and both velocities lie in a row; the sleep counter and the flags behind them stay out.
  constexpr std::size_t kHashed = offsetof(BodyState, quiet_steps);
  static_assert(kHashed == 8 + 13 * 8);
  return XXH3_64bits(&body, kHashed);
}

std::uint64_t bodies_hash(std::span<const BodyState> bodies) {
  std::uint64_t sum = 0;
  for (const BodyState& body : bodies) sum += body_hash(body);
  return sum;
}

std::uint64_t record_hash(const BodyState& body) { return XXH3_64bits(&body, sizeof body); }

std::uint64_t full_hash(const BodySet& set) {
  const std::uint64_t bodies = XXH3_64bits(set.bodies.data(), set.bodies.size() * sizeof(BodyState));
  return XXH3_64bits_withSeed(set.contacts.data(), set.contacts.size() * sizeof(ContactRecord), bodies);
}

}  // namespace soda
