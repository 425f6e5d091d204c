// Bodies by small numbers. A world numbers those that it knows in the order in which it came to know them: what its
// tables hold of them lies close together then, however many bodies there are elsewhere and whatever their ids.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "server/physics/model.h"

namespace soda::timeline {

using Slot = std::uint32_t;
constexpr Slot kNoSlot = std::numeric_limits<Slot>::max();

class Slots {
 public:
  explicit Slots(const physics::Model& model) : model_(model) {}

  // The body's number, or kNoSlot if it has none yet, or is not in the model.
  Slot find(BodyId id) const {
    const std::size_t index = index_of(id);
    return index < slots_.size() ? slots_[index] : kNoSlot;
  }
  // The number of a body of the model, which gets one if it has none.
  Slot of(BodyId id) {
    const std::size_t index = index_of(id);
    if (index >= slots_.size()) slots_.resize(std::max(index + 1, model_.bodies().size()), kNoSlot);
    if (slots_[index] == kNoSlot) {
      slots_[index] = static_cast<Slot>(indices_.size());
      indices_.push_back(static_cast<std::uint32_t>(index));
    }
    return slots_[index];
  }
  const physics::BodyModel& body(Slot slot) const { return model_.bodies()[indices_[slot]]; }
  bool by_id(Slot l, Slot r) const { return indices_[l] < indices_[r]; }

 private:
  std::size_t index_of(BodyId id) const {
    const physics::BodyModel* const body = model_.find(id);
    return body ? static_cast<std::size_t>(body - model_.bodies().data()) : std::numeric_limits<std::size_t>::max();
  }
  const physics::Model& model_;
  std::vector<Slot> slots_;             // by position in Model::bodies(), which does not change
  std::vector<std::uint32_t> indices_;  // the other way round
};

}  // namespace soda::timeline
