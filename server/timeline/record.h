// What is known of one body at one step: its state and the contact records that belong to it. Immutable, shared by all
// entries in which it stays the same.
#pragma once

#include <cstdint>
#include <span>

#include "common/body_state.h"
#include "common/contact_record.h"
#include "common/ids.h"
#include "common/ref.h"

namespace soda::timeline {

// Where a body is, as those see it who divide space among worlds: a function of its state, the step and the world
// asked.
struct Place {
  WorldId owner = 0;
  bool wide = false;    // its reach box reaches more than half a cell from its centre along an axis, and this world
  bool inside = false;  // nobody but its owner can have anything to do with it
};

struct Record {
  BodyState body;
  Place place;
  std::uint64_t hash = 0;  // body_hash of `body`
  Step computed = -1;      // the step that it was computed for here; -1: heard of, or given
  std::uint32_t references = 0;
  std::uint32_t count = 0;  // contact records, right behind this

  std::span<const ContactRecord> contacts() const { return {reinterpret_cast<const ContactRecord*>(this + 1), count}; }
};
static_assert(sizeof(Record) % alignof(ContactRecord) == 0);

// Memory is kept for the next record of the same size: steps make and drop records by the thousand.
void release(Record* record);
Ref<Record> make_record(const BodyState& body, std::span<const ContactRecord> contacts, const Place& place,
                        Step computed);

// The records of body `id`, which `rest` begins with; `rest` goes on behind them.
inline std::span<const ContactRecord> take_contacts(std::span<const ContactRecord>& rest, BodyId id) {
  std::size_t n = 0;
  while (n < rest.size() && rest[n].a == id) ++n;
  const auto taken = rest.first(n);
  rest = rest.subspan(n);
  return taken;
}

// Bit for bit, contact records included.
bool same(const Record& record, const BodyState& body, std::span<const ContactRecord> contacts);
inline bool same(const Record& l, const Record& r) { return &l == &r || same(l, r.body, r.contacts()); }

}  // namespace soda::timeline
