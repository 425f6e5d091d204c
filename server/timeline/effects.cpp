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

void Effects::check_known(BodyId id) const {
  if (!model_.find(id)) throw std::invalid_argument("action: there is no body " + std::to_string(id));
}

Effects::Held* Effects::held(ActionNumber number) {
  const auto at = std::find_if(held_.begin(), held_.end(), [&](const Held& h) { return h.number == number; });
  return at == held_.end() ? nullptr : &*at;
}

std::vector<Effects::Change> Effects::add(const LoggedAction& entry) {
  std::vector<Change> changes;
  const auto put = [&](Step step, BodyId id, Effect effect) {
    check_known(id);
    by_step_[step][id].push_back(std::move(effect));
    changes.push_back({id, step, step});
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
                     if (h.body == a.body) h.end = std::min(h.end, entry.step + 1);
                 },
                 [&](const Spawn& a) {
                   const Body& body = a.body->bodies.front();
                   put(entry.step, body.id, Given{model_.state_of(body)});
                 },
                 [&](const Grab& a) {
                   check_known(a.body);
                   Held h{entry.number, a.body, entry.step, kEver, {}, {{entry.step, a.target}}};
                   h.spring = {a.point, a.target, a.frequency, a.damping_ratio, a.max_acceleration};
                   changes.push_back({h.body, entry.step, kEver});
                   held_.push_back(std::move(h));
                 },
                 [&](const MoveGrab& a) {
                   Held* const h = held(a.grab);
                   if (!h) return;
                   h->targets[entry.step] = a.target;
                   const auto next = h->targets.upper_bound(entry.step);
                   changes.push_back({h->body, entry.step, next == h->targets.end() ? h->end - 1 : next->first - 1});
                 },
                 [&](const Release& a) {
                   Held* const h = held(a.grab);
                   if (!h) return;
                   changes.push_back({h->body, entry.step, h->end - 1});
                   h->end = std::min(h->end, entry.step);
                 },
             },
             entry.action);
  return changes;
}

std::span<const Effects::Effect> Effects::effects(Step step, BodyId id) const {
  const auto at_step = by_step_.find(step);
  if (at_step == by_step_.end()) return {};
  const auto at = at_step->second.find(id);
  return at == at_step->second.end() ? std::span<const Effect>() : at->second;
}

std::vector<BodyId> Effects::acted_on(Step step) const {
  std::vector<BodyId> ids;
  if (const auto at_step = by_step_.find(step); at_step != by_step_.end())
    for (const auto& [id, list] : at_step->second) ids.push_back(id);
  for (const Held& h : held_)
    if (h.acts(step)) ids.push_back(h.body);
  sort_unique(ids);
  return ids;
}

bool Effects::acts_on(Step step, BodyId id) const {
  if (by_step_.empty() && held_.empty()) return false;
  return !effects(step, id).empty() ||
         std::any_of(held_.begin(), held_.end(), [&](const Held& h) { return h.body == id && h.acts(step); });
}

bool Effects::gives(Step step, BodyId id, std::optional<BodyState>& state) const {
  bool given = false;
  for (const Effect& effect : effects(step, id))
    if (const auto* g = std::get_if<Given>(&effect)) {
      state = g->state;
      given = true;
    }
  return given;
}

void Effects::apply(Step step, BodyState& body) const {
  const auto list = effects(step, body.id);
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
    if (h.body != body.id || !h.acts(step)) continue;
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
