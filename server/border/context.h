// What the pieces of one world's protocol have in common.
#pragma once

#include <algorithm>
#include <deque>

#include "server/border/link.h"
#include "server/border/neighbourhood.h"
#include "server/border/world_core.h"
#include "server/timeline/timeline.h"

namespace soda::border {

struct Context {
  const physics::Model& model;
  const CoreSettings& settings;
  const Neighbourhood& neighbourhood;
  timeline::Timeline& timeline;
  std::deque<Link>& links;  // more may come, at the end
  CoreStats& stats;
  const Step& final_step;

  Link* link_to(WorldId world) const {
    for (Link& link : links)
      if (link.peer() == world) return &link;
    return nullptr;
  }
  bool all_have_reached(Step step) const {
    return std::all_of(links.begin(), links.end(), [&](const Link& link) { return link.reached(step); });
  }
  std::size_t reached_by(Step step) const {
    return static_cast<std::size_t>(
        std::count_if(links.begin(), links.end(), [&](const Link& link) { return link.reached(step); }));
  }
  // Whether a neighbour that has not reached the step has reached the one before: its next news are of this one.
  bool next_for_some(Step step) const {
    return std::any_of(links.begin(), links.end(),
                       [&](const Link& link) { return !link.reached(step) && link.reached(step - 1); });
  }
  // State `step` is final here and with every neighbour: nothing that is known of it can change.
  bool near_final(Step step) const {
    return final_step >= step &&
           std::all_of(links.begin(), links.end(), [&](const Link& link) { return link.finished(step); });
  }
};

}  // namespace soda::border
