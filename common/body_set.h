// Some bodies at one step with the contact records that belong to them: the unit in which state is kept, sent and
// saved.
#pragma once

#include <cstring>
#include <vector>

#include "common/body_state.h"
#include "common/contact_record.h"

namespace soda {

struct BodySet {
  std::vector<BodyState> bodies;        // ascending by id
  std::vector<ContactRecord> contacts;  // in canonical order (record_before); every a is in `bodies`
  void clear() { bodies.clear(), contacts.clear(); }
};

// Bit for bit.
inline bool same(const BodySet& l, const BodySet& r) {
  const auto same_bytes = [](const auto& a, const auto& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0);
  };
  return same_bytes(l.bodies, r.bodies) && same_bytes(l.contacts, r.contacts);
}

}  // namespace soda
