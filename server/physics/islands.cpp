#include "server/physics/islands.h"

#include <numeric>

namespace soda::physics {

std::uint32_t IslandFinder::root(std::uint32_t i) {
  while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
  return i;
}

void IslandFinder::find(std::size_t bodies, std::span<const Ends> ends, Islands& out) {
  parent_.resize(bodies);
  std::iota(parent_.begin(), parent_.end(), 0u);
  for (const Ends& e : ends) {
    if (e.b == kStaticSlot) continue;
    const std::uint32_t a = root(e.a), b = root(e.b);
    // The lower index is the root, so that islands come out ordered by their first body.
    if (a < b)
      parent_[b] = a;
    else
      parent_[a] = b;
  }
  island_of_.resize(bodies);
  std::uint32_t islands = 0;
  for (std::uint32_t i = 0; i < bodies; ++i) {
    const std::uint32_t r = root(i);
    island_of_[i] = r == i ? islands++ : island_of_[r];
  }
  const auto gather = [&](std::vector<std::uint32_t>& offsets, std::vector<std::uint32_t>& members, std::size_t count,
                          auto&& island) {
    offsets.assign(islands + 1, 0);
    for (std::uint32_t i = 0; i < count; ++i) ++offsets[island(i) + 1];
    for (std::uint32_t k = 0; k < islands; ++k) offsets[k + 1] += offsets[k];
    members.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) members[offsets[island(i)]++] = i;
    for (std::uint32_t k = islands; k > 0; --k) offsets[k] = offsets[k - 1];
    offsets[0] = 0;
  };
  gather(out.body_offsets, out.bodies, bodies, [&](std::uint32_t i) { return island_of_[i]; });
  gather(out.contact_offsets, out.contacts, ends.size(), [&](std::uint32_t i) { return island_of_[ends[i].a]; });
}

}  // namespace soda::physics
