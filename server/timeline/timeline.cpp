#include "server/timeline/timeline.h"

#include <algorithm>
#include <utility>

#include "common/state_hash.h"
#include "server/physics/tuning.h"

namespace soda::timeline {
namespace {

// Where so large a share of an entry is to be done, looking at all of it is cheaper than looking around each body.
constexpr std::size_t kAllShare = 2;

double index_cell(const physics::Model& model) {
  return 1.1 * model.largest_ordinary_diameter() + 4 * physics::kContactMargin;
}

void sort_unique(std::vector<Slot>& slots) {
  if (!std::is_sorted(slots.begin(), slots.end())) std::sort(slots.begin(), slots.end());
  slots.erase(std::unique(slots.begin(), slots.end()), slots.end());
}

// Those of body `id`, which `rest` begins with; `rest` goes on behind them.
std::span<const ContactRecord> take_contacts(std::span<const ContactRecord>& rest, BodyId id) {
  std::size_t n = 0;
  while (n < rest.size() && rest[n].a == id) ++n;
  const auto taken = rest.first(n);
  rest = rest.subspan(n);
  return taken;
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

Timeline::Timeline(const physics::Model& model, WorldId me, std::size_t sources, Arbiter& arbiter)
    : model_(model),
      me_(me),
      arbiter_(arbiter),
      stepper_(model),
      index_(index_cell(model)),
      told_(sources),
      effects_(model) {
  Entry& first = entries_.emplace_back();
  first.produced = Table<Record>(model.bodies().size());
  first.islands = Table<Island>(model.bodies().size());
  first.heard.assign(sources, Ref(new NearSet));
  for (const BodyState& body : model.initial_state().bodies) {
    const Place place = arbiter_.place(body);
    if (place.owner == me_) results_.emplace_back(slot_of(body.id), make_record(body, {}, place, 0));
  }
  store(0, results_);
  arbiter_.extended(0);
}

Slot Timeline::slot_of(BodyId id) const { return static_cast<Slot>(model_.find(id) - model_.bodies().data()); }

Ref<NearSet> Timeline::near_set(const BodySet& set) const {
  Ref<NearSet> near(new NearSet);
  near->bodies.reserve(set.bodies.size());
  std::span<const ContactRecord> rest(set.contacts);
  for (const BodyState& body : set.bodies)
    near->bodies.push_back(
        {slot_of(body.id), make_record(body, take_contacts(rest, body.id), arbiter_.place(body), -1)});
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
  BodySet set;
  at(step).produced.for_each([&](Slot, const Ref<Record>& record) {
    set.bodies.push_back(record->body);
    set.contacts.insert(set.contacts.end(), record->contacts().begin(), record->contacts().end());
  });
  return set;
}

std::vector<Slot> Timeline::take_changed(Step step) {
  std::vector<Slot> changed = std::exchange(at(step).changed, {});
  sort_unique(changed);
  return changed;
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
    Ref<NearSet> now = told != told_[source].end() ? told->second : sleepers(at(step - 1).heard[source]);
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
  Entry next = entries_.back();
  next.pending.clear();
  next.changed.clear();
  next.raw.clear();
  entries_.push_back(std::move(next));
  ++stats_.steps;
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
  for (const Slot slot : effects_.acted_on(newest())) do_actions(newest(), slot);
}

bool Timeline::is_large(Slot slot, const BodyState& body) const {
  const double radius = model_.bodies()[slot].radius, dt = model_.scene().dt;
  const double reach =
      radius * (1 + std::min(1.0, body.w().norm() * dt)) + body.v().norm() * dt + physics::kContactMargin;
  return reach > index_.ordinary_reach();
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
// ---------------------------------------------------------------------------------------------------

void Timeline::act(const LoggedAction& action) {
  for (const Effects::Change& change : effects_.add(action))
    for (Step step = std::max(change.first, base_ + 1); step <= std::min(change.last, newest()); ++step)
      do_actions(step, change.slot);
}

// The record of a body for which something is done at the step: none if it is taken away, or somebody else's to
// produce.
Ref<Record> Timeline::after_actions(Step step, Slot slot, const Record* raw) const {
  std::optional<BodyState> state;
  const bool given = effects_.gives(step, slot, state);
  if (!given && raw) state = raw->body;
  if (!state || (given && arbiter_.place(*state).owner != me_)) return {};
  effects_.apply(step, slot, *state);
  return make_record(*state, given ? std::span<const ContactRecord>() : raw->contacts(), arbiter_.place(*state), step);
}

// Does what is done to a body at a step again, with the result that is known.
void Timeline::do_actions(Step step, Slot slot) {
  Entry& entry = at(step);
  const Record* const before = entry.produced.get(slot);
  const auto kept = entry.raw.find(slot);
  const Ref<Record> raw = kept != entry.raw.end() ? kept->second : Ref<Record>(entry.produced.get(slot));
  if (raw) entry.raw.insert_or_assign(slot, raw);
  Ref<Record> now = after_actions(step, slot, raw.get());
  if (before && now && same(*before, *now)) return;
  if (now) {
    results_.clear();
    results_.emplace_back(slot, std::move(now));
    store(step, results_);
  } else {
    drop(step, slot);
  }
}

// ---- the round: what must be done

void Timeline::touch(Step step, std::span<const Slot> slots) {
  at(step).pending.insert(at(step).pending.end(), slots.begin(), slots.end());
}

void Timeline::affect(Step step, Slot slot) {
  if (in_affected_.has(slot)) return;
  const Record* const record = known(step, slot);
  if (!record || !own(*record)) return;
  in_affected_.add(slot);
  affected_.push_back(slot);
}

// The island that was found at the step with this body does not stand any more: all of it must be done.
void Timeline::affect_island(Step step, Slot slot) {
  Island* const island = at(step).islands.get(slot);
  if (!island || !in_old_islands_.add(island->own.empty() ? island->foreign.front() : island->own.front())) return;
  old_islands_.emplace_back(island);
  for (const Slot member : island->own) affect(step, member);
}

void Timeline::affect_touched(Step step, const Record& foreign) {
  const Aabb box = physics::reach_box(foreign.body, model_);
  candidates_.clear();
  index_.query(box, candidates_);
  for (const Slot slot : candidates_) {
    if (in_affected_.has(slot)) continue;
    const Record* const record = known(step, slot);
    if (record && own(*record) && box.overlaps(physics::reach_box(record->body, model_))) affect(step, slot);
  }
}

void Timeline::set_departed(Entry& entry, Slot slot, bool departed) {
  const auto at = std::lower_bound(entry.departed.begin(), entry.departed.end(), slot);
  const bool was = at != entry.departed.end() && *at == slot;
  if (departed && !was) entry.departed.insert(at, slot);
  if (!departed && was) entry.departed.erase(at);
}

// A body that is not own at a step has no result here, but where an action gives it one.
void Timeline::take_away(Step step, Slot slot) {
  std::optional<BodyState> given;
  if (effects_.acts_on(step + 1, slot)) {
    at(step + 1).raw.erase(slot);
    if (effects_.gives(step + 1, slot, given)) return;
  }
  drop(step + 1, slot);
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
}

void Timeline::add_around(Step step, Slot slot) {
  if (in_around_.has(slot) || !known(step, slot)) return;
  in_around_.add(slot);
  around_.push_back(slot);
}

void Timeline::gather(Step step, std::size_t first_affected) {
  for (std::size_t i = first_affected; i < affected_.size(); ++i) {
    add_around(step, affected_[i]);
    candidates_.clear();
    index_.query(physics::reach_box(known(step, affected_[i])->body, model_), candidates_);
    for (const Slot slot : candidates_) add_around(step, slot);
  }
}

void Timeline::gather_all(Step step) {
  const Entry& entry = at(step);
  const auto add = [&](Slot slot, const Record& record) {
    if (!in_around_.add(slot)) return;
    around_.push_back(slot);
    if (own(record) && in_affected_.add(slot)) affected_.push_back(slot);
  };
  entry.produced.for_each([&](Slot slot, const Ref<Record>& record) { add(slot, *record); });
  for (const Ref<NearSet>& heard : entry.heard)
    for (const NearSet::Body& b : heard->bodies) add(b.slot, *b.record);
}

void Timeline::find(Step step) {
  if (!std::is_sorted(around_.begin(), around_.end())) std::sort(around_.begin(), around_.end());
  bodies_.clear();
  records_.clear();
  previous_.clear();
  roles_.clear();
  for (const Slot slot : around_) {
    const Record* const record = known(step, slot);
    records_.push_back(record);
    bodies_.push_back(record->body);
    previous_.push_back(record->contacts());
    roles_.push_back(static_cast<std::uint8_t>((in_affected_.has(slot) ? physics::kRoleWanted : physics::kRoleNone) |
                                               (record->place.wide ? physics::kRoleWide : physics::kRoleNone)));
  }
  own_contacts_ = stepper_.find_contacts(bodies_, previous_, roles_, contacts_);
  stepper_.find_islands(bodies_, contacts_, ends_, islands_);
}

// Whether an island was looked for in this round: it has bodies to do, or bodies that changed, or consists of others'
// wide bodies. What else is found, because it is around, may be incomplete.
bool Timeline::concerned(std::uint32_t island) const {
  const auto members = islands_.bodies_of(island);
  bool any_own = false, changed = false;
  for (const std::uint32_t i : members) {
    if (in_affected_.has(around_[i])) return true;
    any_own = any_own || own(*records_[i]);
    changed = changed || in_changed_.has(around_[i]);
  }
  return members.size() > 1 && (changed || !any_own);
}

// Islands found reach further than what was to be done: whether any do, and so all must be found again.
bool Timeline::grown(Step step) {
  const std::size_t before = affected_.size();
  for (std::uint32_t k = 0; k < islands_.size(); ++k) {
    if (!concerned(k)) continue;
    for (const std::uint32_t i : islands_.bodies_of(k)) {
      affect(step, around_[i]);
      affect_island(step, around_[i]);
    }
  }
  for (std::size_t i = before; i < affected_.size(); ++i) affect_island(step, affected_[i]);
  if (affected_.size() == before) return false;
  gather(step, before);
  return true;
}

void Timeline::process(Step step) {
  changed_ = std::exchange(at(step).pending, {});
  sort_unique(changed_);
  in_changed_.clear();
  for (const Slot slot : changed_) in_changed_.add(slot);
  in_affected_.clear();
  in_around_.clear();
  in_old_islands_.clear();
  affected_.clear();
  around_.clear();
  old_islands_.clear();

  std::size_t known_bodies = at(step).count;
  for (const Ref<NearSet>& heard : at(step).heard) known_bodies += heard->bodies.size();
  const bool all = changed_.size() * kAllShare >= known_bodies;
  for (const Slot slot : changed_) {
    if (all) break;
    const Record* const record = known(step, slot);
    if (record && own(*record)) {
      affect(step, slot);
    } else if (record) {
      affect_touched(step, *record);
    }
    affect_island(step, slot);
  }
  if (all) {
    gather_all(step);
  } else {
    for (std::size_t i = 0; i < affected_.size(); ++i) affect_island(step, affected_[i]);
    gather(step, 0);
    // Two worlds' wide bodies may touch where neither knows of the other.
    for_each_foreign_wide(step, [&](Slot slot, const Record&) { add_around(step, slot); });
  }
  find(step);
  if (!all)
    while (grown(step)) find(step);
  sort_out(step, all);
  if (step == newest()) extend();  // with the islands found now
  for (const Slot slot : changed_) {
    const Record* const record = known(step, slot);
    if (!record || !own(*record)) take_away(step, slot);
  }
  unfinished_ = step;
}

// ---- the round: islands and results

void Timeline::sort_out(Step step, bool all) {
  Entry& entry = at(step);
  const bool may_wait = arbiter_.finding(step, all);
  island_items_.clear();
  if (all) {
    entry.islands = Table<Island>(model_.bodies().size());
  } else {
    for (const Ref<Island>& old : old_islands_) {
      arbiter_.dropped(step, *old);
      for (const Slot slot : old->own) entry.islands.set(slot, {});
      for (const Slot slot : old->foreign) entry.islands.set(slot, {});
    }
  }
  solved_.clear();
  has_result_.assign(bodies_.size(), 0);
  for (std::uint32_t k = 0; k < islands_.size(); ++k) {
    const auto members = islands_.bodies_of(k);
    if (!concerned(k)) continue;
    bool foreign = false, wide = false;
    for (const std::uint32_t i : members) {
      if (!own(*records_[i]))
        foreign = true;
      else if (records_[i]->place.wide && !records_[i]->place.inside)
        wide = true;
    }
    bool wait = foreign || wide;
    if (!wait && may_wait) {
      boxes_.clear();
      for (const std::uint32_t i : members) boxes_.push_back(stepper_.boxes()[i]);
      wait = arbiter_.must_wait(step, boxes_);
    }
    if (!wait) {
      solved_.push_back(k);
      for (const std::uint32_t i : members) has_result_[i] = 1;
      if (members.size() == 1) continue;  // alone: nothing to remember
    }
    Ref<Island> island(new Island);
    for (const std::uint32_t i : members) (own(*records_[i]) ? island->own : island->foreign).push_back(around_[i]);
    for (const std::uint32_t i : members) island_items_.emplace_back(around_[i], island);
    if (wait) keep(step, k, std::move(island));
  }
  std::sort(island_items_.begin(), island_items_.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  entry.islands.assign(island_items_);
}

void Timeline::keep(Step step, std::uint32_t island, Ref<Island> members) {
  Found found;
  found.island = std::move(members);
  for (const std::uint32_t i : islands_.bodies_of(island)) {
    if (own(*records_[i])) {
      found.own.bodies.push_back(bodies_[i]);
      found.boxes.push_back(stepper_.boxes()[i]);
      found.wide = found.wide || records_[i]->place.wide;
    } else {
      found.foreign.push_back(records_[i]);
    }
  }
  for (const std::uint32_t c : islands_.contacts_of(island)) found.own.contacts.push_back(contacts_[c]);
  std::sort(found.own.contacts.begin(), found.own.contacts.end(), record_before);
  arbiter_.keep(step, std::move(found));
}

void Timeline::finish() {
  const Step step = std::exchange(unfinished_, -1);
  stepper_.solve(bodies_, contacts_, ends_, islands_, solved_);
  results_.clear();
  std::span<const ContactRecord> rest(contacts_.data(), own_contacts_);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const auto contacts = take_contacts(rest, bodies_[i].id);
    if (!has_result_[i]) continue;
    take_result(step + 1, around_[i], bodies_[i], contacts);
  }
  store(step + 1, results_);
}

void Timeline::settle(Step step, const BodySet& results) {
  results_.clear();
  std::span<const ContactRecord> rest(results.contacts);
  for (const BodyState& body : results.bodies)
    take_result(step + 1, slot_of(body.id), body, take_contacts(rest, body.id));
  store(step + 1, results_);
}

// The result of an own body for `step`; one that is there already changes nothing.
void Timeline::take_result(Step step, Slot slot, const BodyState& body, std::span<const ContactRecord> contacts) {
  ++stats_.bodies_computed;
  if (effects_.acts_on(step, slot)) return take_acted(step, slot, body, contacts);
  const Record* const old = at(step).produced.get(slot);
  if (old && same(*old, body, contacts))
    note_repaired(slot, body, step);  // healed, or at rest
  else
    results_.emplace_back(slot, make_record(body, contacts, arbiter_.place(body), step));
}

void Timeline::take_acted(Step step, Slot slot, const BodyState& body, std::span<const ContactRecord> contacts) {
  Entry& entry = at(step);
  Ref<Record>& raw = entry.raw[slot];
  if (raw && same(*raw, body, contacts)) return;  // healed
  raw = make_record(body, contacts, arbiter_.place(body), step);
  const Record* const before = entry.produced.get(slot);
  Ref<Record> now = after_actions(step, slot, raw.get());
  if (!now)
    drop(step, slot);
  else if (!before || !same(*before, *now))
    results_.emplace_back(slot, std::move(now));
}

// New records of bodies produced at `step`, ascending by slot.
void Timeline::store(Step step, std::vector<Table<Record>::Item>& items) {
  if (items.empty()) return;
  Entry& entry = at(step);
  std::uint64_t redone = 0;
  for (const auto& [slot, record] : items) {
    if (const Record* const old = entry.produced.get(slot)) {
      entry.hash -= old->hash;
      redone += old->computed == step;
    } else {
      ++entry.count;
    }
    entry.hash += record->hash;
    set_departed(entry, slot, !own(*record));
    entry.pending.push_back(slot);
    entry.changed.push_back(slot);
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
