#include "server/physics/solver.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>

#include "server/physics/contact_update.h"
#include "server/physics/impacts.h"
#include "server/physics/lanes.h"
#include "server/physics/line.h"
#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

Vec3 vec(const double* p) { return Vec3(p[0], p[1], p[2]); }

double inverse_or_zero(double x) { return x > 0 ? 1 / x : 0; }

// How much each point weighs in the place where friction acts: what it carried last, or, in a new contact, the same for
// all that touch.
constexpr double kTouching = 0.005;  // m

static_assert(offsetof(MovingBody, v) == offsetof(Motion, v) && offsetof(MovingBody, w) == offsetof(Motion, w) &&
              offsetof(MovingBody, moved) == offsetof(Motion, moved) &&
              offsetof(MovingBody, turned) == offsetof(Motion, turned) && alignof(MovingBody) == alignof(Motion));

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

std::pair<Batch*, int> IslandSolver::lane_for(std::uint32_t a, std::uint32_t b) {
  bool fits = used_ > 0 && lanes_ < kLanes;
  if (fits) {
    const Batch& open = batches_[used_ - 1];
    for (int l = 0; l < lanes_; ++l)
      fits = fits && open.a[l] != a && open.a[l] != b && (open.b[l] == kNoBody || (open.b[l] != a && open.b[l] != b));
  }
  if (!fits) {
    if (used_ == batches_.size()) batches_.emplace_back();
    Batch& fresh = batches_[used_++];
    std::memset(static_cast<void*>(&fresh), 0, sizeof fresh);
    std::fill_n(fresh.a, kLanes, kNoBody);
    std::fill_n(fresh.b, kLanes, kNoBody);
    std::fill_n(fresh.record, kLanes, kNoBody);
    lanes_ = 0;
  }
  return {&batches_[used_ - 1], lanes_++};
}

void IslandSolver::prepare(std::span<const MovingBody> bodies, std::uint32_t slot_a, std::uint32_t slot_b,
                           const Surface& surface, const ContactRecord& record, Batch& batch, int lane) const {
  const MovingBody& a = bodies[slot_a];
  const MovingBody* const b = slot_b == kNoBody ? nullptr : &bodies[slot_b];
  const Softness& soft = soft_[surface.half_octaves][b ? 0 : 1];
  const double share = 1.0 / substeps_;  // of what the record carried in a step
  batch.a[lane] = slot_a;
  batch.b[lane] = slot_b;
  batch.count[lane] = record.count;
  batch.points = std::max(batch.points, record.count);
  batch.bounces = batch.bounces || surface.restitution > 0;
  batch.friction[lane] = surface.friction;
  batch.restitution[lane] = surface.restitution;
  batch.moves_on_a[lane] = surface.moves_on_a;
  batch.bias_rate[lane] = soft.bias_rate;
  batch.mass_scale[lane] = soft.mass_scale;
  batch.impulse_scale[lane] = soft.impulse_scale;
  const double inverse_mass_b = b ? b->inverse_mass : 0, linear = a.inverse_mass + inverse_mass_b;
  batch.inverse_mass_a[lane] = a.inverse_mass;
  batch.inverse_mass_b[lane] = inverse_mass_b;

  const Mat3 turn_a = turn_since(record.orientation_a, a.rotation);
  const Mat3 turn_b = turn_since(record.orientation_b, b ? b->rotation : surface.fixed->rotation);
  const Vec3 b_minus_a = (b ? b->x : surface.fixed->pose.position) - a.x;
  const Vec3 normal = vec(record.normal);
  const Vec3 tangent[2] = {normal.unitOrthogonal(), normal.cross(normal.unitOrthogonal())};
  put(batch.normal, lane, normal);
  for (int t = 0; t < 2; ++t) put(batch.tangent[t], lane, tangent[t]);

  struct Made {
    Vec3 a_turn, a_spin, b_turn, b_spin;
  };
  const auto make_row = [&](const Vec3& ra, const Vec3& rb, const Vec3& direction, Row& row) {
    Made made;
    made.a_turn = ra.cross(direction);
    made.a_spin = a.inverse_inertia * made.a_turn;
    put(row.a_turn, lane, made.a_turn);
    put(row.a_spin, lane, made.a_spin);
    if (b) {
      made.b_turn = rb.cross(direction);
      made.b_spin = b->inverse_inertia * made.b_turn;
      put(row.b_turn, lane, made.b_turn);
      put(row.b_spin, lane, made.b_spin);
    }
    return made;
  };
  const auto inverse_mass_of = [&](const Made& l, const Made& r) {
    return l.a_turn.dot(r.a_spin) + (b ? l.b_turn.dot(r.b_spin) : 0.0);
  };

  // Bodies at rest on each other keep their frozen places, as if they were one: that is what holds tall stacks up.
  // Others are pushed in one place, half way between: angular momentum is kept.
  Vec3 shift = Vec3::Zero();
  if (b) {
    const Vec3 slip = b->v + b->w.cross(vec(record.points[0].arm_b)) - a.v - a.w.cross(vec(record.points[0].arm_a));
    if (slip.squaredNorm() > kMovingSpeed * kMovingSpeed) {
      shift = 0.5 * (b_minus_a - vec(record.offset));
      shift -= normal.dot(shift) * normal;
    }
  }
  Vec3 ra[kMaxContactPoints], rb[kMaxContactPoints];
  double impulses[kMaxContactPoints], separations[kMaxContactPoints], carried = 0;
  for (std::uint32_t k = 0; k < record.count; ++k) {
    BatchPoint& p = batch.point[k];
    // The distance follows the bodies' poses; the arms at which they are pushed stay as they were when detected.
    ra[k] = vec(record.points[k].arm_a);
    rb[k] = vec(record.points[k].arm_b);
    separations[k] = normal.dot(b_minus_a + turn_b * rb[k] - turn_a * ra[k]);
    impulses[k] = share * record.points[k].impulse;
    carried += impulses[k];
    ra[k] += shift;
    rb[k] -= shift;
    const Made row = make_row(ra[k], rb[k], normal, p.row);
    p.separation[lane] = separations[k];
    p.mass[lane] = inverse_or_zero(linear + inverse_mass_of(row, row));
    p.impulse[lane] = impulses[k];
    p.lever_a[lane] = 0.5 * row.a_turn.norm();
    if (b) p.lever_b[lane] = 0.5 * row.b_turn.norm();
  }

  Vec3 centre_a = Vec3::Zero(), centre_b = Vec3::Zero();
  double weight = 0;
  for (std::uint32_t k = 0; k < record.count; ++k) {
    const double w = carried > 0 ? impulses[k] : separations[k] < kTouching ? 1 : 1e-6;
    centre_a += w * ra[k];
    centre_b += w * rb[k];
    weight += w;
  }
  centre_a /= weight;
  centre_b /= weight;
  // Friction acts half way across the gap.
  const Vec3 gap = (0.5 * normal.dot(b_minus_a + centre_b - centre_a)) * normal;
  centre_a += gap;
  centre_b -= gap;
  for (std::uint32_t k = 0; k < record.count; ++k) {
    const Vec3 arm = ra[k] - centre_a;
    batch.point[k].arm[lane] = (arm - normal.dot(arm) * normal).norm();
  }
  const Vec3 friction = share * vec(record.friction);
  Made slide[2];
  for (int t = 0; t < 2; ++t) {
    slide[t] = make_row(centre_a, centre_b, tangent[t], batch.slide[t]);
    batch.slide_impulse[t][lane] = friction.dot(tangent[t]);
  }
  const double k00 = linear + inverse_mass_of(slide[0], slide[0]);
  const double k11 = linear + inverse_mass_of(slide[1], slide[1]);
  const double k01 = inverse_mass_of(slide[0], slide[1]);
  const double inverse_determinant = inverse_or_zero(k00 * k11 - k01 * k01);
  batch.k00[lane] = k11 * inverse_determinant;
  batch.k11[lane] = k00 * inverse_determinant;
  batch.k01[lane] = -k01 * inverse_determinant;

  const Vec3 a_twist = a.inverse_inertia * normal;
  const Vec3 b_twist = b ? Vec3(b->inverse_inertia * normal) : Vec3(Vec3::Zero());
  put(batch.a_twist, lane, a_twist);
  put(batch.b_twist, lane, b_twist);
  if (record.count < 2) return;  // a single point does not hold against turning
  batch.twist_mass[lane] = inverse_or_zero(normal.dot(a_twist + b_twist));
  batch.twist_impulse[lane] = share * record.twist;
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
    const auto [batch, lane] = lane_for(a, b);
    batch->record[lane] = index;
    prepare(bodies, a, b, surfaces[index], records[index], *batch, lane);
  }
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
