// What the worlds of a session have computed, step by step, as a viewer needs it: the buffer interface of the paper's
// section 3.3. It holds each world's newest steps, those that may still change included, answers with the bodies of all
// worlds at one step, and never mixes a world's state before a repair with that after it.
//
// Not for several threads at once.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "common/ids.h"
#include "common/table.h"
#include "idl/soda.h"

namespace soda::buffer {

// A body at a step. Immutable; steps in which it did not change share it.
struct Pose {
  std::uint32_t references = 0;
  std::uint8_t flags = 0;                        // wire::VIEW_ASLEEP, VIEW_NEAR, VIEW_MIXED
  std::array<double, 3> position{};              // m, centre of mass
  std::array<float, 4> orientation{0, 0, 0, 1};  // unit quaternion x, y, z, w: body frame to world
  std::array<float, 3> linear{}, angular{};      // m/s, rad/s, world frame
  friend void release(Pose* pose) { delete pose; }
};
// By body index. A copy costs next to nothing; for_each_difference finds what two of them differ in.
using Poses = Table<Pose>;

// Numbers the bodies that are heard of: 0, 1, 2, ...
class BodyIndex {
 public:
  std::uint32_t of(BodyId id);  // a new one where it is not known
  std::optional<std::uint32_t> find(BodyId id) const;
  BodyId id(std::uint32_t index) const { return ids_.at(index); }
  std::uint32_t size() const { return static_cast<std::uint32_t>(ids_.size()); }

 private:
  std::vector<BodyId> ids_;
  std::unordered_map<BodyId, std::uint32_t> index_;
};

// All worlds' bodies at one step. Keeps what it shows alive.
struct View {
  Step step = -1;             // that it shows; -1: nothing yet
  bool anticipated = false;   // some world may still change it
  std::int64_t computed = 0;  // ns since 1970, when the last of the worlds had computed it
  std::vector<Poses> worlds;  // by world
};

class TransformBuffer {
 public:
  explicit TransformBuffer(WorldId worlds);

  // Takes what a world told, in the order in which it came. False: samples before this one are missing, and nothing of
  // this world is heard until a VIEW_WHOLE comes, which the caller should ask for (wire::Lack). Samples of worlds that
  // there are not are ignored.
  bool add(const wire::Transforms& sample);

  // Steps that can be shown: whole in all worlds. newest() < oldest(): none, some world was not heard of yet.
  Step oldest() const;
  Step newest() const;
  Step final_step() const;  // of the slowest world
  // The bodies at step `asked` if all worlds have it, else at the nearest step that they have: that of the lowest front
  // where it is too far ahead.
  View at(Step asked) const;

  // Steps before `step` will not be asked for again: frees them, in all worlds alike. The newest is kept.
  void release_before(Step step);

  // Steps computed, whole and final in one world, as far as it has told.
  Step clock(WorldId world) const;
  Step front(WorldId world) const { return worlds_.at(world).front; }
  Step final_step(WorldId world) const { return worlds_.at(world).final_step; }

  BodyIndex& bodies() { return bodies_; }
  const BodyIndex& bodies() const { return bodies_; }

  // Bodies that a repair changed at some step, in the order in which that was told; numbered. The newest are kept.
  struct Redone {
    std::uint32_t body = 0;
    WorldId world = 0;
    Step step = 0;
  };
  std::uint64_t redone_count() const { return redone_first_ + redone_.size(); }
  // f(redone) for those from number `first` on.
  template <typename F>
  void for_each_redone(std::uint64_t first, F&& f) const {
    for (std::uint64_t i = std::max(first, redone_first_); i < redone_count(); ++i)
      f(redone_[static_cast<std::size_t>(i - redone_first_)]);
  }

 private:
  struct Entry {
    Poses poses;
    std::int64_t computed = 0;
  };
  struct World {
    std::uint64_t number = 0;  // of the sample that comes next; 0: a VIEW_WHOLE is needed
    Step first = 0;            // of entries
    std::deque<Entry> entries;
    Step front = -1, final_step = -1;
    Step last() const { return first + static_cast<Step>(entries.size()) - 1; }
    Step newest() const { return std::min(front, last()); }
  };
  void change(Poses& poses, const wire::Transforms& sample);

  BodyIndex bodies_;
  std::vector<World> worlds_;
  Step released_ = 0;
  std::vector<Poses::Item> items_;
  std::deque<Redone> redone_;
  std::uint64_t redone_first_ = 0;
};

}  // namespace soda::buffer
