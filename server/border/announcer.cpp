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
std::uint64_t Announcer::wanted(Step step, const timeline::Record& record) const {
  if (record.place.owner != context_.settings.me) return NearBody::kAll;
  std::uint64_t wanted = NearBody::kAll;
  const std::span<const ContactRecord> contacts = record.contacts();
  for (std::size_t i = 0; i < std::min<std::size_t>(contacts.size(), 64); ++i) {
    bool needed = false;
    if (!contacts[i].with_static()) {
      const timeline::Record* const partner =
          context_.timeline.produced(step, context_.timeline.slot_of(contacts[i].b));
      needed = !partner || partner->place.owner != context_.settings.me || (record.place.wide && partner->place.wide);
    }
    if (!needed) wanted &= ~(std::uint64_t{1} << i);
  }
  return wanted;
}

void Announcer::update(Step step) {
  context_.timeline.take_changed(step, changed_);
  if (changed_.empty() || books_.empty()) return;
  added_.resize(books_.size());  // all empty
  for (const timeline::Slot slot : changed_) {
    const Ref<timeline::Record> record = context_.timeline.share(step, slot);
    if (!record || context_.timeline.inside(*record)) continue;
    context_.neighbourhood.hearers(record->body, step, hearers_);
    for (const WorldId hearer : hearers_)
      if (const Link* const link = context_.link_to(hearer)) added_[link->index()].push_back({slot, record});
  }
  for (std::size_t l = 0; l < books_.size(); ++l) {
    const NearBodies& before = books_[l].truth(step);
    if (before.empty() && added_[l].empty()) continue;
    NearBodies now;
    now.reserve(before.size() + added_[l].size());
    auto add = added_[l].begin();
    auto gone = changed_.begin();
    for (const NearBody& body : before) {
      for (; add != added_[l].end() && add->slot < body.slot; ++add) now.push_back(std::move(*add));
      while (gone != changed_.end() && *gone < body.slot) ++gone;
      if (gone == changed_.end() || *gone != body.slot) now.push_back(body);
    }
    std::move(add, added_[l].end(), std::back_inserter(now));
    for (NearBody& body : now) body.wanted = wanted(step, *body.record);
    books_[l].set(step, std::move(now));
  }
  for (NearBodies& added : added_) added.clear();
}

void Announcer::tell(Step front) {
  for (Step step = oldest_; step <= front; ++step) update(step);
  for (std::size_t l = 0; l < books_.size(); ++l)
    for (Frame& frame : books_[l].tell(front, context_.settings.epoch)) {
      ++context_.stats.frames_sent;
      context_.stats.frames_corrected += frame.revision.count > 1;
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
