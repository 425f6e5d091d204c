#include "server/timeline/effects.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include "common/overloaded.h"
#include "server/timeline/marks.h"

namespace soda::timeline {
namespace {

constexpr Step kEver = std::numeric_limits<Step>::max();

}  // namespace

Slot Effects::slot_of(BodyId id) const {
  const physics::BodyModel* const body = model_.find(id);
  if (!body) throw std::invalid_argument("action: there is no body " + std::to_string(id));
  return static_cast<Slot>(body - model_.bodies().data());
}

Effects::Held* Effects::held(ActionNumber number) {
  const auto at = std::find_if(held_.begin(), held_.end(), [&](const Held& h) { return h.number == number; });
  return at == held_.end() ? nullptr : &*at;
}

std::vector<Effects::Change> Effects::add(const LoggedAction& entry) {
  std::vector<Change> changes;
  const auto put = [&](Step step, BodyId id, Effect effect) {
    const Slot slot = slot_of(id);
    by_step_[step][slot].push_back(std::move(effect));
    changes.push_back({slot, step, step});
  };
  std::visit(Overloaded{
                 [&](const Push& a) { put(entry.step, a.body, a); },
                 [&](const SetVelocity& a) { put(entry.step, a.body, a); },
                 [&](const SetPose& a) {
                   put(entry.step, a.body, Wake{});
                   put(entry.step + 1, a.body, Given{physics::at_rest(a.body, a.position, a.orientation)});
                 },
                 [&](const Remove& a) {
                   put(entry.step, a.body, Wake{});
                   put(entry.step + 1, a.body, Given{});
                   for (Held& h : held_)
                     if (h.slot == slot_of(a.body)) h.end = std::min(h.end, entry.step + 1);
                 },
                 [&](const Spawn& a) {
                   const Body& body = a.body->bodies.front();
                   put(entry.step, body.id, Given{model_.state_of(body)});
                 },
                 [&](const Grab& a) {
                   Held h{entry.number, slot_of(a.body), entry.step, kEver, {}, {{entry.step, a.target}}};
                   h.spring = {a.point, a.target, a.frequency, a.damping_ratio, a.max_acceleration};
                   changes.push_back({h.slot, entry.step, kEver});
                   held_.push_back(std::move(h));
                 },
                 [&](const MoveGrab& a) {
                   Held* const h = held(a.grab);
                   if (!h) return;
                   h->targets[entry.step] = a.target;
                   const auto next = h->targets.upper_bound(entry.step);
                   changes.push_back({h->slot, entry.step, next == h->targets.end() ? h->end - 1 : next->first - 1});
                 },
                 [&](const Release& a) {
                   Held* const h = held(a.grab);
                   if (!h) return;
                   changes.push_back({h->slot, entry.step, h->end - 1});
                   h->end = std::min(h->end, entry.step);
                 },
             },
             entry.action);
  return changes;
}

std::span<const Effects::Effect> Effects::effects(Step step, Slot slot) const {
  const auto at_step = by_step_.find(step);
  if (at_step == by_step_.end()) return {};
  const auto at = at_step->second.find(slot);
  return at == at_step->second.end() ? std::span<const Effect>() : at->second;
}

std::vector<Slot> Effects::acted_on(Step step) const {
  std::vector<Slot> slots;
  if (const auto at_step = by_step_.find(step); at_step != by_step_.end())
    for (const auto& [slot, list] : at_step->second) slots.push_back(slot);
  for (const Held& h : held_)
    if (h.acts(step)) slots.push_back(h.slot);
  sort_unique(slots);
  return slots;
}

bool Effects::acts_on(Step step, Slot slot) const {
  if (by_step_.empty() && held_.empty()) return false;
  return !effects(step, slot).empty() ||
         std::any_of(held_.begin(), held_.end(), [&](const Held& h) { return h.slot == slot && h.acts(step); });
}

bool Effects::gives(Step step, Slot slot, std::optional<BodyState>& state) const {
  bool given = false;
  for (const Effect& effect : effects(step, slot))
    if (const auto* g = std::get_if<Given>(&effect)) {
      state = g->state;
      given = true;
    }
  return given;
}

void Effects::apply(Step step, Slot slot, BodyState& body) const {
  const auto list = effects(step, slot);
  // What came before a given state is void.
  std::size_t first = list.size();
  while (first > 0 && !std::holds_alternative<Given>(list[first - 1])) --first;
  for (const Effect& effect : list.subspan(first))
    std::visit(Overloaded{
                   [&](const Wake&) { physics::wake(body); },
                   [&](const Push& a) { physics::push(body, model_, a.impulse, a.point); },
                   [&](const SetVelocity& a) { physics::set_velocity(body, model_, a.linear, a.angular); },
                   [](const Given&) {},
               },
               effect);
  for (const Held& h : held_) {
    if (h.slot != slot || !h.acts(step)) continue;
    physics::Spring spring = h.spring;
    spring.target = std::prev(h.targets.upper_bound(step))->second;
    physics::pull(body, model_, spring);
  }
}

void Effects::forget_before(Step step) {
  by_step_.erase(by_step_.begin(), by_step_.lower_bound(step));
  std::erase_if(held_, [&](const Held& h) { return h.end <= step; });
  for (Held& h : held_) {
    // The last target before the step still acts at it.
    auto keep = h.targets.upper_bound(step);
    if (keep != h.targets.begin()) --keep;
    h.targets.erase(h.targets.begin(), keep);
  }
}

}  // namespace soda::timeline
