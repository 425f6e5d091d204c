// The log of a session's actions: the one place that says of an action whether it is accepted, at which step, under
// which number, and which id a spawned body gets. Knows no network and no clock.
#pragma once

#include <map>
#include <string>
#include <unordered_map>
#include <variant>
#include <vector>

#include "common/actions/action.h"
#include "common/actions/action_proto.h"
#include "common/scene/scene.h"

namespace soda {

class ActionLog {
 public:
  // `scene` must outlive it.
  explicit ActionLog(const Scene& scene);

  struct Refused {
    std::string reason;
  };
  // The action is the log's newest if it is accepted. `first_open`: no step before it may be changed any more; an
  // action that wants an earlier one, or says nothing, gets this one. Where a body is moved or removed at that very
  // step, or spawned later, it gets the first at which the body has its new state.
  std::variant<LoggedAction, Refused> add(WantedAction wanted, Step first_open);
  // Those that a run begins with. Throws ActionError for the first that is refused: `where`, then "action 2: ...".
  void add_all(std::vector<WantedAction> wanted, Step first_open, const std::string& where = "");

  const std::vector<LoggedAction>& entries() const { return entries_; }  // entries()[n - 1] is number n

 private:
  // A body is given another state, or none any more.
  struct Turn {
    enum class Kind { kSpawned, kMoved, kRemoved };
    Kind kind;
    Step step;  // of the action; a move or removal takes effect one step later
  };
  struct OpenGrab {
    BodyId body = 0;
    Step step = 0;  // of the last word about it
  };
  std::string problem(const LoggedAction& entry) const;
  std::string body_problem(BodyId id, Step step) const;
  Step not_before(BodyId id, Step step) const;
  void note(const LoggedAction& entry);

  const Scene& scene_;
  double largest_radius_;
  BodyId next_id_;
  std::unordered_map<BodyId, std::vector<Turn>> turns_;
  std::map<ActionNumber, OpenGrab> grabs_;
  std::vector<LoggedAction> entries_;
};

}  // namespace soda
