// Where a session's actions are accepted: turns requests into entries of the log, and answers.
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "common/actions/action_log.h"
#include "common/scene/scene.h"
#include "idl/soda.h"

namespace soda::world {

class ActionDesk {
 public:
  // `actions` are there from the start. Throws ActionError where one of them is refused.
  ActionDesk(std::uint64_t instance, std::shared_ptr<const Scene> scene, std::vector<WantedAction> actions);

  // Whether the request was answered before: then that answer is `answer`, if it was the client's last.
  bool is_repeated(const wire::Request& request, std::optional<wire::Answer>& answer) const;
  // What a request of kind REQUEST_ACTION wants. May take long; from any thread, at any time. Throws ActionError.
  WantedAction read(const wire::Request& request) const;
  wire::Answer act(const wire::Request& request, WantedAction wanted, Step first_open);
  wire::Answer answer(const wire::Request& request, const std::string& refusal, Step step) const;
  // What was answered; for is_repeated.
  void note(const wire::Answer& answer);

  const std::vector<wire::LogEntry>& entries() const { return entries_; }

 private:
  void append(const LoggedAction& action);

  const std::uint64_t instance_;
  const std::shared_ptr<const Scene> scene_;
  ActionLog log_;
  std::vector<wire::LogEntry> entries_;
  std::unordered_map<std::uint64_t, wire::Answer> last_;  // by client
};

}  // namespace soda::world
