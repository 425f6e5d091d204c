#include "server/border/near_sets.h"

#include <cstring>

namespace soda::border {
namespace {

template <typename T>
bool same_bytes(const std::vector<T>& l, const std::vector<T>& r) {
  return l.size() == r.size() && (l.empty() || std::memcmp(l.data(), r.data(), l.size() * sizeof(T)) == 0);
}

}  // namespace

void keep_sleepers(BodySet& set) {
  std::erase_if(set.bodies, [](const BodyState& b) { return !b.asleep(); });
  std::size_t body = 0;
  std::erase_if(set.contacts, [&](const ContactRecord& c) {
    while (body < set.bodies.size() && set.bodies[body].id < c.a) ++body;
    return body == set.bodies.size() || set.bodies[body].id != c.a;
  });
}

bool same(const BodySet& l, const BodySet& r) {
  return same_bytes(l.bodies, r.bodies) && same_bytes(l.contacts, r.contacts);
}

const BodySet& HeardBodies::at(Step step, bool& told) {
  const auto frame = frames_.find(step);
  told = frame != frames_.end();
  if (told) {
    set_ = std::move(frame->second);
    frames_.erase(frames_.begin(), std::next(frame));
  } else {
    keep_sleepers(set_);
  }
  return set_;
}

bool ToldBodies::must_tell(const BodySet& now) {
  keep_sleepers(told_);
  if (same(told_, now)) return false;
  told_ = now;
  return true;
}

}  // namespace soda::border
