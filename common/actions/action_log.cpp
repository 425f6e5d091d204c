#include "common/actions/action_log.h"

#include <algorithm>
#include <utility>

#include "common/grid.h"

namespace soda {
namespace {

template <class... F>
struct Overloaded : F... {
  using F::operator()...;
};

}  // namespace

ActionLog::ActionLog(const Scene& scene)
    : scene_(scene),
      largest_radius_(largest_later_radius(scene, make_grid(scene))),
      next_id_(scene.bodies.empty() ? 1 : scene.bodies.back().id + 1) {}

std::string ActionLog::body_problem(BodyId id) const {
  const std::string name = "body " + std::to_string(id);
  if (const auto known = known_.find(id); known != known_.end())
    return known->second.removed ? name + " is removed at step " + std::to_string(known->second.since) : "";
  const auto at = std::lower_bound(scene_.bodies.begin(), scene_.bodies.end(), id,
                                   [](const Body& b, BodyId wanted) { return b.id < wanted; });
  if (at == scene_.bodies.end() || at->id != id) return "there is no " + name;
  return at->is_static ? name + " is static" : "";
}

const Grab* ActionLog::open_grab(ActionNumber number) const {
  const auto grab = grabs_.find(number);
  return grab == grabs_.end() ? nullptr : &grab->second;
}

std::string ActionLog::problem(const Action& action, Step step) const {
  const auto on_grab = [&](ActionNumber number) -> std::string {
    if (!open_grab(number)) return "number " + std::to_string(number) + " is not a grab that lasts";
    if (step < grab_steps_.at(number))
      return "step " + std::to_string(step) + " is before what was said of grab " + std::to_string(number) + " last";
    return "";
  };
  return std::visit(Overloaded{
                        [&](const Push& a) { return body_problem(a.body); },
                        [&](const SetVelocity& a) { return body_problem(a.body); },
                        [&](const SetPose& a) { return body_problem(a.body); },
                        [&](const Grab& a) { return body_problem(a.body); },
                        [&](const Remove& a) { return body_problem(a.body); },
                        [&](const MoveGrab& a) { return on_grab(a.grab); },
                        [&](const Release& a) { return on_grab(a.grab); },
                        [&](const Spawn& a) -> std::string {
                          if (next_id_ > kMaxBodyId) return "there is no id left for a new body";
                          const Body& body = a.body->bodies.front();
                          const double radius = bounding_radius(*a.body, body);
                          if (radius > largest_radius_)
                            return "its bounding radius is " + std::to_string(radius) + " m; in this scene it may be " +
                                   std::to_string(largest_radius_) + " m (territories depend on it)";
                          return "";
                        },
                    },
                    action);
}

// What is said of a body comes no earlier than what gave it its present state.
Step ActionLog::earliest(const Action& action) const {
  const auto since = [&](BodyId id) {
    const auto known = known_.find(id);
    return known == known_.end() ? Step{1} : known->second.since;
  };
  return std::visit(Overloaded{
                        [&](const Spawn&) { return Step{1}; },
                        [&](const MoveGrab&) { return Step{1}; },
                        [&](const Release&) { return Step{1}; },
                        [&](const auto& a) { return since(a.body); },
                    },
                    action);
}

void ActionLog::note(const LoggedAction& entry) {
  std::visit(Overloaded{
                 [&](const SetPose& a) { known_[a.body].since = entry.step + 1; },
                 [&](const Remove& a) {
                   known_[a.body] = {entry.step + 1, true};
                 },
                 [&](const Spawn& a) { known_[a.body->bodies.front().id].since = entry.step; },
                 [&](const Grab& a) {
                   grabs_[entry.number] = a;
                   grab_steps_[entry.number] = entry.step;
                 },
                 [&](const MoveGrab& a) { grab_steps_[a.grab] = entry.step; },
                 [&](const Release& a) {
                   grabs_.erase(a.grab);
                   grab_steps_.erase(a.grab);
                 },
                 [](const auto&) {},
             },
             entry.action);
}

std::variant<LoggedAction, ActionLog::Refused> ActionLog::add(WantedAction wanted, Step first_open) {
  LoggedAction entry;
  entry.number = entries_.size() + 1;
  entry.step = std::max({first_open, wanted.step.value_or(first_open), earliest(wanted.action)});
  entry.action = std::move(wanted.action);
  if (const std::string reason = problem(entry.action, entry.step); !reason.empty()) return Refused{reason};
  if (auto* spawn = std::get_if<Spawn>(&entry.action)) {
    if (wanted.id && *wanted.id != next_id_)
      return Refused{"it asks for id " + std::to_string(*wanted.id) + "; the next new body's is " +
                     std::to_string(next_id_)};
    auto named = std::make_shared<Scene>(*spawn->body);
    named->bodies.front().id = next_id_++;
    spawn->body = std::move(named);
  }
  note(entry);
  entries_.push_back(entry);
  return entry;
}

}  // namespace soda
