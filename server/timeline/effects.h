// The action log as a timeline uses it: what is done to which body at which step. A function of the log alone.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "common/actions/action.h"
#include "server/physics/actions.h"
#include "server/physics/model.h"

namespace soda::timeline {

class Effects {
 public:
  explicit Effects(const physics::Model& model) : model_(model) {}

  // Steps at which the state of a body is not what it was before the entry came.
  struct Change {
    BodyId body = 0;
    Step first = 0, last = 0;
  };
  // The next entry of the log. A spawned body must be in the model already.
  std::vector<Change> add(const LoggedAction& entry);

  // Bodies that something is done to at the step, ascending.
  std::vector<BodyId> acted_on(Step step) const;
  bool acts_on(Step step, BodyId id) const;
  // Whether the body's state at the step is given by an action, whatever happened before: then that state, or none if
  // it is taken away.
  bool gives(Step step, BodyId id, std::optional<BodyState>& state) const;
  // Does to `body`, which is the step's result or the state given for it, what else is done to it at the step.
  void apply(Step step, BodyState& body) const;

  void forget_before(Step step);

 private:
  struct Wake {};
  struct Given {
    std::optional<BodyState> state;
  };
  using Effect = std::variant<Wake, Push, SetVelocity, Given>;
  struct Held {  // a grab
    ActionNumber number = 0;
    BodyId body = 0;
    Step first = 0, end = 0;  // it acts from `first` until before `end`
    physics::Spring spring;
    std::map<Step, Vec3> targets;  // from these steps on
    bool acts(Step step) const { return step >= first && step < end; }
  };
  void check_known(BodyId id) const;
  std::span<const Effect> effects(Step step, BodyId id) const;
  Held* held(ActionNumber number);

  const physics::Model& model_;
  std::map<Step, std::map<BodyId, std::vector<Effect>>> by_step_;  // in the log's order
  std::vector<Held> held_;                                         // likewise
};

}  // namespace soda::timeline
