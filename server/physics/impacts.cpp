#include "server/physics/impacts.h"

#include <algorithm>
#include <cmath>

#include "server/physics/lanes.h"
#include "server/physics/line.h"
#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

class Pair {
 public:
  Pair(const Batch& batch, int lane, std::span<MovingBody> bodies)
      : a_(bodies[batch.a[lane]]),
        b_(batch.b[lane] == kNoBody ? nullptr : &bodies[batch.b[lane]]),
        moved_(b_ ? Vec3(b_->moved - a_.moved) : Vec3(-a_.moved)),
        on_a_(batch.moves_on_a[lane]),
        a_v_(a_.v),
        a_w_(a_.w) {
    if (b_) b_v_ = b_->v, b_w_ = b_->w;
  }

  // With both bodies' arms to one place, between theirs.
  Line line(const Row& row, int lane, const Vec3& direction) const {
    Line line{direction, get(row.a_turn, lane), get(row.b_turn, lane), get(row.a_spin, lane), get(row.b_spin, lane)};
    if (!b_) return line;
    const Vec3 shift = moved_.cross(direction);
    line.a_turn += on_a_ * shift;
    line.b_turn -= (1 - on_a_) * shift;
    line.a_spin += on_a_ * (a_.inverse_inertia * shift);
    line.b_spin -= (1 - on_a_) * (b_->inverse_inertia * shift);
    return line;
  }
  // Exactly as it was before anything was pushed.
  void undo() {
    a_.v = a_v_, a_.w = a_w_;
    if (b_) b_->v = b_v_, b_->w = b_w_;
  }
  double separation(const BatchPoint& point, int lane, const Vec3& normal) const {
    return point.separation[lane] + normal.dot(moved_) - get(point.row.a_turn, lane).dot(a_.turned) +
           (b_ ? get(point.row.b_turn, lane).dot(b_->turned) : 0.0);
  }
  double speed(const Line& line) const { return speed_along(line, a_, b_); }  // m/s, apart
  double response(const Line& at, const Line& by) const {
    return physics::response(at, by, a_.inverse_mass + (b_ ? b_->inverse_mass : 0.0));
  }
  void push(const Line& line, double impulse) { push_along(line, impulse, a_, b_); }

 private:
  MovingBody& a_;
  MovingBody* const b_;
  const Vec3 moved_;   // m, of b against a since the start of the step
  const double on_a_;  // see Surface::moves_on_a
  const Vec3 a_v_, a_w_;
  Vec3 b_v_ = Vec3::Zero(), b_w_ = Vec3::Zero();
};

void rub(Pair& pair, const Batch& batch, int lane, double pressed) {
  const Line line[2] = {pair.line(batch.slide[0], lane, get(batch.tangent[0], lane)),
                        pair.line(batch.slide[1], lane, get(batch.tangent[1], lane))};
  const double u[2] = {pair.speed(line[0]), pair.speed(line[1])};
  const double k00 = pair.response(line[0], line[0]), k11 = pair.response(line[1], line[1]);
  const double k01 = pair.response(line[0], line[1]), determinant = k00 * k11 - k01 * k01;
  if (!(determinant > 0)) return;
  // What stops the sliding, or as much of it as Coulomb's law gives: either way it does no positive work.
  double p[2] = {(k01 * u[1] - k11 * u[0]) / determinant, (k01 * u[0] - k00 * u[1]) / determinant};
  const double limit = batch.friction[lane] * pressed, square = p[0] * p[0] + p[1] * p[1];
  const double scale = square > limit * limit ? limit / std::sqrt(square) : 1;
  for (int t = 0; t < 2; ++t) pair.push(line[t], scale * p[t]);
}

// Whether anything struck.
bool strike(const Batch& batch, int lane, std::span<MovingBody> bodies, double h, double gravity) {
  Pair pair(batch, lane, bodies);
  const Vec3 normal = get(batch.normal, lane);
  const double restitution = batch.restitution[lane];
  Line line[kMaxContactPoints];
  double before[kMaxContactPoints], wanted[kMaxContactPoints], mass[kMaxContactPoints];
  double impulse[kMaxContactPoints] = {};
  int count = 0;
  bool strikes = false;
  for (std::uint32_t k = 0; k < batch.count[lane]; ++k) {
    line[count] = pair.line(batch.point[k].row, lane, normal);
    const double u = pair.speed(line[count]);
    const double reach = kImpactReach * (gravity * h - std::min(u, 0.0)) * h;
    if (pair.separation(batch.point[k], lane, normal) > reach) continue;  // will not touch within the sub-step
    strikes = strikes || u < -kRestitutionThreshold;
    before[count] = u;
    wanted[count] = u < 0 ? -restitution * u : 0;
    mass[count] = 1 / pair.response(line[count], line[count]);
    ++count;
  }
  if (!strikes) return false;
  for (int i = 0; i < kImpactIterations; ++i) {
    for (int k = 0; k < count; ++k) {
      const double sum = std::max(impulse[k] - mass[k] * (pair.speed(line[k]) - wanted[k]), 0.0);
      pair.push(line[k], sum - impulse[k]);
      impulse[k] = sum;
    }
  }
  double work = 0, first_order = 0, pressed = 0;
  for (int k = 0; k < count; ++k) {
    work += 0.5 * impulse[k] * (before[k] + pair.speed(line[k]));
    first_order += impulse[k] * before[k];
  }
  const double kept = allowed(work, first_order);
  if (!(kept > 0)) {  // no trace of it, however often it is tried
    pair.undo();
    return false;
  }
  for (int k = 0; k < count; ++k) {
    if (kept < 1) pair.push(line[k], (kept - 1) * impulse[k]);
    pressed += kept * impulse[k];
  }
  if (!(pressed > 0)) {
    pair.undo();
    return false;
  }
  if (batch.friction[lane] > 0) rub(pair, batch, lane, pressed);
  return true;
}

}  // namespace

void strike(std::span<const Batch> batches, std::span<MovingBody> bodies, double h, double gravity) {
  // Each island does as many rounds as it needs, whichever others are solved along with it.
  bool any = true;
  for (int round = 0; any && round < kMostImpactRounds; ++round) {
    any = false;
    for (const Batch& batch : batches) {
      if (!batch.bounces) continue;
      for (int lane = 0; lane < kLanes; ++lane)
        if (batch.restitution[lane] > 0 && strike(batch, lane, bodies, h, gravity)) any = true;
    }
  }
}

}  // namespace soda::physics
