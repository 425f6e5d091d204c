// The step, a pure function: state t of some bodies in, state t + 1 out. It knows nothing of time, worlds or networks.
//
// Three parts, because between the first and the last a world may have to ask others about its islands:
//   1. find_contacts: which bodies touch at t, with what is known of their contacts from the step before;
//   2. find_islands: which of them must be solved together;
//   3. solve: any islands, each whole; one island's result depends on its own bodies and records alone.
// Any subset of the bodies that is closed (holds whole islands) gives the bits that the whole would give.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/body_set.h"
#include "server/physics/broad_phase.h"
#include "server/physics/choices.h"
#include "server/physics/constraint_order.h"
#include "server/physics/contact_update.h"
#include "server/physics/integrator.h"
#include "server/physics/islands.h"
#include "server/physics/model.h"
#include "server/physics/solver.h"

namespace soda::physics {

// Box that holds a body wherever it is within the coming step, contact margin and speculative reach included. A
// function of its state alone. Two bodies whose boxes do not overlap do not touch in this step.
Aabb reach_box(const BodyState& state, const BodyModel& model, const Mat3& rotation, const Model& scene);
Aabb reach_box(const BodyState& state, const Model& scene);
// How far at most that box goes from the body's centre, m, along each axis; quicker. `reach`: BodyModel::reach; `dt`,
// s.
double reach_bound(const BodyState& state, double reach, double dt);

// What was solved in one way, over all steps.
struct ModelShare {
  std::uint64_t islands = 0, bodies = 0, contacts = 0;  // contacts: records, those of joints included
  double seconds = 0;                                   // CPU; only kept when timing is on
};

// Which ways islands were solved in, see choices.h.
struct ModelShares {
  ModelShare flights;                                    // bodies that touched nothing
  std::array<ModelShare, kMostSubstepLevel + 1> solved;  // by the power of two that the sub-steps are, or lie below
  std::uint64_t joints_together = 0, joints_alone = 0;   // solved as a whole with others; alone
  std::uint64_t turning_flights = 0;                     // flights with gyroscopic terms
  std::uint64_t bouncing = 0;                            // contacts of pairs that bounce
};

struct StepCounters {
  std::uint64_t clamped = 0;      // bodies slowed to the scene's largest speed
  std::uint64_t non_finite = 0;   // bodies held because their result was not finite
  std::uint64_t islands = 0;      // solved (asleep and free bodies not counted)
  std::uint64_t fell_asleep = 0;  // islands
};

// CPU seconds spent in each stage; only kept when timing is on.
struct StageTimes {
  double boxes = 0, broad = 0, narrow = 0, islands = 0, order = 0, solve = 0;
};

class Stepper {
 public:
  explicit Stepper(const Model& model);

  // 1. The records at the poses of `bodies` (ascending by id) of all pairs that touch, into `out`: first those that
  // belong to wanted bodies, in canonical order, then those of the others, likewise. Returns how many are the former.
  // `previous`: for each body the records that belong to it from the step before, in canonical order. `roles`
  // (BodyRole, one per body) say which pairs are wanted; kRoleAwake is filled in here. Without roles: all pairs.
  using Records = std::span<const ContactRecord>;
  std::size_t find_contacts(std::span<const BodyState> bodies, std::span<const Records> previous,
                            std::span<const std::uint8_t> roles, std::vector<ContactRecord>& out);
  std::size_t find_contacts(const BodySet& set, std::span<const std::uint8_t> roles, std::vector<ContactRecord>& out);

  // 2. Islands of `bodies` (ascending by id) under `contacts`; every body named by a record must be there.
  void find_islands(std::span<const BodyState> bodies, std::span<const ContactRecord> contacts, std::vector<Ends>& ends,
                    Islands& islands);

  // 3. Advances the islands `which` by one step, in place: their bodies and the impulses of their records.
  void solve(std::span<BodyState> bodies, std::span<ContactRecord> contacts, std::span<const Ends> ends,
             const Islands& islands, std::span<const std::uint32_t> which);

  // All three for a closed set.
  void step(BodySet& set);

  // Another solver kernel than the machine's best, for comparisons; the bits are the same.
  void use(const Kernel& kernel) { solver_.use(kernel); }

  // The reach boxes of the bodies last given to find_contacts.
  std::span<const Aabb> boxes() const { return boxes_; }

  StepCounters counters;
  ModelShares shares;
  const ContactCounters& contact_counters() const { return updater_.counters; }
  bool timing = false;
  StageTimes times;

 private:
  void assign_slots(std::span<const BodyState> bodies);
  void place_bodies(std::span<const BodyState> bodies, std::span<const std::uint8_t> roles);
  void contacts_of(std::span<const BodyState> bodies, std::uint32_t body, std::vector<ContactRecord>& out);
  Party party(const BodyState& state, std::uint32_t slot) const;
  Party party(const StaticModel& fixed) const;
  struct Grouped {  // an island that is solved together with others
    std::uint32_t island, first_body, first_contact, contacts;
    Choice choice;
  };
  struct Chosen {
    std::uint32_t island;
    Choice choice;
  };
  void choose(std::span<const BodyState> bodies, std::span<const ContactRecord> contacts, std::span<const Ends> ends,
              const Islands& islands, std::span<const std::uint32_t> which);
  void find_surface(const ContactRecord& contact, const Ends& ends, Surface& surface) const;
  void mix_group();
  void finish(std::span<BodyState> bodies, std::span<ContactRecord> contacts, const Islands& islands,
              const Grouped& one);
  std::uint32_t slot_of(BodyId id) const;  // kStaticSlot where the id is not in the set

  const Model& model_;
  StepConstants constants_;
  StaticGrid statics_;
  BroadPhase broad_;
  ContactUpdater updater_;
  ConstraintOrder order_;
  Chooser chooser_;
  IslandSolver solver_;
  IslandFinder finder_;

  // Scratch, by position in the set at hand.
  std::vector<const BodyModel*> models_;
  std::vector<Mat3> rotations_;
  std::vector<Aabb> boxes_;
  std::vector<std::uint8_t> roles_;
  std::span<const Records> previous_;
  std::vector<Records> split_;
  Pairs pairs_;
  std::vector<std::uint32_t> near_statics_;
  std::vector<std::uint32_t> slots_;  // by position in Model::bodies()
  std::vector<std::uint32_t> slots_in_use_;
  std::vector<Vec3> centres_;
  std::vector<Surface> surfaces_;
  std::vector<std::uint32_t> island_slot_, all_;
  std::vector<Chosen> chosen_;
  std::vector<const BodyModel*> chosen_models_;
  std::vector<Grouped> group_, unmixed_;
  std::vector<std::uint32_t> sorted_, mixed_;  // contacts of the group: by island, and as they are solved
  std::vector<MovingBody> moving_;
  std::size_t moving_used_ = 0;
  // Scratch of step().
  std::vector<ContactRecord> found_;
  std::vector<Ends> ends_;
  Islands islands_;
};

}  // namespace soda::physics
