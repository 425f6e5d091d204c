// Bodies that follow a prescribed motion. Their clock, the number of steps since they were there first, is part of
// their state: BodyState::quiet_steps, which they need for nothing else.
#pragma once

#include "common/body_state.h"
#include "common/scene/scene.h"

namespace soda::physics {

// The state of such a body after so many steps of dt s. Its velocity is the mean one of the step to come, so that what
// touches it is carried exactly as far as it moves.
void follow(const Body& body, std::uint32_t steps, double dt, BodyState& state);

}  // namespace soda::physics
