// A timeline's round: what must be done at a step, its islands, and their results.
#include <algorithm>
#include <utility>

#include "server/physics/solver_kernel.h"
#include "server/timeline/timeline.h"

namespace soda::timeline {
namespace {

// Where so large a share of an entry is to be done, looking at all of it is cheaper than looking around each body.
constexpr std::size_t kAllShare = 2;

constexpr std::size_t kMostPieces = 8;

}  // namespace

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
  if (!island || !in_old_islands_.add(island->members.front())) return;
  old_islands_.emplace_back(island);
  for (const Slot member : island->own()) affect(step, member);
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

void Timeline::add_around(Step step, Slot slot) {
  if (in_around_.has(slot)) return;
  if (const Record* const record = known(step, slot)) add_around(slot, *record);
}

void Timeline::add_around(Slot slot, const Record& record) {
  in_around_.add(slot);
  around_.push_back(slot);
  if (slot >= around_records_.size()) around_records_.resize(slot + slot / 2 + 64);
  around_records_[slot] = &record;
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
    if (in_around_.has(slot)) return;
    add_around(slot, record);
    if (own(record) && in_affected_.add(slot)) affected_.push_back(slot);
  };
  entry.produced.for_each([&](Slot slot, const Ref<Record>& record) { add(slot, *record); });
  for (const Ref<NearSet>& heard : entry.heard)
    for (const NearSet::Body& b : heard->bodies) add(b.slot, *b.record);
}

void Timeline::find() {
  const auto by_id = [&](Slot l, Slot r) { return slots_.by_id(l, r); };
  // Mostly those that are produced here come in order, and the others behind them.
  const auto end = std::is_sorted_until(around_.begin(), around_.end(), by_id);
  std::sort(end, around_.end(), by_id);
  std::inplace_merge(around_.begin(), end, around_.end(), by_id);
  bodies_.clear();
  records_.clear();
  previous_.clear();
  roles_.clear();
  for (const Slot slot : around_) {
    const Record* const record = around_records_[slot];
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
  changed_.clear();
  in_changed_.clear();
  counted_as_redone_ = false;
  for (const Slot slot : at(step).pending)
    if (in_changed_.add(slot)) changed_.push_back(slot);
  at(step).pending.clear();
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
  find();
  if (!all)
    while (grown(step)) find();
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
    entry.islands = Table<Island>();
  } else {
    for (const Ref<Island>& old : old_islands_) {
      arbiter_.dropped(step, *old);
      for (const Slot slot : old->members) entry.islands.set(slot, {});
    }
  }
  solved_.clear();
  inner_.clear();
  acting_ = effects_.acted_on(step + 1);
  const bool all_outside = piece_bodies_ == kWhole || told_.empty() || arbiter_.places_change(step + 1);
  for (std::uint32_t k = 0; k < islands_.size(); ++k) {
    const auto members = islands_.bodies_of(k);
    if (!concerned(k)) continue;
    bool foreign = false, wide = false, inside = true;
    for (const std::uint32_t i : members) {
      if (!own(*records_[i]))
        foreign = true;
      else if (records_[i]->place.wide && !records_[i]->place.inside)
        wide = true;
      inside =
          inside && records_[i]->place.inside && !std::binary_search(acting_.begin(), acting_.end(), bodies_[i].id);
    }
    bool wait = foreign || wide;
    if (!wait && may_wait) {
      boxes_.clear();
      for (const std::uint32_t i : members) boxes_.push_back(stepper_.boxes()[i]);
      wait = arbiter_.must_wait(step, boxes_);
    }
    if (!wait) {
      (inside && !all_outside ? inner_ : solved_).push_back(k);
      if (members.size() == 1) continue;  // alone: nothing to remember
    }
    Ref<Island> island(new Island);
    island->members.reserve(members.size());
    for (const bool owned : {true, false})
      for (const std::uint32_t i : members)
        if (own(*records_[i]) == owned) {
          island->members.push_back(around_[i]);
          island->owned += owned;
        }
    for (const std::uint32_t i : members) island_items_.emplace_back(around_[i], island);
    if (wait) keep(step, k, std::move(island));
  }
  entry.islands.assign(island_items_);
  divide();
}

// What is to be solved into pieces: the first of islands of which others may hear, and of what is left if it is little.
void Timeline::divide() {
  std::size_t bodies = 0;
  for (const std::uint32_t k : inner_) bodies += islands_.bodies_of(k).size();
  const std::size_t most = std::max(piece_bodies_, bodies / (kMostPieces - 1) + 1);
  piece_ends_.clear();
  if (bodies >= most) piece_ends_.push_back(solved_.size());
  // Large islands together, by as many as the solver does at once.
  const auto size = [&](std::uint32_t k) { return islands_.contacts_of(k).size(); };
  std::sort(inner_.begin(), inner_.end(),
            [&](std::uint32_t l, std::uint32_t r) { return size(l) != size(r) ? size(l) > size(r) : l < r; });
  std::size_t in_piece = 0;
  for (std::size_t i = 0; i < inner_.size(); ++i) {
    solved_.push_back(inner_[i]);
    in_piece += islands_.bodies_of(inner_[i]).size();
    const bool lanes_full = (i + 1) % physics::kLanes == 0 || size(inner_[i]) <= 1;
    if (bodies < most || in_piece < most || !lanes_full) continue;
    piece_ends_.push_back(solved_.size());
    in_piece = 0;
  }
  if (piece_ends_.empty() || piece_ends_.back() != solved_.size()) piece_ends_.push_back(solved_.size());
  pieces_done_ = 0;
  outside_pieces_ = 1;

  piece_of_.assign(bodies_.size(), 0);
  std::size_t first = 0;
  for (std::size_t p = 0; p < piece_ends_.size(); ++p)
    for (; first < piece_ends_[p]; ++first)
      for (const std::uint32_t i : islands_.bodies_of(solved_[first])) piece_of_[i] = static_cast<std::uint8_t>(p + 1);
  contacts_begin_.clear();
  std::span<const ContactRecord> rest(contacts_.data(), own_contacts_);
  for (const BodyState& body : bodies_) {
    contacts_begin_.push_back(static_cast<std::uint32_t>(own_contacts_ - rest.size()));
    (void)take_contacts(rest, body.id);
  }
  contacts_begin_.push_back(static_cast<std::uint32_t>(own_contacts_));
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
  const std::size_t first = pieces_done_ == 0 ? 0 : piece_ends_[pieces_done_ - 1], end = piece_ends_[pieces_done_];
  stepper_.solve(bodies_, contacts_, ends_, islands_, std::span(solved_).subspan(first, end - first));
  const Step step = unfinished_;
  ++pieces_done_;
  if (pieces_done_ == piece_ends_.size()) unfinished_ = -1;
  results_.clear();
  acting_ = effects_.acted_on(step + 1);
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (piece_of_[i] == pieces_done_)
      take_result(step + 1, around_[i], bodies_[i],
                  std::span(contacts_).subspan(contacts_begin_[i], contacts_begin_[i + 1] - contacts_begin_[i]));
  const std::uint64_t redone = stats_.steps_redone;
  store(step + 1, results_);
  if (stats_.steps_redone > redone && std::exchange(counted_as_redone_, true)) stats_.steps_redone = redone;
}

}  // namespace soda::timeline
