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
  // action that wants an earlier one, or says nothing, gets this one. A body that is moved or removed has its new state
  // one step later: what is done to it afterwards comes no earlier than that.
  std::variant<LoggedAction, Refused> add(WantedAction wanted, Step first_open);

  const std::vector<LoggedAction>& entries() const { return entries_; }  // entries()[n - 1] is number n

 private:
  struct Known {
    Step since = 0;  // its state is given by the scene, or by an action, at this step
    bool removed = false;
  };
  std::string problem(const Action& action, Step step) const;
  std::string body_problem(BodyId id) const;
  const Grab* open_grab(ActionNumber number) const;
  Step earliest(const Action& action) const;
  void note(const LoggedAction& entry);

  const Scene& scene_;
  double largest_radius_;
  BodyId next_id_;
  std::unordered_map<BodyId, Known> known_;  // bodies that are not just as in the scene
  std::map<ActionNumber, Grab> grabs_;       // open ones
  std::map<ActionNumber, Step> grab_steps_;  // of those: the step of the last word about each
  std::vector<LoggedAction> entries_;
};

}  // namespace soda
