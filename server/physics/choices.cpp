#include "server/physics/choices.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

constexpr std::uint32_t kNotGrounded = std::numeric_limits<std::uint32_t>::max();

// The smallest k with 2^k >= x, within what is allowed.
std::uint32_t level_for(double x) {
  std::uint32_t k = kLeastSubstepLevel;
  while (k < kMostSubstepLevel && x > static_cast<double>(1u << k)) ++k;
  return k;
}

bool is_fixed(const BodyModel& body) { return body.inverse_mass == 0; }

}  // namespace

// How far each body is from something that does not give way, in contacts; joints are solved as a whole and count
// nothing. Returns the largest, 0 where nothing rests on anything.
std::uint32_t Chooser::depth_from_ground(const IslandView& island) {
  depth_.resize(std::max(depth_.size(), island.states.size()));
  for (const std::uint32_t i : island.bodies) depth_[i] = is_fixed(*island.models[i]) ? 0 : kNotGrounded;
  for (const std::uint32_t c : island.contacts)
    if (island.ends[c].b == kStaticSlot && depth_[island.ends[c].a] > 0)
      depth_[island.ends[c].a] = is_joint(island.records[c]) ? 0 : 1;
  // Relaxation in both directions until nothing changes: few rounds, since contacts come in spatial order of a sort.
  bool changed = true;
  const auto relax = [&](std::uint32_t c) {
    if (island.ends[c].b == kStaticSlot) return;
    std::uint32_t &a = depth_[island.ends[c].a], &b = depth_[island.ends[c].b];
    const std::uint32_t nearer = std::min(a, b), farther = std::max(a, b);
    if (nearer == kNotGrounded) return;
    const std::uint32_t reached = nearer + (is_joint(island.records[c]) ? 0 : 1);
    if (reached >= farther) return;
    (a > b ? a : b) = reached;
    changed = true;
  };
  while (changed) {
    changed = false;
    for (const std::uint32_t c : island.contacts) relax(c);
    if (!changed) break;
    for (auto c = island.contacts.rbegin(); c != island.contacts.rend(); ++c) relax(*c);
  }
  std::uint32_t deepest = 0;
  for (const std::uint32_t i : island.bodies)
    if (depth_[i] != kNotGrounded) deepest = std::max(deepest, depth_[i]);
  return deepest;
}

// Contacts are springs: one of frequency f on which d bodies rest, each r times as heavy as the one that carries them,
// gives by g r d / (2 pi f)^2. That is to be a small share of the body's size; and an island is to be no deeper than
// the square of the sub-steps, for what one pass takes to run through it.
double Chooser::stiffness_wanted(const IslandView& island) {
  const double gravity = constants_.gravity.norm();
  if (!(gravity > 0)) return 0;
  const double deepest = depth_from_ground(island);
  double slenderness = 0;  // largest mass ratio over size, 1/m
  for (const std::uint32_t c : island.contacts) {
    if (is_joint(island.records[c])) continue;
    const std::uint32_t a = island.ends[c].a, b = island.ends[c].b;
    if (b == kStaticSlot || is_fixed(*island.models[a]) || is_fixed(*island.models[b])) {
      const BodyModel& moving = *island.models[b != kStaticSlot && is_fixed(*island.models[a]) ? b : a];
      slenderness = std::max(slenderness, moving.inverse_inner_extent);
      continue;
    }
    const bool a_carries = depth_[a] < depth_[b];
    const BodyModel& carrier = *island.models[a_carries ? a : b];
    const BodyModel& carried = *island.models[a_carries ? b : a];
    // Side by side, neither carries the other.
    const double ratio = depth_[a] == depth_[b] ? 1 : std::max(1.0, carried.mass * carrier.inverse_mass);
    slenderness = std::max(slenderness, ratio * carrier.inverse_inner_extent);
  }
  // f = kContactHertzPerSubstepRate n / dt.
  const double frequency = std::sqrt(gravity * deepest * slenderness / kSagShare) * (0.5 / std::numbers::pi);
  const double depth_rate = kDepthRate * std::sqrt(deepest);
  return constants_.dt * std::max(frequency / kContactHertzPerSubstepRate, depth_rate);
}

// What hangs on a joint goes round it: at speed v and distance r, it is off its circle by a sagitta of (v h)^2 / 8 r in
// a sub-step.
double Chooser::swing_wanted(const IslandView& island, std::uint32_t record) const {
  const JointModel& joint = *model_.find_joint(island.records[record]);
  const Ends& ends = island.ends[record];
  const BodyState* const b = ends.b == kStaticSlot ? nullptr : &island.states[ends.b];
  const BodyState& a = island.states[ends.a];
  double square = 0;  // of the speed, over r
  const auto swing = [&](const Vec3& v, double r) {
    if (r > 0) square = std::max(square, v.squaredNorm() / r);
  };
  bool hangs = joint.joint->kind == JointKind::kDistance;
  if (hangs) {
    swing(b ? Vec3(a.v() - b->v()) : a.v(), joint.joint->limits->upper);
  } else {
    const auto end = [&](const BodyState& state, const Vec3& place) {
      const Vec3 arm = state.q() * place;
      swing(state.w().cross(arm), arm.norm());
      hangs = hangs || !place.isZero(0);
    };
    end(a, joint.at_a.position);
    if (b) end(*b, joint.at_b.position);
  }
  // A pendulum gets what it needs at its fastest all the way, v^2 = 4 g r: if that changed with its speed, it would be
  // pumped.
  if (hangs) square = std::max(square, 4 * constants_.gravity.norm());
  return constants_.dt * std::sqrt(square / (8 * kSagitta));
}

double Chooser::motion_wanted(const IslandView& island) const {
  double wanted = 0;
  for (const std::uint32_t i : island.bodies) {
    const BodyModel& body = *island.models[i];
    if (is_fixed(body)) continue;
    const double turn = constants_.dt * island.states[i].w().norm();
    if (!body.is_ball) wanted = std::max(wanted, turn / kTurnPerSubstep);
  }
  double travel = 0;
  for (const std::uint32_t c : island.contacts) {
    if (is_joint(island.records[c])) {
      wanted = std::max(wanted, swing_wanted(island, c));
      continue;
    }
    const std::uint32_t a = island.ends[c].a, b = island.ends[c].b;
    Vec3 v = island.states[a].v();
    double inverse_extent = island.models[a]->inverse_inner_extent;
    if (b != kStaticSlot) {
      v -= island.states[b].v();
      inverse_extent = std::max(inverse_extent, island.models[b]->inverse_inner_extent);
    }
    travel = std::max(travel, v.squaredNorm() * (inverse_extent * inverse_extent));
  }
  // What is fast is stopped by contacts made ahead of it, so that more would buy little.
  return std::max(wanted, std::min(constants_.dt * std::sqrt(travel), kMostSubstepsForTravel));
}

Choice Chooser::choose(const IslandView& island) {
  if (constants_.substeps != 0) return {constants_.substeps, 0};
  std::uint32_t had = 0;
  for (const std::uint32_t i : island.bodies) had = std::max(had, island.states[i].stiffness());
  const double wanted = stiffness_wanted(island);
  std::uint32_t stiffness = level_for(wanted);
  if (had > stiffness) stiffness = wanted < kSofterBelow * static_cast<double>(1u << had) ? had - 1 : had;
  return {1u << std::max(stiffness, level_for(motion_wanted(island))), stiffness};
}

std::uint32_t flight_substeps(const BodyState& state, const BodyModel& model, const StepConstants& constants) {
  if (model.isotropic) return 1;
  if (constants.substeps != 0) return constants.substeps;
  return 1u << level_for(constants.dt * state.w().norm() / kTurnPerSubstep);
}

}  // namespace soda::physics
