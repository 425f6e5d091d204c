// Joints in the island solver: what is held is solved as one block of up to six rows per joint, limits, motors and
// springs as rows of their own. Where the bodies are now is looked at before each pass, so that a joint turns with them
// within the step. Scalar code: the same bits whatever the contacts' kernel is.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/contact_record.h"
#include "server/physics/integrator.h"
#include "server/physics/line.h"
#include "server/physics/softness.h"

namespace soda::physics {

class JointSolver {
 public:
  void clear() { used_ = 0; }
  // `a`, `b`: positions of the bodies (b: kNoBody where it does not move); `record`: of what the joint carried.
  void add(const JointModel& model, std::uint32_t a, std::uint32_t b, std::uint32_t index, const ContactRecord& record);
  // Begins a sub-step of h s: applies what the joints carried in the one before.
  void begin(std::span<MovingBody> bodies, double h);
  // One pass over all joints, in the order in which they were added. `bias`: pull together what has come apart.
  void pass(std::span<MovingBody> bodies, bool bias);
  void store(std::span<ContactRecord> records) const;

 private:
  static constexpr int kHeld = 6;
  enum Extra { kLower, kUpper, kMotor, kSpring, kCone, kExtras };
  struct Work {
    const JointModel* model;
    std::uint32_t a, b, index;
    Vec3 linear, angular;               // N s, N m s on b, world axes, of this sub-step
    std::array<double, kExtras> extra;  // likewise, along the extra rows
    int held;
    Line row[kHeld];
    double error[kHeld];
    double factor[kHeld][kHeld];  // Cholesky's, of the effective inverse mass
    bool used[kExtras];
    Line along[kExtras];
    double extra_mass[kExtras], extra_error[kExtras];
  };
  void prepare(Work& work, std::span<const MovingBody> bodies) const;
  void solve(Work& work, std::span<MovingBody> bodies, bool bias) const;

  std::vector<Work> work_;
  std::size_t used_ = 0;
  double h_ = 0;
  Softness stiff_{};
};

}  // namespace soda::physics
