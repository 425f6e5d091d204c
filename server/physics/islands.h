// Islands: bodies connected through contacts, static bodies not counted. Union-find over contact records with points;
// overlapping boxes alone connect nothing.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/contact_record.h"

namespace soda::physics {

constexpr std::uint32_t kStaticSlot = 0xffffffffu;

// The two bodies of a record as positions in an array of bodies.
struct Ends {
  std::uint32_t a = 0, b = kStaticSlot;
};

struct Islands {
  // CSR: the bodies and the records of each island, both ascending; islands are ordered by their first body.
  std::vector<std::uint32_t> body_offsets, bodies;
  std::vector<std::uint32_t> contact_offsets, contacts;

  std::size_t size() const { return body_offsets.empty() ? 0 : body_offsets.size() - 1; }
  std::span<const std::uint32_t> bodies_of(std::size_t island) const {
    return std::span(bodies).subspan(body_offsets[island], body_offsets[island + 1] - body_offsets[island]);
  }
  std::span<const std::uint32_t> contacts_of(std::size_t island) const {
    return std::span(contacts).subspan(contact_offsets[island], contact_offsets[island + 1] - contact_offsets[island]);
  }
};

class IslandFinder {
 public:
  // Islands among `bodies` bodies connected by `ends` (one per record).
  void find(std::size_t bodies, std::span<const Ends> ends, Islands& out);

 private:
  std::uint32_t root(std::uint32_t i);
  std::vector<std::uint32_t> parent_, island_of_;
};

}  // namespace soda::physics
