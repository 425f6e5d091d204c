// Some bodies at one step with the contact records that belong to them: the unit in which state is kept, sent and
// saved.
#pragma once

#include <vector>

#include "common/body_state.h"
#include "common/contact_record.h"

namespace soda {

struct BodySet {
  std::vector<BodyState> bodies;        // ascending by id
  std::vector<ContactRecord> contacts;  // in canonical order (record_before); every a is in `bodies`
  void clear() { bodies.clear(), contacts.clear(); }
};

}  // namespace soda
