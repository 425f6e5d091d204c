// The circular buffer of a world's states, and the one operation that both advances and repairs them.
//
// Entry t holds what the world knows of step t: the bodies that it produced there, those that others told it of, the
// islands found at t, and the bodies that are `pending`: whose step t -> t + 1 is still to be done, or to be done
// again. A new entry starts as a copy of the one before it, which shares all its memory: what nothing pending touches
// moves on unchanged. Whatever arrives or is computed for t is stored; bodies whose record appears, differs or vanishes
// join pending(t). So the cost of an entry and of a repair grows with what changed in it, not with the world.
//
// A timeline knows physics, and nothing of networks: whom space belongs to, and which islands must wait, it asks an
// Arbiter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "common/body_set.h"
#include "common/recycled.h"
#include "common/table.h"
#include "server/physics/stepper.h"
#include "server/timeline/effects.h"
#include "server/timeline/marks.h"
#include "server/timeline/record.h"
#include "server/timeline/slots.h"
#include "server/timeline/spatial_index.h"

namespace soda::timeline {

// Bodies that must be solved together at a step, as far as this world sees.
struct Island : Recycled<Island> {
  std::uint32_t references = 0;
  std::uint32_t owned = 0;
  std::vector<Slot> members;  // own ones, then foreign ones; each ascending by id
  std::span<const Slot> own() const { return std::span(members).first(owned); }
  std::span<const Slot> foreign() const { return std::span(members).subspan(owned); }
  friend void release(Island* island) { delete island; }
};

// Bodies that somebody else produced at a step, ascending by slot.
struct NearSet {
  struct Body {
    Slot slot;
    Ref<Record> record;
  };
  std::uint32_t references = 0;
  std::vector<Body> bodies;
  const Record* find(Slot slot) const;
  friend void release(NearSet* set) { delete set; }
};
// The sleeping bodies among them: what is assumed at the step after when nothing is told. May be `set` itself.
Ref<NearSet> sleepers(const Ref<NearSet>& set);
// Bit for bit.
bool same(const NearSet& l, const NearSet& r);

// An island as found at a step, before it is solved.
struct Found {
  Ref<Island> island;
  BodySet own;                         // its own bodies, and all its contacts, as found
  std::vector<const Record*> foreign;  // the records of its foreign members; valid for the call only
  std::vector<Aabb> boxes;             // reach boxes of the own bodies
  bool wide = false;                   // an own body is wide
};

class Arbiter {
 public:
  virtual ~Arbiter() = default;
  virtual Place place(const BodyState& body, Step step) const = 0;
  // Whether space changes hands at `step`; and then, whether that can matter to whoever has to do with a body.
  virtual bool places_change(Step step) const = 0;
  virtual bool place_changes(const BodyState& body, Step step) const = 0;
  // Entry `step` has been made, as a copy of the one before.
  virtual void extended(Step step) = 0;
  // A new round of finding islands at `step` begins; `all`: no island found there before stands. Returns whether any
  // island may have to wait.
  virtual bool finding(Step step, bool all) = 0;
  // An island found at `step` before does not stand any more.
  virtual void dropped(Step step, const Island& island) = 0;
  // Whether an island of own bodies only, with these reach boxes, must wait.
  virtual bool must_wait(Step step, std::span<const Aabb> boxes) = 0;
  // An island that must wait, or has foreign or wide bodies: whoever is told settles it.
  virtual void keep(Step step, Found found) = 0;
};

struct TimelineStats {
  std::uint64_t steps = 0;            // entries advanced to
  std::uint64_t bodies_computed = 0;  // results computed, first or again
  std::uint64_t bodies_redone = 0;  // results that replaced those of a step that had been there, also of bodies at rest
  std::uint64_t steps_redone = 0;   // rounds in which there were any
  std::uint64_t longest_rollback = 0;  // steps from a change to the clock, at most
  std::uint64_t handed_over = 0;       // bodies that became others' because space changed hands
};

class Timeline {
 public:
  // As piece_bodies: a round is done at once.
  static constexpr std::size_t kWhole = std::numeric_limits<std::size_t>::max();

  // `model` and `arbiter` must outlive it. Entry 0 holds the scene's bodies that lie in `me`'s territory, all pending.
  // `piece_bodies`: of islands of which nobody hears (see finish) so many bodies are done at a time, or more where that
  // would make very many pieces.
  Timeline(const physics::Model& model, WorldId me, std::size_t sources, Arbiter& arbiter,
           std::size_t piece_bodies = kWhole);

  Step oldest() const { return base_; }
  Step newest() const { return base_ + static_cast<Step>(entries_.size()) - 1; }

  // One more source, which has produced nothing so far that matters here.
  void add_source();
  // `source` produced these bodies at `step`, and no others that matter here. For steps to come, too.
  void hear(std::size_t source, Step step, Ref<NearSet> set);
  Ref<NearSet> near_set(const BodySet& set, Step step);  // of bodies received
  const Ref<NearSet>& heard(std::size_t source, Step step) const { return at(step).heard[source]; }

  // The next entry of the action log: changes what has been computed of its step and, of what lasts, of later ones. The
  // step may be any from oldest() + 1 on; a body that it spawns must be in the model already.
  void act(const LoggedAction& action);

  bool has_pending(Step step) const { return !at(step).pending.empty(); }
  std::span<const Slot> pending(Step step) const { return at(step).pending; }
  // Does step -> step + 1 for what is pending and what that affects, in parts: `process` finds the islands and hands
  // those that must wait to the arbiter; each call of `finish` solves some of the others, until unfinished() is -1.
  // First those of which others may hear: bodies that are inside (Place) at `step` are rarely heard of at the next (if
  // one is, that is news of step + 1 like any other), but where something is done to them there. In between, the
  // arbiter's news may be sent, islands settled, and more may be heard. Makes the entry `step + 1` if it is not there.
  void process(Step step);
  void finish();
  Step unfinished() const { return unfinished_; }  // the step of a round that waits for finish(), else -1
  // The same as long as that round has islands of which others may hear.
  Step unfinished_outside() const { return pieces_done_ < outside_pieces_ ? unfinished_ : -1; }
  // Results of own bodies of islands that the arbiter kept.
  void settle(Step step, const BodySet& results);
  // Does all of an entry's step again, for tests: what it finds must be what is there.
  void touch(Step step, std::span<const Slot> slots);

  const Record* known(Step step, Slot slot) const;
  const Record* produced(Step step, Slot slot) const { return at(step).produced.get(slot); }
  Ref<Record> share(Step step, Slot slot) const { return Ref<Record>(at(step).produced.get(slot)); }
  bool own(const Record& record) const { return record.place.owner == me_; }
  // What this world produced at `step`: number, sum of the hashes, and all of it.
  std::size_t count(Step step) const { return at(step).count; }
  std::uint64_t hash(Step step) const { return at(step).hash; }
  BodySet all_produced(Step step) const;
  // All of that as it is now; a copy costs next to nothing, and keeps the records alive.
  const Table<Record>& states(Step step) const { return at(step).produced; }
  // Whether it was found at `step` to touch bodies of others, directly or through its own.
  bool touches_foreign(Step step, Slot slot) const {
    const Island* const island = at(step).islands.get(slot);
    return island && !island->foreign().empty();
  }
  // f(record) for every body that this world produced at `step` and that is another's there.
  template <typename F>
  void for_each_departed(Step step, F&& f) const {
    for (const Slot slot : at(step).departed) f(*at(step).produced.get(slot));
  }
  // f(slot, record) for every wide body that is known at `step` and is not own, in no order; some twice.
  template <typename F>
  void for_each_foreign_wide(Step step, F&& f) const {
    const Entry& entry = at(step);
    for (const Slot slot : entry.departed)
      if (const Record& record = *entry.produced.get(slot); record.place.wide) f(slot, record);
    for (const Ref<NearSet>& heard : entry.heard)
      for (const NearSet::Body& b : heard->bodies)
        if (b.record->place.wide && !own(*b.record)) f(b.slot, *b.record);
  }
  // Bodies whose produced record at `step` changed since the last call, ascending; without those that nobody else had
  // to do with before, and has now (inside).
  void take_changed(Step step, std::vector<Slot>& changed);
  bool inside(const Record& record) const { return record.place.inside && own(record); }

  // For tests: the index finds every record of every entry.
  bool is_indexed() const;

  // Entries before `step` are not needed any more.
  void release_before(Step step);

  // kNoSlot for a body that this world has never known.
  Slot slot_of(BodyId id) const { return slots_.find(id); }
  BodyId id_of(Slot slot) const { return slots_.body(slot).id; }
  physics::Stepper& stepper() { return stepper_; }
  const physics::Model& model() const { return model_; }
  const TimelineStats& stats() const { return stats_; }

 private:
  struct Entry {
    Table<Record> produced;
    Table<Island> islands;
    std::vector<Ref<NearSet>> heard;  // by source
    std::vector<Slot> pending, changed;
    std::vector<Slot> departed;       // produced here, and not own any more; ascending
    std::map<Slot, Ref<Record>> raw;  // results of bodies that something is done to, before it is
    std::size_t count = 0;
    std::uint64_t hash = 0;
  };
  Entry& at(Step step) { return entries_.at(static_cast<std::size_t>(step - base_)); }
  const Entry& at(Step step) const { return entries_.at(static_cast<std::size_t>(step - base_)); }
  void extend();
  Ref<Record> moved(const Record& record, Step step) const;
  Ref<NearSet> moved(Ref<NearSet> set, Step step) const;
  void change_hands(Step step);
  void assume(std::size_t source, Step step);
  bool is_large(Slot slot, const BodyState& body) const;
  void note(Slot slot, const BodyState& body);
  void note_repaired(Slot slot, const BodyState& body, Step step);
  void note_newest(Slot slot);
  void affect(Step step, Slot slot);
  void affect_island(Step step, Slot slot);
  void affect_touched(Step step, const Record& foreign);
  static void set_departed(Entry& entry, Slot slot, bool departed);
  void take_away(Step step, Slot slot);
  void drop(Step step, Slot slot);
  void add_around(Step step, Slot slot);
  void add_around(Slot slot, const Record& record);
  void gather(Step step, std::size_t first_affected);
  void gather_all(Step step);
  void find();
  bool concerned(std::uint32_t island) const;
  bool grown(Step step);
  void sort_out(Step step, bool all);
  void divide();
  void keep(Step step, std::uint32_t island, Ref<Island> members);
  void do_actions(Step step, BodyId id);
  Ref<Record> after_actions(Step step, BodyId id, const Record* raw) const;
  void take_result(Step step, Slot slot, const BodyState& body, std::span<const ContactRecord> contacts);
  void take_acted(Step step, Slot slot, const BodyState& body, std::span<const ContactRecord> contacts);
  void store(Step step, std::vector<Table<Record>::Item>& items);

  const physics::Model& model_;
  Slots slots_;
  const WorldId me_;
  Arbiter& arbiter_;
  const std::size_t piece_bodies_;
  physics::Stepper stepper_;
  SpatialIndex index_;
  Marks ever_heard_;             // bodies that others have told of
  std::vector<Slot> unsettled_;  // scratch of assume
  std::deque<Entry> entries_;
  Step base_ = 0;
  std::vector<std::map<Step, Ref<NearSet>>> told_;  // by source
  Effects effects_;
  TimelineStats stats_;

  // The round at hand.
  Step unfinished_ = -1;
  std::vector<Slot> changed_;                  // bodies whose record at the step is another than before
  std::vector<Slot> affected_;                 // own bodies to do
  std::vector<Slot> around_;                   // those, and all that may touch them, ascending by id
  std::vector<const Record*> around_records_;  // by slot, of those
  std::vector<Slot> candidates_;
  Marks in_changed_, in_affected_, in_around_, in_old_islands_;
  std::vector<Ref<Island>> old_islands_;
  std::vector<BodyState> bodies_;
  std::vector<const Record*> records_;
  std::vector<physics::Stepper::Records> previous_;
  std::vector<std::uint8_t> roles_;
  std::vector<ContactRecord> contacts_;
  std::size_t own_contacts_ = 0;
  std::vector<physics::Ends> ends_;
  physics::Islands islands_;
  std::vector<std::uint32_t> solved_;                 // islands, by piece
  std::vector<std::size_t> piece_ends_;               // in solved_
  std::size_t pieces_done_ = 0, outside_pieces_ = 0;  // the latter: with bodies of which others may hear
  bool counted_as_redone_ = false;
  std::vector<std::uint32_t> inner_;           // islands of which nobody hears
  std::vector<std::uint8_t> piece_of_;         // by position in bodies_: which piece has its result, from 1; 0: none
  std::vector<std::uint32_t> contacts_begin_;  // by position in bodies_, in contacts_
  std::vector<Aabb> boxes_;
  std::vector<Table<Record>::Item> results_;
  std::vector<BodyId> acting_;  // bodies that something is done to at the step of the results, ascending
  std::vector<std::pair<Slot, const Record*>> stored_;
  std::vector<Table<Island>::Item> island_items_;
};

}  // namespace soda::timeline
