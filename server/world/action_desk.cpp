#include "server/world/action_desk.h"

#include <cstring>
#include <utility>

namespace soda::world {

ActionDesk::ActionDesk(std::uint64_t instance, std::shared_ptr<const Scene> scene, std::vector<WantedAction> actions)
    : instance_(instance), scene_(std::move(scene)), log_(*scene_) {
  log_.add_all(std::move(actions), 1);
  for (const LoggedAction& action : log_.entries()) append(action);
}

void ActionDesk::append(const LoggedAction& action) {
  const std::string bytes = encode_action(action);
  wire::LogEntry entry;
  entry.instance(instance_);
  entry.number(action.number);
  entry.action().resize(bytes.size());
  std::memcpy(entry.action().data(), bytes.data(), bytes.size());
  entries_.push_back(std::move(entry));
}

bool ActionDesk::is_repeated(const wire::Request& request, std::optional<wire::Answer>& answer) const {
  const auto last = last_.find(request.client());
  if (last == last_.end() || last->second.number() < request.number()) return false;
  if (last->second.number() == request.number()) answer = last->second;
  return true;
}

wire::Answer ActionDesk::answer(const wire::Request& request, const std::string& refusal, Step step) const {
  wire::Answer answer;
  answer.instance(instance_);
  answer.client(request.client());
  answer.number(request.number());
  answer.accepted(refusal.empty());
  answer.reason(refusal.substr(0, 1000));
  answer.step(step);
  return answer;
}

WantedAction ActionDesk::read(const wire::Request& request) const {
  const std::string_view bytes(reinterpret_cast<const char*>(request.action().data()), request.action().size());
  WantedAction wanted = decode_action(bytes, *scene_);
  wanted.step.reset();  // one that has been waited for would bind a body until then
  return wanted;
}

wire::Answer ActionDesk::act(const wire::Request& request, WantedAction wanted, Step first_open) {
  const auto result = log_.add(std::move(wanted), first_open);
  if (const auto* refused = std::get_if<ActionLog::Refused>(&result)) return answer(request, refused->reason, 0);
  const auto& action = std::get<LoggedAction>(result);
  append(action);
  wire::Answer accepted = answer(request, "", action.step);
  accepted.logged(action.number);
  if (const auto* spawn = std::get_if<Spawn>(&action.action)) accepted.body(spawn->body->bodies.front().id);
  return accepted;
}

void ActionDesk::note(const wire::Answer& answer) {
  constexpr std::size_t kAtMost = 65536;  // clients
  if (last_.size() >= kAtMost) last_.clear();
  last_[answer.client()] = answer;
}

}  // namespace soda::world
