#include "server/physics/solver.h"

#include <algorithm>
#include <cmath>

#include "server/physics/contact_update.h"
#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

Vec3 vec(const double* p) { return Vec3(p[0], p[1], p[2]); }

double inverse_or_zero(double x) { return x > 0 ? 1 / x : 0; }

// How much each point weighs in the place where friction acts: what it carried last, or, in a new contact, the same for
// all that touch.
constexpr double kTouching = 0.005;  // m

}  // namespace

IslandSolver::Softness IslandSolver::softness(bool with_static) const {
  const double h = constants_.h;
  double hertz = std::min(kContactHertzCap, kContactHertzPerSubstepRate / h);
  double damping = kContactDampingRatio;
  if (with_static) hertz *= kStaticHertzFactor, damping *= kStaticDampingFactor;
  // Catto 2024: a harmonic oscillator of that frequency and damping, integrated implicitly over h.
  const double omega = 2 * 3.14159265358979323846 * hertz;
  const double a1 = 2 * damping + h * omega, a2 = h * omega * a1, a3 = 1 / (1 + a2);
  return {omega / a1, a2 * a3, a3};
}

void IslandSolver::prepare(std::span<const MovingBody> island, std::span<const std::uint32_t> slot_of,
                           std::span<const std::uint32_t> contacts, std::span<const Ends> ends,
                           std::span<const Surface> surfaces, std::span<const ContactRecord> records) {
  constraints_.resize(contacts.size());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const std::uint32_t index = contacts[i];
    const ContactRecord& record = records[index];
    Constraint& c = constraints_[i];
    c.record = index;
    c.a = slot_of[ends[index].a];
    c.b = ends[index].b == kStaticSlot ? kStaticSlot : slot_of[ends[index].b];
    c.count = record.count;
    c.friction = surfaces[index].friction;
    c.restitution = surfaces[index].restitution;
    const MovingBody& a = island[c.a];
    const MovingBody* b = c.b == kStaticSlot ? nullptr : &island[c.b];
    const StaticModel* fixed = surfaces[index].fixed;
    const Mat3 turn_a = turn_since(record.orientation_a, a.rotation);
    const Mat3 turn_b = turn_since(record.orientation_b, b ? b->rotation : fixed->rotation);
    const Vec3 b_minus_a = (b ? b->x : fixed->pose.position) - a.x;
    c.inverse_mass_a = a.inverse_mass;
    c.inverse_mass_b = b ? b->inverse_mass : 0;
    c.normal = vec(record.normal);
    c.tangent[0] = c.normal.unitOrthogonal();
    c.tangent[1] = c.normal.cross(c.tangent[0]);

    const auto make_row = [&](const Vec3& ra, const Vec3& rb, const Vec3& direction, Row& row) {
      row.a_turn = ra.cross(direction);
      row.a_spin = a.inverse_inertia * row.a_turn;
      if (b) {
        row.b_turn = rb.cross(direction);
        row.b_spin = b->inverse_inertia * row.b_turn;
      }
    };
    const auto inverse_mass_of = [&](const Row& l, const Row& r) {
      return l.a_turn.dot(r.a_spin) + (b ? l.b_turn.dot(r.b_spin) : 0.0);
    };
    const double linear = c.inverse_mass_a + c.inverse_mass_b;

    Vec3 ra[kMaxContactPoints], rb[kMaxContactPoints];
    double carried = 0;
    for (std::uint32_t k = 0; k < c.count; ++k) {
      PointConstraint& p = c.points[k];
      // The distance follows the bodies' poses; the arms at which they are pushed stay as they were when detected.
      ra[k] = vec(record.points[k].arm_a);
      rb[k] = vec(record.points[k].arm_b);
      p.separation = c.normal.dot(b_minus_a + turn_b * rb[k] - turn_a * ra[k]);
      make_row(ra[k], rb[k], c.normal, p.row);
      p.mass = inverse_or_zero(linear + inverse_mass_of(p.row, p.row));
      p.impulse = record.points[k].impulse;
      p.most = 0;
      p.approach = c.normal.dot((b ? b->v : Vec3(Vec3::Zero())) - a.v) - p.row.a_turn.dot(a.w) +
                   (b ? p.row.b_turn.dot(b->w) : 0.0);
      carried += p.impulse;
    }

    Vec3 centre_a = Vec3::Zero(), centre_b = Vec3::Zero();
    double weight = 0;
    for (std::uint32_t k = 0; k < c.count; ++k) {
      const double w = carried > 0 ? c.points[k].impulse : c.points[k].separation < kTouching ? 1 : 1e-6;
      centre_a += w * ra[k];
      centre_b += w * rb[k];
      weight += w;
    }
    centre_a /= weight;
    centre_b /= weight;
    for (std::uint32_t k = 0; k < c.count; ++k) {
      const Vec3 arm = ra[k] - centre_a;
      c.points[k].arm = (arm - c.normal.dot(arm) * c.normal).norm();
    }
    const Vec3 friction = vec(record.friction);
    for (int t = 0; t < 2; ++t) {
      make_row(centre_a, centre_b, c.tangent[t], c.slide[t]);
      c.slide_impulse[t] = friction.dot(c.tangent[t]);
    }
    const double k00 = linear + inverse_mass_of(c.slide[0], c.slide[0]);
    const double k11 = linear + inverse_mass_of(c.slide[1], c.slide[1]);
    const double k01 = inverse_mass_of(c.slide[0], c.slide[1]);
    const double inverse_determinant = inverse_or_zero(k00 * k11 - k01 * k01);
    c.k00 = k11 * inverse_determinant;
    c.k11 = k00 * inverse_determinant;
    c.k01 = -k01 * inverse_determinant;

    c.a_twist = a.inverse_inertia * c.normal;
    c.b_twist = b ? Vec3(b->inverse_inertia * c.normal) : Vec3(Vec3::Zero());
    c.twist_mass = inverse_or_zero(c.normal.dot(c.a_twist + c.b_twist));
    c.twist_impulse = record.twist;
  }
}

void IslandSolver::warm_start(std::span<MovingBody> island) {
  for (const Constraint& c : constraints_) {
    MovingBody& a = island[c.a];
    Vec3 impulse = c.slide_impulse[0] * c.tangent[0] + c.slide_impulse[1] * c.tangent[1];
    Vec3 spin_a =
        c.slide_impulse[0] * c.slide[0].a_spin + c.slide_impulse[1] * c.slide[1].a_spin + c.twist_impulse * c.a_twist;
    for (std::uint32_t k = 0; k < c.count; ++k) {
      impulse += c.points[k].impulse * c.normal;
      spin_a += c.points[k].impulse * c.points[k].row.a_spin;
    }
    a.v -= c.inverse_mass_a * impulse;
    a.w -= spin_a;
    if (c.b == kStaticSlot) continue;
    MovingBody& b = island[c.b];
    Vec3 spin_b =
        c.slide_impulse[0] * c.slide[0].b_spin + c.slide_impulse[1] * c.slide[1].b_spin + c.twist_impulse * c.b_twist;
    for (std::uint32_t k = 0; k < c.count; ++k) spin_b += c.points[k].impulse * c.points[k].row.b_spin;
    b.v += c.inverse_mass_b * impulse;
    b.w += spin_b;
  }
}

template <bool kUseBias, bool kStatic>
void IslandSolver::solve_constraint(Constraint& c, MovingBody& body_a, MovingBody* body_b, const Softness& soft) const {
  Vec3 va = body_a.v, wa = body_a.w, vb = Vec3::Zero(), wb = Vec3::Zero();
  Vec3 shift = -body_a.moved;
  if constexpr (!kStatic) {
    vb = body_b->v;
    wb = body_b->w;
    shift += body_b->moved;
  }
  const double along = c.normal.dot(shift);
  const double inverse_h = 1 / constants_.h;

  double total = 0, twist_limit = 0;
  for (std::uint32_t k = 0; k < c.count; ++k) {
    PointConstraint& p = c.points[k];
    // Linear in the bodies' motion since the start of the step.
    double s = p.separation + along - p.row.a_turn.dot(body_a.turned);
    if constexpr (!kStatic) s += p.row.b_turn.dot(body_b->turned);
    double bias = 0, mass_scale = 1, impulse_scale = 0;
    if (s > 0) {
      bias = s * inverse_h;  // not touching yet: may close the gap within the sub-step, no more
    } else if constexpr (kUseBias) {
      bias = std::max(soft.bias_rate * s, -kPushOutSpeed);
      mass_scale = soft.mass_scale;
      impulse_scale = soft.impulse_scale;
    }
    double vn = -p.row.a_turn.dot(wa);
    if constexpr (kStatic) {
      vn -= c.normal.dot(va);
    } else {
      vn += c.normal.dot(vb - va) + p.row.b_turn.dot(wb);
    }
    double impulse = -p.mass * mass_scale * (vn + bias) - impulse_scale * p.impulse;
    const double sum = std::max(p.impulse + impulse, 0.0);
    impulse = sum - p.impulse;
    p.impulse = sum;
    p.most = std::max(p.most, sum);
    total += sum;
    twist_limit += sum * p.arm;
    va -= (c.inverse_mass_a * impulse) * c.normal;
    wa -= impulse * p.row.a_spin;
    if constexpr (!kStatic) {
      vb += (c.inverse_mass_b * impulse) * c.normal;
      wb += impulse * p.row.b_spin;
    }
  }

  // Friction: a vector in the contact plane, projected on the disc of Coulomb's law.
  {
    double v0 = -c.tangent[0].dot(va) - c.slide[0].a_turn.dot(wa);
    double v1 = -c.tangent[1].dot(va) - c.slide[1].a_turn.dot(wa);
    if constexpr (!kStatic) {
      v0 += c.tangent[0].dot(vb) + c.slide[0].b_turn.dot(wb);
      v1 += c.tangent[1].dot(vb) + c.slide[1].b_turn.dot(wb);
    }
    double s0 = c.slide_impulse[0] - (c.k00 * v0 + c.k01 * v1);
    double s1 = c.slide_impulse[1] - (c.k01 * v0 + c.k11 * v1);
    const double limit = c.friction * total, square = s0 * s0 + s1 * s1;
    if (square > limit * limit) {
      const double scale = limit / std::sqrt(square);
      s0 *= scale;
      s1 *= scale;
    }
    const double d0 = s0 - c.slide_impulse[0], d1 = s1 - c.slide_impulse[1];
    c.slide_impulse[0] = s0;
    c.slide_impulse[1] = s1;
    const Vec3 impulse = d0 * c.tangent[0] + d1 * c.tangent[1];
    va -= c.inverse_mass_a * impulse;
    wa -= d0 * c.slide[0].a_spin + d1 * c.slide[1].a_spin;
    if constexpr (!kStatic) {
      vb += c.inverse_mass_b * impulse;
      wb += d0 * c.slide[0].b_spin + d1 * c.slide[1].b_spin;
    }
  }

  if (c.count > 1) {  // turning about the normal; a single point offers no arm
    double spin = -c.normal.dot(wa);
    if constexpr (!kStatic) spin += c.normal.dot(wb);
    const double limit = c.friction * twist_limit;
    const double sum = std::clamp(c.twist_impulse - c.twist_mass * spin, -limit, limit);
    const double d = sum - c.twist_impulse;
    c.twist_impulse = sum;
    wa -= d * c.a_twist;
    if constexpr (!kStatic) wb += d * c.b_twist;
  }

  body_a.v = va;
  body_a.w = wa;
  if constexpr (!kStatic) {
    body_b->v = vb;
    body_b->w = wb;
  }
}

template <bool kUseBias>
void IslandSolver::pass(std::span<MovingBody> island) {
  for (Constraint& c : constraints_) {
    if (c.b == kStaticSlot)
      solve_constraint<kUseBias, true>(c, island[c.a], nullptr, soft_static_);
    else
      solve_constraint<kUseBias, false>(c, island[c.a], &island[c.b], soft_);
  }
}

void IslandSolver::restitution(std::span<MovingBody> island) {
  for (Constraint& c : constraints_) {
    if (c.restitution <= 0) continue;
    MovingBody& a = island[c.a];
    MovingBody* b = c.b == kStaticSlot ? nullptr : &island[c.b];
    for (std::uint32_t k = 0; k < c.count; ++k) {
      PointConstraint& p = c.points[k];
      if (p.approach > -kRestitutionThreshold || p.most == 0) continue;
      const double vn = c.normal.dot((b ? b->v : Vec3(Vec3::Zero())) - a.v) - p.row.a_turn.dot(a.w) +
                        (b ? p.row.b_turn.dot(b->w) : 0.0);
      double impulse = -p.mass * (vn + c.restitution * p.approach);
      const double sum = std::max(p.impulse + impulse, 0.0);
      impulse = sum - p.impulse;
      p.impulse = sum;
      a.v -= (c.inverse_mass_a * impulse) * c.normal;
      a.w -= impulse * p.row.a_spin;
      if (!b) continue;
      b->v += (c.inverse_mass_b * impulse) * c.normal;
      b->w += impulse * p.row.b_spin;
    }
  }
}

void IslandSolver::store(std::span<ContactRecord> records) const {
  for (const Constraint& c : constraints_) {
    ContactRecord& record = records[c.record];
    for (std::uint32_t k = 0; k < c.count; ++k) record.points[k].impulse = c.points[k].impulse;
    const Vec3 friction = c.slide_impulse[0] * c.tangent[0] + c.slide_impulse[1] * c.tangent[1];
    for (int axis = 0; axis < 3; ++axis) record.friction[axis] = friction[axis];
    record.twist = c.twist_impulse;
  }
}

void IslandSolver::solve(std::span<MovingBody> island, std::span<const std::uint32_t> slot_of,
                         std::span<const std::uint32_t> contacts, std::span<const Ends> ends,
                         std::span<const Surface> surfaces, std::span<ContactRecord> records) {
  prepare(island, slot_of, contacts, ends, surfaces, records);
  for (std::uint32_t i = 0; i < constants_.substeps; ++i) {
    for (MovingBody& body : island) accelerate(body, constants_.h, constants_);
    warm_start(island);
    pass<true>(island);
    for (MovingBody& body : island) move(body, constants_.h, constants_);
    pass<false>(island);
  }
  restitution(island);
  store(records);
}

}  // namespace soda::physics
