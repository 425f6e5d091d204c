// Settles the islands that are not this world's alone to solve at once: those with bodies of several worlds, for which
// parts are exchanged, and those that must wait for somebody who may touch them.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "server/border/context.h"
#include "server/border/exchange.h"
#include "server/border/threats.h"

namespace soda::border {

class Settler {
 public:
  explicit Settler(const Context& context) : context_(context) {}

  // ---- as the timeline's Arbiter: see there
  void extended(Step step);
  bool finding(Step step, bool all);
  void dropped(Step step, const timeline::Island& island);
  bool must_wait(std::span<const Aabb> boxes) { return threats_.meet(boxes); }  // at the step of the last find_threats
  void keep(Step step, timeline::Found found);

  // There is one more link.
  void add_link() {
    for (Exchange& exchange : exchanges_) exchange.told.emplace_back();
  }

  // Where those may be at `step` for whom its islands must wait.
  void find_threats(Step step);

  // Steps up to this one are worked at whenever there is anything to do: somebody waits to see it.
  void hurry(Step step) { hurry_ = std::max(hurry_, step); }

  // Whether more would come of doing a step's pending bodies now than islands that must wait, to be found again when
  // those have told their bodies for whom they wait.
  bool is_worth_doing(Step step);
  void reconsider() { deferred_.clear(); }  // something has come

  // ---- news
  void part_came(const Link& from, Part part);
  void final_part_came(const FinalPart& part);
  // Something has come that islands of all steps may have waited for.
  void retry_all();
  // Others' bodies at `step` have changed: so may whom this world's part concerns.
  void part_due(Step step) { at(step).part_due = true; }

  // A neighbour's parts of these steps have become final.
  void finals_due(Step first, Step last);

  // ---- work
  // Islands of `step` that have become whole, or need not wait any longer, are solved and handed to `settle`.
  bool try_settle(Step step, const std::function<void(const BodySet&)>& settle);
  bool has_open(Step step) const { return at(step).open(); }

  // Adds to the links' next messages the parts of `step`, all of which is found, and what has become final of those
  // that were passed on.
  void tell(Step step);
  bool told(Step step) const { return !at(step).part_due; }
  bool all_told(Step step) const { return !at(step).part_due && !at(step).finals_due; }

  // Whether all islands of the step are solved, with parts that cannot change any more.
  bool all_final(Step step) const;
  // What keeps the step's islands from being final, in words.
  std::string why_not_final(Step step) const;
  void count(Step step);
  void release_before(Step step);

 private:
  // Whether it is time to work at a step again that not all neighbours have reached, when last `before` had. Each look
  // costs about as much as what it finds to do, so it waits until as many have reached the step as will soon: one look
  // for all who keep pace, and one more for those who lag.
  bool is_time(Step step, std::size_t before) const;
  Exchange& at(Step step) { return exchanges_.at(static_cast<std::size_t>(step - base_)); }
  const Exchange& at(Step step) const { return exchanges_.at(static_cast<std::size_t>(step - base_)); }
  bool try_shared(Step step, KeptIsland& island, const std::function<void(const BodySet&)>& settle);
  BodySet solve(BodySet island);
  bool part_is_final(Step step, WorldId origin) const;
  void pass_on(Step step, const MixedIslands::Closure& closure);
  Part left_to_pass(Step step, const MixedIslands::Closure& closure, WorldId origin, WorldId to,
                    const Exchange::Passed* passed) const;
  // Whom this world's part concerns.
  struct Hearers {
    std::set<WorldId> worlds;
    bool whole = false;  // there are wide bodies: all of it concerns each of them
  };
  Hearers hearers(Step step) const;

  const Context& context_;
  std::deque<Exchange> exchanges_;
  Step base_ = 0, hurry_ = -1;
  Threats threats_;
  timeline::Marks threatening_;
  std::vector<std::pair<bool, Part>> later_parts_;  // for steps without an entry yet; whether direct
  std::vector<FinalPart> later_finals_;
  std::map<Step, std::size_t> deferred_;  // steps that were not worth doing, with so many pending bodies
  std::vector<physics::Ends> ends_;
  physics::Islands islands_;
  std::vector<std::uint32_t> all_;
  std::vector<WorldId> relays_;  // of the closure whose parts are being passed on
};

}  // namespace soda::border
