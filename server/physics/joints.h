// Joints in the island solver. What joints hold is solved as a whole for all joints that hang together by bodies:
// chains and trees directly, so that a heavy load on a chain of light links costs no more than a light one. Limits,
// motors and springs are rows of their own, solved one after the other. Where the bodies are now is looked at before
// each pass, so that a joint turns with them within the step. Scalar code: the same bits whatever the contacts' kernel
// is.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/contact_record.h"
#include "common/scene/scene.h"
#include "server/physics/integrator.h"
#include "server/physics/line.h"
#include "server/physics/skyline.h"
#include "server/physics/softness.h"

namespace soda::physics {

class JointSolver {
 public:
  explicit JointSolver(JointMethod method) : method_(method) {}

  // Begins a step of so many sub-steps.
  void clear(std::uint32_t substeps);
  // `a`, `b`: positions of the bodies (b: kNoBody where it does not move); `record`: of what the joint carried.
  void add(const JointModel& model, std::uint32_t a, std::uint32_t b, std::uint32_t index, const ContactRecord& record);
  // After the last of them: finds out which joints are solved together.
  void arrange(std::span<const MovingBody> bodies);
  // Begins a sub-step of h s: applies what the joints carried in the one before.
  void begin(std::span<MovingBody> bodies, double h);
  // One pass over all clusters: first limits, motors and springs, joint by joint, then what is held, as a whole.
  // `bias`: pull together what has come apart.
  void pass(std::span<MovingBody> bodies, bool bias);
  void store(std::span<ContactRecord> records) const;

  // Joints added since they were last looked at that were solved together with others, and alone.
  std::uint64_t together = 0, alone = 0;

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
    bool used[kExtras];
    Line along[kExtras];
    double extra_mass[kExtras], extra_error[kExtras];
    double linear_mass;       // 1/kg: sum of both inverse masses
    std::uint32_t first_row;  // of matrix_
    bool joins;               // may be solved together with others
  };
  // Those that are solved together: of rigid joints all that hang together by bodies that can be pushed, unless that
  // would be too much; any other joint alone.
  struct Cluster {
    std::uint32_t first, end;  // in order_
    bool whole;                // nothing that should be part of it is not
  };

  static double response_by(std::uint32_t body, const MovingBody& moving, const Work& l, int row, const Work& r,
                            int column);
  void gather(std::uint32_t start, std::vector<std::uint32_t>& found);
  void add_cluster(std::span<const std::uint32_t> members);
  void prepare(Work& work, std::span<const MovingBody> bodies) const;
  void prepare(std::span<const MovingBody> bodies);
  void couple(const Cluster& cluster, std::span<const MovingBody> bodies);
  void push_extras(Work& work, std::span<MovingBody> bodies, bool bias) const;
  void push_held(const Cluster& cluster, std::span<MovingBody> bodies, bool bias);
  std::span<const std::uint32_t> joints_at(std::uint32_t body) const;

  JointMethod method_;
  std::vector<Work> work_;
  std::size_t used_ = 0;
  std::uint32_t substeps_ = 1;
  double h_ = 0;
  Softness stiff_{}, stiff_whole_{};  // of rows that are iterated, and of whole clusters

  std::vector<Cluster> clusters_;
  std::vector<std::uint32_t> order_;  // joints, cluster by cluster
  Skyline matrix_;                    // of all clusters, one after the other
  std::vector<double> solution_, pull_, solution_of_pull_;
  std::vector<std::uint32_t> first_at_, at_;  // the joints at each body
  // Scratch of arrange.
  std::vector<std::uint32_t> once_, again_, first_row_at_;
  std::vector<std::uint64_t> seen_, seen_body_;
  std::vector<bool> done_;
  std::uint64_t sight_ = 0;
};

// Whether what the joint holds is a spring.
inline bool holds_softly(const Joint& joint) {
  return joint.spring && (joint.kind == JointKind::kFixed || joint.kind == JointKind::kBall);
}

}  // namespace soda::physics
