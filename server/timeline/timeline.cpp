#include "server/timeline/timeline.h"

#include <algorithm>
#include <utility>

#include "common/state_hash.h"
#include "server/physics/tuning.h"

namespace soda::timeline {
namespace {

double index_cell(const physics::Model& model) {
  return 1.1 * model.largest_ordinary_diameter() + 4 * physics::kContactMargin;
}

}  // namespace

const Record* NearSet::find(Slot slot) const {
  const auto at =
      std::lower_bound(bodies.begin(), bodies.end(), slot, [](const Body& b, Slot s) { return b.slot < s; });
  return at != bodies.end() && at->slot == slot ? at->record.get() : nullptr;
}

Ref<NearSet> sleepers(const Ref<NearSet>& set) {
  const auto awake = [](const NearSet::Body& b) { return !b.record->body.asleep(); };
  if (!set || std::none_of(set->bodies.begin(), set->bodies.end(), awake)) return set;
  Ref<NearSet> rest(new NearSet);
  std::remove_copy_if(set->bodies.begin(), set->bodies.end(), std::back_inserter(rest->bodies), awake);
  return rest;
}

bool same(const NearSet& l, const NearSet& r) {
  return std::equal(
      l.bodies.begin(), l.bodies.end(), r.bodies.begin(), r.bodies.end(),
      [](const NearSet::Body& a, const NearSet::Body& b) { return a.slot == b.slot && same(*a.record, *b.record); });
}

Timeline::Timeline(const physics::Model& model, WorldId me, std::size_t sources, Arbiter& arbiter,
                   std::size_t piece_bodies)
    : model_(model),
      slots_(model),
      me_(me),
      arbiter_(arbiter),
      piece_bodies_(piece_bodies),
      stepper_(model),
      index_(index_cell(model)),
      told_(sources),
      effects_(model) {
  Entry& first = entries_.emplace_back();
  first.heard.assign(sources, Ref(new NearSet));
  for (const BodyState& body : model.initial_state().bodies) {
    const Place place = arbiter_.place(body, 0);
    if (place.owner == me_) results_.emplace_back(slots_.of(body.id), make_record(body, {}, place, 0));
  }
  store(0, results_);
  arbiter_.extended(0);
}

Ref<NearSet> Timeline::near_set(const BodySet& set, Step step) {
  Ref<NearSet> near(new NearSet);
  near->bodies.reserve(set.bodies.size());
  std::span<const ContactRecord> rest(set.contacts);
  for (const BodyState& body : set.bodies)
    near->bodies.push_back(
        {slots_.of(body.id), make_record(body, take_contacts(rest, body.id), arbiter_.place(body, step), -1)});
  std::sort(near->bodies.begin(), near->bodies.end(),
            [](const NearSet::Body& l, const NearSet::Body& r) { return l.slot < r.slot; });
  return near;
}

const Record* Timeline::known(Step step, Slot slot) const {
  const Entry& entry = at(step);
  if (const Record* record = entry.produced.get(slot)) return record;
  for (const Ref<NearSet>& heard : entry.heard)
    if (const Record* record = heard->find(slot)) return record;
  return nullptr;
}

BodySet Timeline::all_produced(Step step) const {
  std::vector<const Record*> records;
  at(step).produced.for_each([&](Slot, const Ref<Record>& record) { records.push_back(record.get()); });
  std::sort(records.begin(), records.end(), [](const Record* l, const Record* r) { return l->body.id < r->body.id; });
  BodySet set;
  for (const Record* const record : records) {
    set.bodies.push_back(record->body);
    set.contacts.insert(set.contacts.end(), record->contacts().begin(), record->contacts().end());
  }
  return set;
}

void Timeline::take_changed(Step step, std::vector<Slot>& changed) {
  changed.swap(at(step).changed);
  at(step).changed.clear();
  sort_unique(changed);
}

void Timeline::release_before(Step step) {
  if (step <= base_) return;
  while (base_ < step) {
    entries_.pop_front();
    ++base_;
  }
  for (auto& told : told_) told.erase(told.begin(), told.lower_bound(base_));
  effects_.forget_before(base_);
  index_.forget_before(base_);
}

// ---- what others tell ----------------------------------------------------------------------------------------------

void Timeline::add_source() {
  told_.emplace_back();
  const Ref<NearSet> nothing(new NearSet);
  for (Entry& entry : entries_) entry.heard.push_back(nothing);
}

void Timeline::hear(std::size_t source, Step step, Ref<NearSet> set) {
  Ref<NearSet>& told = told_[source][step];
  told = std::move(set);
  if (step < base_ || step > newest()) return;
  assume(source, step);
  for (const NearSet::Body& b : told->bodies) {
    ever_heard_.add(b.slot);
    note_repaired(b.slot, b.record->body, step);
  }
}

// What the source says of `step`, or what follows from the step before, and so on as long as that changes anything.
void Timeline::assume(std::size_t source, Step step) {
  for (; step <= newest(); ++step) {
    Entry& entry = at(step);
    const auto told = told_[source].find(step);
    Ref<NearSet> now = told != told_[source].end() ? told->second : moved(sleepers(at(step - 1).heard[source]), step);
    Ref<NearSet>& known = entry.heard[source];
    if (now == known || same(*now, *known)) return;
    auto o = known->bodies.begin();
    auto n = now->bodies.begin();
    while (o != known->bodies.end() || n != now->bodies.end()) {
      const bool old_only = n == now->bodies.end() || (o != known->bodies.end() && o->slot < n->slot);
      const bool new_only = !old_only && (o == known->bodies.end() || n->slot < o->slot);
      if (old_only || new_only || !same(*o->record, *n->record)) entry.pending.push_back(old_only ? o->slot : n->slot);
      if (old_only && index_.is_beside(o->slot)) unsettled_.push_back(o->slot);
      if (!new_only) ++o;
      if (!old_only) ++n;
    }
    known = std::move(now);
    for (const Slot slot : unsettled_) note_newest(slot);
    unsettled_.clear();
  }
}

void Timeline::extend() {
  const Entry& last = entries_.back();
  Entry next{last.produced, last.islands, last.heard, {}, {}, last.departed, {}, last.count, last.hash};
  entries_.push_back(std::move(next));
  ++stats_.steps;
  if (arbiter_.places_change(newest())) change_hands(newest());
  for (std::size_t source = 0; source < told_.size(); ++source) {
    assume(source, newest());
    if (const auto told = told_[source].find(newest()); told != told_[source].end())
      for (const NearSet::Body& b : told->second->bodies) {
        ever_heard_.add(b.slot);
        note_repaired(b.slot, b.record->body, newest());
      }
  }
  arbiter_.extended(newest());
  // What nothing pending touches has its result already.
  for (const BodyId id : effects_.acted_on(newest())) do_actions(newest(), id);
}

// The same body where space has changed hands about it.
Ref<Record> Timeline::moved(const Record& record, Step step) const {
  return make_record(record.body, record.contacts(), arbiter_.place(record.body, step), record.computed);
}

Ref<NearSet> Timeline::moved(Ref<NearSet> set, Step step) const {
  if (!arbiter_.places_change(step)) return set;
  Ref<NearSet> now(new NearSet);
  for (const NearSet::Body& b : set->bodies)
    now->bodies.push_back({b.slot, arbiter_.place_changes(b.record->body, step) ? moved(*b.record, step) : b.record});
  return now;
}

// The newest entry is a copy of the one before, but bodies may be others' to do from here on, and islands mixed that
// were not. Who hears of which must be looked at again, too.
void Timeline::change_hands(Step step) {
  Entry& entry = at(step);
  results_.clear();
  entry.produced.for_each([&](Slot slot, const Ref<Record>& record) {
    if (!arbiter_.place_changes(record->body, step)) return;
    results_.emplace_back(slot, moved(*record, step));
    stats_.handed_over += own(*record) && !own(*results_.back().second);
  });
  store(step, results_);
  for (Ref<NearSet>& heard : entry.heard) {
    heard = moved(heard, step);
    for (const NearSet::Body& b : heard->bodies)
      if (arbiter_.place_changes(b.record->body, step)) entry.pending.push_back(b.slot);
  }
}

bool Timeline::is_large(Slot slot, const BodyState& body) const {
  return physics::reach_bound(body, slots_.body(slot).reach, model_.scene().dt) > index_.ordinary_reach();
}

void Timeline::note(Slot slot, const BodyState& body) { index_.note(slot, body.x(), is_large(slot, body), newest()); }

// The index must end with where the body is at the newest step, for entries to come copy that.
void Timeline::note_repaired(Slot slot, const BodyState& body, Step step) {
  note(slot, body);
  if (ever_heard_.has(slot))
    note_newest(slot);
  else if (step != newest())
    if (const Record* const now = produced(newest(), slot)) note(slot, now->body);
}

// Somebody may tell of a body that this world believes to have produced; until that is settled both count.
void Timeline::note_newest(Slot slot) {
  index_.not_beside(slot);
  bool first = true;
  const auto add = [&](const Record* record) {
    if (!record) return;
    if (std::exchange(first, false))
      note(slot, record->body);
    else
      index_.note_beside(slot, record->body.x(), is_large(slot, record->body), newest());
  };
  const Entry& entry = entries_.back();
  add(entry.produced.get(slot));
  for (const Ref<NearSet>& heard : entry.heard) add(heard->find(slot));
}

bool Timeline::is_indexed() const {
  std::vector<Slot> found;
  const auto finds = [&](Slot slot, const Record& record) {
    found.clear();
    index_.query(physics::reach_box(record.body, model_), found);
    return std::find(found.begin(), found.end(), slot) != found.end();
  };
  bool all = true;
  for (const Entry& entry : entries_) {
    entry.produced.for_each([&](Slot slot, const Ref<Record>& record) { all = all && finds(slot, *record); });
    for (const Ref<NearSet>& heard : entry.heard)
      for (const NearSet::Body& b : heard->bodies) all = all && finds(b.slot, *b.record);
  }
  return all;
}

// ---- what users do

void Timeline::act(const LoggedAction& action) {
  // What is done may be seen by others, and is not to be told with results that are still to come.
  if (unfinished_ >= 0) outside_pieces_ = piece_ends_.size();
  for (const Effects::Change& change : effects_.add(action))
    for (Step step = std::max(change.first, base_ + 1); step <= std::min(change.last, newest()); ++step)
      do_actions(step, change.body);
}

// The record of a body for which something is done at the step: none if it is taken away, or somebody else's to
// produce.
Ref<Record> Timeline::after_actions(Step step, BodyId id, const Record* raw) const {
  std::optional<BodyState> state;
  const bool given = effects_.gives(step, id, state);
  if (!given && raw) state = raw->body;
  if (!state || (given && arbiter_.place(*state, step).owner != me_)) return {};
  effects_.apply(step, *state);
  if (given) return make_record(*state, {}, arbiter_.place(*state, step), step);
  return make_record(*state, raw->contacts(), arbiter_.place(*state, step), raw->computed);
}

// Does what is done to a body at a step again, with the result that is known.
void Timeline::do_actions(Step step, BodyId id) {
  Entry& entry = at(step);
  const Slot slot = slots_.of(id);
  const Record* const before = entry.produced.get(slot);
  const auto kept = entry.raw.find(slot);
  const Ref<Record> raw = kept != entry.raw.end() ? kept->second : Ref<Record>(entry.produced.get(slot));
  Ref<Record> now = after_actions(step, id, raw.get());
  // Where nothing is done any more (a grab was released), the result is the record, and is not kept beside it.
  if (!effects_.acts_on(step, id))
    entry.raw.erase(slot);
  else if (raw)
    entry.raw.insert_or_assign(slot, raw);
  if (before && now && same(*before, *now)) return;
  if (now) {
    results_.clear();
    results_.emplace_back(slot, std::move(now));
    store(step, results_);
  } else {
    drop(step, slot);
  }
}

// ---- results --------------------------------------------------------------------------------------------------------

void Timeline::set_departed(Entry& entry, Slot slot, bool departed) {
  const auto at = std::lower_bound(entry.departed.begin(), entry.departed.end(), slot);
  const bool was = at != entry.departed.end() && *at == slot;
  if (departed && !was) entry.departed.insert(at, slot);
  if (!departed && was) entry.departed.erase(at);
}

// A body that is not own at a step has no result here, but where an action gives it one.
void Timeline::take_away(Step step, Slot slot) {
  std::optional<BodyState> given;
  at(step + 1).raw.erase(slot);
  if (!effects_.gives(step + 1, id_of(slot), given)) drop(step + 1, slot);
}

void Timeline::drop(Step step, Slot slot) {
  Entry& entry = at(step);
  const Record* const record = entry.produced.get(slot);
  if (!record) return;
  --entry.count;
  entry.hash -= record->hash;
  entry.produced.set(slot, {});
  set_departed(entry, slot, false);
  entry.pending.push_back(slot);
  entry.changed.push_back(slot);
  if (index_.is_beside(slot)) note_newest(slot);
  if (!known(newest(), slot)) index_.note_gone(slot);
}

void Timeline::settle(Step step, const BodySet& results) {
  results_.clear();
  acting_ = effects_.acted_on(step + 1);
  std::span<const ContactRecord> rest(results.contacts);
  for (const BodyState& body : results.bodies)
    take_result(step + 1, slots_.of(body.id), body, take_contacts(rest, body.id));
  store(step + 1, results_);
}

// The result of an own body for `step`; one that is there already changes nothing.
void Timeline::take_result(Step step, Slot slot, const BodyState& body, std::span<const ContactRecord> contacts) {
  ++stats_.bodies_computed;
  if (!acting_.empty() && std::binary_search(acting_.begin(), acting_.end(), body.id))
    return take_acted(step, slot, body, contacts);
  const Record* const old = at(step).produced.get(slot);
  if (old && same(*old, body, contacts))
    note_repaired(slot, body, step);  // healed, or at rest
  else
    results_.emplace_back(slot, make_record(body, contacts, arbiter_.place(body, step), step));
}

void Timeline::take_acted(Step step, Slot slot, const BodyState& body, std::span<const ContactRecord> contacts) {
  Entry& entry = at(step);
  Ref<Record>& raw = entry.raw[slot];
  if (raw && same(*raw, body, contacts)) return;  // healed
  raw = make_record(body, contacts, arbiter_.place(body, step), step);
  const Record* const before = entry.produced.get(slot);
  Ref<Record> now = after_actions(step, body.id, raw.get());
  if (!now)
    drop(step, slot);
  else if (!before || !same(*before, *now))
    results_.emplace_back(slot, std::move(now));
  else if (!same(*raw, *now))
    entry.pending.push_back(slot);  // the step leads elsewhere from here, though this is what was here already
}

// New records of bodies produced at `step`.
void Timeline::store(Step step, std::vector<Table<Record>::Item>& items) {
  if (items.empty()) return;
  Entry& entry = at(step);
  std::uint64_t redone = 0;
  for (const auto& [slot, record] : items) {
    const Record* const old = entry.produced.get(slot);
    if (!old || !inside(*old) || !inside(*record)) entry.changed.push_back(slot);
    if (old) {
      entry.hash -= old->hash;
      // That of a sleeping body was carried there from an earlier step.
      redone += old->computed == step || (step < newest() && old->body.asleep());
    } else {
      ++entry.count;
    }
    entry.hash += record->hash;
    set_departed(entry, slot, !own(*record));
    entry.pending.push_back(slot);
    stored_.emplace_back(slot, record.get());
  }
  entry.produced.assign(items);
  for (const auto& [slot, record] : stored_) note_repaired(slot, record->body, step);
  stored_.clear();
  items.clear();
  if (redone == 0) return;
  stats_.bodies_redone += redone;
  ++stats_.steps_redone;
  stats_.longest_rollback = std::max(stats_.longest_rollback, static_cast<std::uint64_t>(newest() - step));
}

}  // namespace soda::timeline
