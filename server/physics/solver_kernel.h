// The inner loops of the island solver: the same code for each instruction set, four constraints at a time, one in each
// lane. Arithmetic is that of IEEE 754 doubles in a fixed order, without fused operations, so that all sets give the
// same bits; which one runs is chosen when the program does.
//
// Plain arrays, and no library below: what is compiled for a newer instruction set must not share a function with what
// is not.
#pragma once

#include <cstddef>
#include <cstdint>

namespace soda::physics {

constexpr int kLanes = 4;
// One number of each of four constraints. Their alignment is said, because it must not depend on the instruction set
// that a file is compiled for. Compilers without the instructions take two or four apart.
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double)), aligned(kLanes * sizeof(double))));
struct Lanes3 {
  Lanes x, y, z;
};

constexpr std::uint32_t kNoBody = 0xffffffffu;  // a static one, or of a lane that is not in use

// What the kernels know of a body, at the start of each one of the array that they are given.
struct alignas(32) Motion {
  double v[4], w[4];           // m/s, rad/s; the fourth is 0 in all of them
  double moved[4], turned[4];  // m, rad: since the start of the step
  double q[4];                 // orientation, x, y, z, w
  double x[3];                 // m, at the start of the step
  double inverse_mass;         // 1/kg
  double inverse_inertia[9];   // world frame, at the start of the step
  double unused;               // what is behind the nine is loaded with the last of them
};

struct Row {              // one direction at one place
  Lanes3 a_turn, b_turn;  // r x direction, for each body: the angular Jacobian
  Lanes3 a_spin, b_spin;  // inverse inertia times that: change of angular velocity per unit of impulse
};

struct BatchPoint {
  Row row;
  Lanes mass;        // effective mass along the normal, kg; 0: there is no such point
  Lanes separation;  // m, at the start of the step
  Lanes impulse;     // N s, accumulated, of this sub-step
  Lanes carried;     // N s, that the spring need not give: see kCarriedShare
  Lanes arm;         // m, from the friction centre, for the twist limit
};

// Up to four contacts that share no moving body. Lanes that are not in use are all zero, and stay so.
struct Batch {
  std::uint32_t a[kLanes], b[kLanes];    // bodies, or kNoBody
  std::uint32_t record[kLanes];          // kNoBody: the lane is not in use
  std::uint32_t count[kLanes];           // of points
  std::uint32_t points;                  // the largest of these
  bool bounces;                          // some restitution is not 0
  Lanes inverse_mass_a, inverse_mass_b;  // 1/kg
  Lanes friction, restitution, moves_on_a;
  Lanes bias_rate, mass_scale, impulse_scale;  // of soft contacts
  Lanes carried_share;                         // see kCarriedShare
  Lanes3 normal, tangent[2];
  BatchPoint point[4];
  Row slide[2];
  Lanes k00, k01, k11;  // inverse of the 2 x 2 effective-mass matrix of the tangents, kg
  Lanes slide_impulse[2];
  Lanes3 a_twist, b_twist;  // inverse inertia times the normal
  Lanes twist_mass, twist_impulse;
  // N m s: places of contact move apart within the step; what is pushed in one place of a and in another of b makes a
  // torque, which both owe.
  Lanes3 owed;
};

// What a lane's contact is made of: the numbers of a ContactRecord from its normal on, the bodies (b: one that is
// nothing but zeros where it is static), and where b is.
struct LaneInput {
  const double* record;
  const Motion *a, *b;
  const double *b_place, *b_orientation;
  bool moving;  // b is not static
};
// Where in those numbers.
enum RecordNumber {
  kRecordNormal = 0,
  kRecordOffset = 3,
  kRecordOrientationA = 6,
  kRecordOrientationB = 10,
  kRecordFriction = 14,
  kRecordTwist = 17,
  kRecordPoints = 18
};
enum PointNumber { kPointArmA = 0, kPointArmB = 3, kPointImpulse = 6, kPointNumbers = 7 };
constexpr int kRecordNumbers = kRecordPoints + 4 * kPointNumbers;

struct Bodies {
  std::byte* first;    // a Motion
  std::size_t stride;  // bytes from one to the next
};

struct Kernel {
  const char* name;
  // Rows, masses and impulses of a batch, of which bodies, records, counts, points, friction, restitution and softness
  // are set: from as many inputs as there are lanes. `share`: of what the records carried, that is a sub-step's.
  void (*prepare)(Batch& batch, const LaneInput* inputs, double share);
  void (*warm_start)(const Batch* batches, std::size_t count, Bodies bodies);
  // One pass over all constraints, in order. `bias`: push out what overlaps.
  void (*pass)(Batch* batches, std::size_t count, Bodies bodies, double inverse_h, bool bias);
};

// The best that this machine has; or what the environment's SODA_SIMD names (baseline, avx2), for comparisons. Throws
// std::runtime_error where it names something else, or what this machine lacks.
const Kernel& chosen_kernel();

// Those that this machine has, the baseline first.
struct Kernels {
  const Kernel* list[2];
  int count;
};
Kernels available_kernels();

}  // namespace soda::physics
