// The island solver: TGS-soft, that is sub-steps with one pass over soft constraints each and one relaxing pass
// (E. Catto, "Solver2D", 2024; sub-steps instead of iterations: Macklin et al., "Small Steps in Physics Simulation",
// SCA 2019). Double precision, four constraints at a time (solver_kernel.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/contact_record.h"
#include "server/physics/integrator.h"
#include "server/physics/islands.h"
#include "server/physics/joints.h"
#include "server/physics/softness.h"
#include "server/physics/solver_kernel.h"
#include "server/physics/tuning.h"

namespace soda::physics {

// What a contact is made of besides its record.
struct Surface {
  double friction = 0, restitution = 0;  // of the pair
  // How much of the place of contact's motion against the bodies is against a: nothing of round bodies, which roll on
  // under it, and all of what they roll on.
  double moves_on_a = 0.5;
  std::uint32_t half_octaves = 0;      // of stiffness, see Choice
  const StaticModel* fixed = nullptr;  // b, where it is static
  const JointModel* joint = nullptr;   // or, instead of all of these, the joint that the record is of
};

class IslandSolver {
 public:
  // `constants` must outlive the solver.
  IslandSolver(const StepConstants& constants, JointMethod joints) : constants_(constants), joints_(joints) {}

  // Joints solved since the start, as a whole with others and alone.
  std::uint64_t joints_together() const { return joints_.together; }
  std::uint64_t joints_alone() const { return joints_.alone; }

  // Another kernel than the machine's best, for comparisons.
  void use(const Kernel& kernel) { kernel_ = &kernel; }

  // Advances the bodies of some awake islands by one step of `substeps` sub-steps. `contacts` are positions in
  // `records` (with `ends` and `surfaces` alongside), each island's in its solving order; between islands, which share
  // no moving body, any order gives the same bits, and mixing them fills the lanes. `slot_of` maps a body's position in
  // `ends` to its position in `bodies`. Impulses are written back into `records`.
  void solve(std::uint32_t substeps, std::span<MovingBody> bodies, std::span<const std::uint32_t> slot_of,
             std::span<const std::uint32_t> contacts, std::span<const Ends> ends, std::span<const Surface> surfaces,
             std::span<ContactRecord> records);

 private:
  // A contact of these two bodies goes into the next lane of the newest batch, if it has room and shares neither.
  void add(std::span<const MovingBody> bodies, std::uint32_t a, std::uint32_t b, std::uint32_t index,
           const Surface& surface, const ContactRecord& record);
  void close_batch();  // the newest gets no more
  // Pays what the contacts' places owe in angular momentum: see Batch::owed.
  void settle_torques(std::span<MovingBody> bodies) const;
  void store(std::span<ContactRecord> records) const;
  void tune(std::uint32_t substeps);

  const StepConstants& constants_;
  std::uint32_t substeps_ = 0;
  double h_ = 0;                                      // s, one sub-step
  Softness soft_[2 * kMostSubstepLevel + 1][2] = {};  // by half octaves, and whether against a static body
  const Kernel* kernel_ = &chosen_kernel();
  JointSolver joints_;
  std::vector<Batch> batches_;
  std::size_t used_ = 0;           // of batches_
  int lanes_ = 0;                  // used in the newest
  LaneInput inputs_[kLanes] = {};  // of the newest
};

}  // namespace soda::physics
