#include "server/border/frame_book.h"

#include <algorithm>

namespace soda::border {
namespace {

bool same(const NearBodies& l, const NearBodies& r) {
  return std::equal(l.begin(), l.end(), r.begin(), r.end(), [](const NearBody& a, const NearBody& b) {
    return a.slot == b.slot && a.wanted == b.wanted && timeline::same(*a.record, *b.record);
  });
}

std::shared_ptr<const NearBodies> sleepers(const std::shared_ptr<const NearBodies>& all) {
  const auto awake = [](const NearBody& b) { return !b.record->body.asleep(); };
  if (std::none_of(all->begin(), all->end(), awake)) return all;
  auto rest = std::make_shared<NearBodies>();
  std::remove_copy_if(all->begin(), all->end(), std::back_inserter(*rest), awake);
  return rest;
}

BodySet set_of(const NearBodies& bodies) {
  std::vector<const NearBody*> by_id;
  by_id.reserve(bodies.size());
  std::size_t wanted = 0;
  for (const NearBody& b : bodies) {
    by_id.push_back(&b);
    for (std::size_t i = 0; i < b.record->count; ++i) wanted += b.wants(i);
  }
  std::sort(by_id.begin(), by_id.end(),
            [](const NearBody* l, const NearBody* r) { return l->record->body.id < r->record->body.id; });
  BodySet set;
  set.bodies.reserve(bodies.size());
  set.contacts.reserve(wanted);
  for (const NearBody* const b : by_id) {
    set.bodies.push_back(b->record->body);
    const auto contacts = b->record->contacts();
    for (std::size_t i = 0; i < contacts.size(); ++i)
      if (b->wants(i)) set.contacts.push_back(contacts[i]);
  }
  return set;
}

}  // namespace

void FrameBook::extend() {
  static const List nothing = std::make_shared<NearBodies>();
  entries_.push_back({entries_.empty() ? nothing : entries_.back().truth, nullptr, nullptr, 0});
}

void FrameBook::set(Step step, NearBodies truth) {
  Entry& entry = at(step);
  if (same(*entry.truth, truth)) return;
  entry.truth = std::make_shared<NearBodies>(std::move(truth));
  checked_ = std::min(checked_, step - 1);
}

std::vector<Frame> FrameBook::tell(Step upto, std::uint32_t epoch) {
  std::vector<Frame> frames;
  checked_ = std::min(checked_, upto);
  while (checked_ < upto) {
    const Step step = ++checked_;
    Entry& entry = at(step);
    if (entry.told)
      entry.holds = entry.told;
    else if (step > base_)
      entry.holds = sleepers(at(step - 1).holds);
    else
      entry.holds = std::make_shared<NearBodies>();
    if (entry.holds == entry.truth || same(*entry.holds, *entry.truth)) continue;
    entry.told = entry.holds = entry.truth;
    frames.push_back({step, {epoch, ++entry.revisions}, set_of(*entry.truth)});
  }
  return frames;
}

void FrameBook::release_before(Step step) {
  while (base_ < step) {
    entries_.pop_front();
    ++base_;
  }
}

}  // namespace soda::border
