// What an island needs of the step: a pure function of its state and the scene, so that it is the same on any number of
// worlds. Made of maxima and minima over bodies and contacts alone, whose order they do not notice.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/body_state.h"
#include "common/contact_record.h"
#include "server/physics/integrator.h"
#include "server/physics/islands.h"
#include "server/physics/model.h"

namespace soda::physics {

// How an island is solved in one step.
struct Choice {
  std::uint32_t substeps = 1;
  // Contacts are as stiff as 2^stiffness sub-steps allow. It is remembered in the bodies' state, and follows what the
  // island would have with some reluctance: contacts whose stiffness changes all the time fell stacks. 0: as stiff as
  // the sub-steps themselves allow, where the scene says how many those are.
  std::uint32_t stiffness = 0;
  // A heap, solved in half of those sub-steps. Its contacts are softer than said by a root of two: fully as stiff,
  // boxes in it would swing against each other for a quarter of a minute. Remembered, too.
  bool heap = false;
  // Stiffness in steps of a root of two; 0 as above.
  std::uint32_t half_octaves() const { return 2 * stiffness - (heap ? 1 : 0); }
};

// One island, with the scratch of the set that it is part of.
struct IslandView {
  std::span<const std::uint32_t> bodies, contacts;  // positions in the following
  std::span<const BodyState> states;
  std::span<const BodyModel* const> models;  // of the states
  std::span<const ContactRecord> records;
  std::span<const Ends> ends;  // of the records
};

class Chooser {
 public:
  Chooser(const Model& model, const StepConstants& constants)
      : model_(model), constants_(constants), iterated_(model.scene().joint_method == JointMethod::kIterated) {}

  Choice choose(const IslandView& island);

 private:
  bool bears(const ContactRecord& record) const { return iterated_ || !is_joint(record); }
  double stiffness_wanted(const IslandView& island);
  double swing_wanted(const IslandView& island, std::uint32_t record) const;
  double motion_wanted(const IslandView& island) const;
  std::uint32_t depth_from_ground(const IslandView& island);

  const Model& model_;
  const StepConstants& constants_;
  const bool iterated_;  // joints are, and so bear loads as contacts do
  double deepest_ = 0;   // of the island at hand: contacts from the ground; 0 where nothing rests on anything
  std::vector<std::uint32_t> depth_, first_;         // scratch, by position of the body
  std::vector<std::uint32_t> next_, level_, later_;  // scratch
};

// Sub-steps in which a body that touches nothing turns through a step: more than one only where its inertia is not the
// same about all axes.
std::uint32_t flight_substeps(const BodyState& state, const BodyModel& model, const StepConstants& constants);

}  // namespace soda::physics
