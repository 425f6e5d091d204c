#include "server/physics/solver.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "server/physics/impacts.h"
#include "server/physics/lanes.h"
#include "server/physics/line.h"
#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

static_assert(offsetof(MovingBody, v) == offsetof(Motion, v) && offsetof(MovingBody, w) == offsetof(Motion, w) &&
              offsetof(MovingBody, moved) == offsetof(Motion, moved) &&
              offsetof(MovingBody, turned) == offsetof(Motion, turned) &&
              offsetof(MovingBody, q) == offsetof(Motion, q) && offsetof(MovingBody, x) == offsetof(Motion, x) &&
              offsetof(MovingBody, inverse_mass) == offsetof(Motion, inverse_mass) &&
              offsetof(MovingBody, inverse_inertia) == offsetof(Motion, inverse_inertia) &&
              sizeof(MovingBody) >= sizeof(Motion) && alignof(MovingBody) == alignof(Motion));
static_assert(offsetof(ContactRecord, offset) - offsetof(ContactRecord, normal) == kRecordOffset * sizeof(double) &&
              offsetof(ContactRecord, orientation_a) - offsetof(ContactRecord, normal) ==
                  kRecordOrientationA * sizeof(double) &&
              offsetof(ContactRecord, orientation_b) - offsetof(ContactRecord, normal) ==
                  kRecordOrientationB * sizeof(double) &&
              offsetof(ContactRecord, friction) - offsetof(ContactRecord, normal) == kRecordFriction * sizeof(double) &&
              offsetof(ContactRecord, twist) - offsetof(ContactRecord, normal) == kRecordTwist * sizeof(double) &&
              offsetof(ContactRecord, points) - offsetof(ContactRecord, normal) == kRecordPoints * sizeof(double) &&
              sizeof(ContactRecord) - offsetof(ContactRecord, normal) == kRecordNumbers * sizeof(double));
static_assert(offsetof(ContactPoint, arm_b) == kPointArmB * sizeof(double) &&
              offsetof(ContactPoint, impulse) == kPointImpulse * sizeof(double) &&
              sizeof(ContactPoint) == kPointNumbers * sizeof(double));
// A pose's numbers may be loaded by fours.
static_assert(offsetof(Pose, position) + 4 * sizeof(double) <= sizeof(Pose));

// Of lanes that are not in use, and of b where it is static.
constexpr double kNoNumbers[kRecordNumbers] = {};
constexpr Motion kNoMotion = {};

// J: of two bodies' turning, and of their moving against each other.
double energy_between(const MovingBody& a, const MovingBody& b) {
  const auto turning = [](const MovingBody& body) {
    const Vec3 local = body.q.conjugate() * body.w;
    return local.dot(body.model->inertia * local);
  };
  const double masses = a.inverse_mass + b.inverse_mass;
  return 0.5 * (turning(a) + turning(b) + (masses > 0 ? (b.v - a.v).squaredNorm() / masses : 0));
}

}  // namespace

void IslandSolver::tune(std::uint32_t substeps) {
  if (substeps == substeps_) return;
  substeps_ = substeps;
  h_ = constants_.dt / substeps;
  for (std::uint32_t half = 0; half <= 2 * kMostSubstepLevel; ++half) {
    const double as_for = half == 0 ? substeps : (1u << half / 2) * (half % 2 ? std::numbers::sqrt2 : 1.0);
    const double rate = as_for / constants_.dt;
    const double hertz = std::min(kContactHertzCap, kContactHertzPerSubstepRate * rate);
    soft_[half][0] = soften(hertz, kContactDampingRatio, h_);
    soft_[half][1] = soften(kStaticHertzFactor * hertz, kStaticDampingFactor * kContactDampingRatio, h_);
  }
}

void IslandSolver::add(std::span<const MovingBody> bodies, std::uint32_t a, std::uint32_t b, std::uint32_t index,
                       const Surface& surface, const ContactRecord& record) {
  bool fits = used_ > 0 && lanes_ < kLanes;
  if (fits) {
    const Batch& open = batches_[used_ - 1];
    for (int l = 0; l < lanes_; ++l)
      fits = fits && open.a[l] != a && open.a[l] != b && (open.b[l] == kNoBody || (open.b[l] != a && open.b[l] != b));
  }
  if (!fits) {
    close_batch();
    if (used_ == batches_.size()) batches_.emplace_back();
    Batch& fresh = batches_[used_++];
    for (int l = 0; l < kLanes; ++l) {
      fresh.a[l] = fresh.b[l] = fresh.record[l] = kNoBody;
      fresh.count[l] = 0;
      inputs_[l] = {kNoNumbers, &kNoMotion, &kNoMotion, kNoNumbers, kNoNumbers, false};
    }
    fresh.points = 0;
    fresh.bounces = false;
    fresh.friction = fresh.restitution = fresh.moves_on_a = Lanes{};
    fresh.bias_rate = fresh.mass_scale = fresh.impulse_scale = fresh.carried_share = Lanes{};
    lanes_ = 0;
  }
  Batch& batch = batches_[used_ - 1];
  const int lane = lanes_++;
  const bool moving = b != kNoBody;
  const Softness& soft = soft_[surface.half_octaves][moving ? 0 : 1];
  batch.a[lane] = a;
  batch.b[lane] = b;
  batch.record[lane] = index;
  batch.count[lane] = record.count;
  batch.points = std::max(batch.points, record.count);
  batch.bounces = batch.bounces || surface.restitution > 0;
  batch.friction[lane] = surface.friction;
  batch.restitution[lane] = surface.restitution;
  batch.moves_on_a[lane] = surface.moves_on_a;
  batch.bias_rate[lane] = soft.bias_rate;
  batch.mass_scale[lane] = soft.mass_scale;
  batch.impulse_scale[lane] = soft.impulse_scale;
  batch.carried_share[lane] = surface.half_octaves > 2 * kLeastSubstepLevel ? kCarriedShare : 0;
  const auto motion = [](const MovingBody& body) { return reinterpret_cast<const Motion*>(&body); };
  LaneInput& input = inputs_[lane];
  input.record = record.normal;
  input.a = motion(bodies[a]);
  input.moving = moving;
  if (moving) {
    input.b = motion(bodies[b]);
    input.b_place = bodies[b].x.data();
    input.b_orientation = bodies[b].q.coeffs().data();
  } else {
    input.b_place = surface.fixed->pose.position.data();
    input.b_orientation = surface.fixed->pose.orientation.coeffs().data();
  }
}

void IslandSolver::close_batch() {
  if (used_ > 0) kernel_->prepare(batches_[used_ - 1], inputs_, 1.0 / substeps_);
}

void IslandSolver::settle_torques(std::span<MovingBody> bodies) const {
  for (std::size_t i = 0; i < used_; ++i) {
    const Batch& batch = batches_[i];
    for (int l = 0; l < kLanes; ++l) {
      if (batch.b[l] == kNoBody) continue;
      MovingBody &a = bodies[batch.a[l]], &b = bodies[batch.b[l]];
      const Vec3 of_a = -batch.moves_on_a[l] * get(batch.owed, l),
                 of_b = (batch.moves_on_a[l] - 1) * get(batch.owed, l);
      const Vec3 turn_a = a.inverse_inertia * of_a, turn_b = b.inverse_inertia * of_b;
      // Of small bodies that whirl it would be out of all proportion: what would turn them by much, and make them
      // faster by more than a little, is left unpaid.
      const double first_order = of_a.dot(a.w) + of_b.dot(b.w);
      const double work = first_order + 0.5 * (of_a.dot(turn_a) + of_b.dot(turn_b));
      const double turn = constants_.dt * std::sqrt(std::max(turn_a.squaredNorm(), turn_b.squaredNorm()));
      const bool too_much = work > 0 && turn > kOwedTurn && work > kOwedShare * energy_between(a, b);
      const double kept = too_much ? allowed(work, first_order) : 1;
      a.w += kept * turn_a;
      b.w += kept * turn_b;
    }
  }
}

void IslandSolver::store(std::span<ContactRecord> records) const {
  const double whole = substeps_;
  for (std::size_t i = 0; i < used_; ++i) {
    const Batch& batch = batches_[i];
    for (int l = 0; l < kLanes; ++l) {
      if (batch.record[l] == kNoBody) continue;
      ContactRecord& record = records[batch.record[l]];
      for (std::uint32_t k = 0; k < record.count; ++k) record.points[k].impulse = whole * batch.point[k].impulse[l];
      const Vec3 friction = (whole * batch.slide_impulse[0][l]) * get(batch.tangent[0], l) +
                            (whole * batch.slide_impulse[1][l]) * get(batch.tangent[1], l);
      for (int axis = 0; axis < 3; ++axis) record.friction[axis] = friction[axis];
      record.twist = whole * batch.twist_impulse[l];
    }
  }
}

void IslandSolver::solve(std::uint32_t substeps, std::span<MovingBody> bodies, std::span<const std::uint32_t> slot_of,
                         std::span<const std::uint32_t> contacts, std::span<const Ends> ends,
                         std::span<const Surface> surfaces, std::span<ContactRecord> records) {
  tune(substeps);
  used_ = 0;
  joints_.clear(substeps);
  for (const std::uint32_t index : contacts) {
    const std::uint32_t a = slot_of[ends[index].a];
    const std::uint32_t b = ends[index].b == kStaticSlot ? kNoBody : slot_of[ends[index].b];
    if (surfaces[index].joint) {
      joints_.add(*surfaces[index].joint, a, b, index, records[index]);
      continue;
    }
    add(bodies, a, b, index, surfaces[index], records[index]);
  }
  close_batch();
  joints_.arrange(bodies);
  const Bodies moving{reinterpret_cast<std::byte*>(bodies.data()), sizeof(MovingBody)};
  const bool bounces = std::any_of(batches_.begin(), batches_.begin() + static_cast<std::ptrdiff_t>(used_),
                                   [](const Batch& batch) { return batch.bounces; });
  const double gravity = constants_.gravity.norm();
  for (std::uint32_t i = 0; i < substeps; ++i) {
    if (bounces) strike(std::span(batches_).first(used_), bodies, h_, gravity);
    for (MovingBody& body : bodies) accelerate(body, h_, constants_);
    joints_.begin(bodies, h_);
    kernel_->warm_start(batches_.data(), used_, moving);
    joints_.pass(bodies, true);
    kernel_->pass(batches_.data(), used_, moving, 1 / h_, true);
    for (MovingBody& body : bodies) move(body, h_, constants_);
    joints_.pass(bodies, false);
    kernel_->pass(batches_.data(), used_, moving, 1 / h_, false);
  }
  settle_torques(bodies);
  store(records);
  joints_.store(records);
}

}  // namespace soda::physics
