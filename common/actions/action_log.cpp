#include "common/actions/action_log.h"

#include <algorithm>
#include <utility>

#include "common/grid.h"
#include "common/overloaded.h"

namespace soda {
ActionLog::ActionLog(const Scene& scene)
    : scene_(scene),
      largest_radius_(largest_later_radius(scene, make_grid(scene))),
      next_id_(scene.bodies.empty() ? 1 : scene.bodies.back().id + 1) {}

std::string ActionLog::body_problem(BodyId id, Step step) const {
  const std::string name = "body " + std::to_string(id);
  bool spawned = false;
  if (const auto turns = turns_.find(id); turns != turns_.end())
    for (const Turn& turn : turns->second) {
      spawned = spawned || turn.kind == Turn::Kind::kSpawned;
      if (turn.kind == Turn::Kind::kRemoved && step > turn.step)
        return name + " is removed at step " + std::to_string(turn.step + 1);
    }
  if (spawned) return "";
  const Body* const at = find_body(scene_, id);
  if (!at) return "there is no " + name;
  if (at->motion) return name + " follows a motion of its own";
  return at->is_static ? name + " is static" : "";
}

std::string ActionLog::problem(const LoggedAction& entry) const {
  const auto on_grab = [&](ActionNumber number) -> std::string {
    const auto grab = grabs_.find(number);
    if (grab == grabs_.end()) return "number " + std::to_string(number) + " is not a grab that lasts";
    if (entry.step < grab->second.step)
      return "step " + std::to_string(entry.step) + " is before what was said of grab " + std::to_string(number) +
             " last";
    return "";
  };
  if (entry.step > kMaxActionStep) return "step " + std::to_string(entry.step) + " is beyond all sessions";
  const std::string reason =
      std::visit(Overloaded{
                     [&](const MoveGrab& a) { return on_grab(a.grab); },
                     [&](const Release& a) { return on_grab(a.grab); },
                     [&](const Spawn& a) -> std::string {
                       if (next_id_ > kMaxBodyId) return "there is no id left for a new body";
                       const Body& body = a.body->bodies.front();
                       if (body.motion) return "a body that follows a motion must be there from the start";
                       const double radius = bounding_radius(*a.body, body);
                       if (radius > largest_radius_)
                         return "its bounding radius is " + std::to_string(radius) + " m; in this scene it may be " +
                                std::to_string(largest_radius_) + " m (territories depend on it)";
                       return "";
                     },
                     [&](const auto& a) { return body_problem(a.body, entry.step); },
                 },
                 entry.action);
  if (!reason.empty()) return reason;
  if (const std::size_t size = encode_action(entry).size(); size > kMaxActionBytes)
    return "it takes " + std::to_string(size) + " bytes; an action may take " + std::to_string(kMaxActionBytes);
  return "";
}

Step ActionLog::not_before(BodyId id, Step step) const {
  const auto turns = turns_.find(id);
  if (turns == turns_.end()) return step;
  for (bool moved = true; moved;) {
    const Step before = step;
    for (const Turn& turn : turns->second) {
      if (turn.kind == Turn::Kind::kSpawned) step = std::max(step, turn.step);
      if (turn.kind != Turn::Kind::kSpawned && step == turn.step) ++step;
    }
    moved = step != before;
  }
  return step;
}

void ActionLog::note(const LoggedAction& entry) {
  std::visit(Overloaded{
                 [&](const SetPose& a) {
                   turns_[a.body].push_back({Turn::Kind::kMoved, entry.step});
                 },
                 [&](const Remove& a) {
                   turns_[a.body].push_back({Turn::Kind::kRemoved, entry.step});
                   std::erase_if(grabs_, [&](const auto& grab) { return grab.second.body == a.body; });
                 },
                 [&](const Spawn& a) {
                   turns_[a.body->bodies.front().id].push_back({Turn::Kind::kSpawned, entry.step});
                 },
                 [&](const Grab& a) {
                   grabs_[entry.number] = {a.body, entry.step};
                 },
                 [&](const MoveGrab& a) { grabs_[a.grab].step = entry.step; },
                 [&](const Release& a) { grabs_.erase(a.grab); },
                 [](const auto&) {},
             },
             entry.action);
}

std::variant<LoggedAction, ActionLog::Refused> ActionLog::add(WantedAction wanted, Step first_open) {
  LoggedAction entry;
  entry.number = entries_.size() + 1;
  entry.step = std::max(first_open, wanted.step.value_or(first_open));
  entry.action = std::move(wanted.action);
  std::visit(Overloaded{[](const Spawn&) {}, [](const MoveGrab&) {}, [](const Release&) {},
                        [&](const auto& a) { entry.step = not_before(a.body, entry.step); }},
             entry.action);
  if (const std::string reason = problem(entry); !reason.empty()) return Refused{reason};
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

void ActionLog::add_all(std::vector<WantedAction> wanted, Step first_open, const std::string& where) {
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const auto result = add(std::move(wanted[i]), first_open);
    if (const auto* refused = std::get_if<Refused>(&result))
      throw ActionError(where + "action " + std::to_string(i + 1) + ": " + refused->reason);
  }
}

}  // namespace soda
