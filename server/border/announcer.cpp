#include "server/border/announcer.h"

#include <algorithm>

namespace soda::border {

void Announcer::extend(Step newest) {
  // The copy is of what is there now.
  if (newest > oldest_) update(newest - 1);
  for (FrameBook& book : books_) book.extend();
}

void Announcer::add_link(Step newest) {
  FrameBook& book = books_.emplace_back(oldest_);
  for (Step step = oldest_; step <= newest; ++step) book.extend();
}

// Of a body that stays here others need the records with bodies that may be theirs, and of two wide bodies, which whom
// they reach looks at too; those with its own kind and with the ground matter here alone.
std::vector<bool> Announcer::wanted(Step step, const timeline::Record& record) const {
  std::vector<bool> wanted;
  if (record.place.owner != context_.settings.me) return wanted;
  bool all = true;
  for (const ContactRecord& contact : record.contacts()) {
    bool needed = false;
    if (!contact.with_static()) {
      const timeline::Record* const partner = context_.timeline.produced(step, context_.timeline.slot_of(contact.b));
      needed = !partner || partner->place.owner != context_.settings.me || (record.place.wide && partner->place.wide);
    }
    wanted.push_back(needed);
    all = all && needed;
  }
  if (all) wanted.clear();
  return wanted;
}

void Announcer::update(Step step) {
  const std::vector<timeline::Slot> changed = context_.timeline.take_changed(step);
  if (changed.empty() || books_.empty()) return;
  std::vector<NearBodies> added(books_.size());
  for (const timeline::Slot slot : changed) {
    const Ref<timeline::Record> record = context_.timeline.share(step, slot);
    if (!record || (record->place.inside && record->place.owner == context_.settings.me)) continue;
    context_.neighbourhood.hearers(record->body, step, hearers_);
    for (std::size_t l = 0; l < books_.size(); ++l)
      if (std::binary_search(hearers_.begin(), hearers_.end(), context_.links[l].peer()))
        added[l].push_back({slot, record, {}});
  }
  for (std::size_t l = 0; l < books_.size(); ++l) {
    const NearBodies& before = books_[l].truth(step);
    if (before.empty() && added[l].empty()) continue;
    NearBodies now;
    now.reserve(before.size() + added[l].size());
    auto add = added[l].begin();
    auto gone = changed.begin();
    for (const NearBody& body : before) {
      for (; add != added[l].end() && add->slot < body.slot; ++add) now.push_back(std::move(*add));
      while (gone != changed.end() && *gone < body.slot) ++gone;
      if (gone == changed.end() || *gone != body.slot) now.push_back(body);
    }
    std::move(add, added[l].end(), std::back_inserter(now));
    for (NearBody& body : now) body.wanted = wanted(step, *body.record);
    books_[l].set(step, std::move(now));
  }
}

void Announcer::tell(Step front) {
  for (Step step = oldest_; step <= front; ++step) update(step);
  for (std::size_t l = 0; l < books_.size(); ++l)
    for (Frame& frame : books_[l].tell(front, context_.settings.epoch)) {
      ++context_.stats.frames_sent;
      context_.stats.frame_bodies_sent += frame.set.bodies.size();
      context_.links[l].add(std::move(frame));
    }
}

void Announcer::count(Step step) {
  for (std::size_t l = 0; l < books_.size(); ++l)
    for (const NearBody& body : books_[l].truth(step)) {
      context_.stats.departed += body.record->place.owner == context_.links[l].peer();
      context_.stats.wide_bodies += body.record->place.wide;
    }
}

void Announcer::release_before(Step step) {
  for (FrameBook& book : books_) book.release_before(step);
  oldest_ = step;
}

}  // namespace soda::border
