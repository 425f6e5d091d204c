// The island solver: TGS-soft, that is sub-steps with one pass over soft constraints each and one relaxing pass
// (E. Catto, "Solver2D", 2024; sub-steps instead of iterations: Macklin et al., "Small Steps in Physics Simulation",
// SCA 2019). Scalar, double precision.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/contact_record.h"
#include "server/physics/integrator.h"
#include "server/physics/islands.h"

namespace soda::physics {

// What a contact is made of besides its record.
struct Surface {
  double friction = 0, restitution = 0;  // of the pair
  const StaticModel* fixed = nullptr;    // b, where it is static
};

class IslandSolver {
 public:
  // `constants` must outlive the solver.
  explicit IslandSolver(const StepConstants& constants)
      : constants_(constants), soft_(softness(false)), soft_static_(softness(true)) {}

  // Advances the bodies of one awake island by one step. `contacts` are positions in `records` (with `ends` and
  // `surfaces` alongside), in solving order. `slot_of` maps a body's position in `ends` to its position in `island`.
  // Impulses are written back into `records`.
  void solve(std::span<MovingBody> island, std::span<const std::uint32_t> slot_of,
             std::span<const std::uint32_t> contacts, std::span<const Ends> ends, std::span<const Surface> surfaces,
             std::span<ContactRecord> records);

 private:
  struct Row {            // one direction at one place
    Vec3 a_turn, b_turn;  // r x direction, for each body: the angular Jacobian
    Vec3 a_spin, b_spin;  // inverse inertia times that: change of angular velocity per unit of impulse
  };
  struct PointConstraint {
    Row row;
    double mass;        // effective mass along the normal, kg
    double separation;  // m, at the start of the step
    double impulse;     // N s, accumulated, of this sub-step
    double most;        // N s, the largest impulse of the step: whether the point ever pushed
    double approach;    // m/s, normal velocity before the step
    double arm;         // m, from the friction centre, for the twist limit
  };
  struct Constraint {
    std::uint32_t a, b;  // positions in the island; b may be kStaticSlot
    std::uint32_t record;
    std::uint32_t count;
    double inverse_mass_a, inverse_mass_b;
    double friction, restitution;
    Vec3 normal, tangent[2];
    PointConstraint points[kMaxContactPoints];
    Row slide[2];
    double k00, k01, k11;  // inverse of the 2 x 2 effective-mass matrix of the tangents, kg
    double slide_impulse[2];
    Vec3 a_twist, b_twist;  // inverse inertia times the normal
    double twist_mass, twist_impulse;
  };
  struct Softness {
    double bias_rate, mass_scale, impulse_scale;
  };

  void prepare(std::span<const MovingBody> island, std::span<const std::uint32_t> slot_of,
               std::span<const std::uint32_t> contacts, std::span<const Ends> ends, std::span<const Surface> surfaces,
               std::span<const ContactRecord> records);
  void warm_start(std::span<MovingBody> island);
  template <bool kUseBias>
  void pass(std::span<MovingBody> island);
  template <bool kUseBias, bool kStatic>
  void solve_constraint(Constraint& c, MovingBody& a, MovingBody* b, const Softness& soft) const;
  void restitution(std::span<MovingBody> island);
  void store(std::span<ContactRecord> records) const;
  Softness softness(bool with_static) const;

  const StepConstants& constants_;
  Softness soft_, soft_static_;
  std::vector<Constraint> constraints_;
};

}  // namespace soda::physics
