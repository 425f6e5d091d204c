// Impacts: what meets fast at a place that bounces. Newton's law of restitution, one manifold after the other until
// nothing strikes any more (sequential impacts), so that a blow runs through a row of bodies in one go. Done before a
// sub-step moves anything: what will touch within it is turned round where it is, which costs no energy, unlike
// stopping it at the surface. No manifold may create energy, and angular momentum is kept: both bodies are struck at
// one place.
#pragma once

#include <span>

#include "server/physics/integrator.h"
#include "server/physics/solver_kernel.h"

namespace soda::physics {

// Changes the velocities of the bodies of those batches that bounce. `h`: s, the sub-step to come; `gravity`: m/s^2.
void strike(std::span<const Batch> batches, std::span<MovingBody> bodies, double h, double gravity);

}  // namespace soda::physics
