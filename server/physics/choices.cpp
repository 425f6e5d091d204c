#include "server/physics/choices.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

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

// How far each body is from something that does not give way, in contacts; joints that are solved as a whole count
// nothing. Returns the largest, 0 where nothing rests on anything. Breadth first, what costs nothing at once.
std::uint32_t Chooser::depth_from_ground(const IslandView& island) {
  constexpr std::uint32_t kNone = 0xffffffffu;
  depth_.resize(std::max(depth_.size(), island.states.size()));
  first_.resize(depth_.size());
  next_.resize(std::max(next_.size(), 2 * island.contacts.size()));
  for (const std::uint32_t i : island.bodies) {
    depth_[i] = is_fixed(*island.models[i]) ? 0 : kNotGrounded;
    first_[i] = kNone;
  }
  // Ends of contacts between two bodies, as a list for each body.
  for (std::uint32_t k = 0; k < island.contacts.size(); ++k) {
    const Ends& ends = island.ends[island.contacts[k]];
    if (ends.b == kStaticSlot) {
      depth_[ends.a] = std::min(depth_[ends.a], bears(island.records[island.contacts[k]]) ? 1u : 0u);
    } else {
      next_[2 * k] = std::exchange(first_[ends.a], 2 * k);
      next_[2 * k + 1] = std::exchange(first_[ends.b], 2 * k + 1);
    }
  }
  std::uint32_t deepest = 0;
  level_.clear();
  later_.clear();
  for (const std::uint32_t i : island.bodies)
    if (depth_[i] != kNotGrounded) (depth_[i] == 0 ? level_ : later_).push_back(i);
  for (std::uint32_t depth = 0; !level_.empty() || !later_.empty(); ++depth) {
    for (std::size_t at = 0; at < level_.size(); ++at) {
      const std::uint32_t body = level_[at];
      if (depth_[body] != depth) continue;  // has been reached earlier
      deepest = depth;
      for (std::uint32_t end = first_[body]; end != kNone; end = next_[end]) {
        const std::uint32_t contact = island.contacts[end / 2];
        const std::uint32_t other = end % 2 ? island.ends[contact].a : island.ends[contact].b;
        const bool further = bears(island.records[contact]);
        if (depth_[other] <= depth + (further ? 1 : 0)) continue;
        depth_[other] = depth + (further ? 1 : 0);
        (further ? later_ : level_).push_back(other);
      }
    }
    level_.clear();
    level_.swap(later_);
  }
  return deepest;
}

// Contacts are springs: one of frequency f on which d bodies rest, each r times as heavy as the one that carries them,
// gives by g r d / (2 pi f)^2. That is to be a small share of the body's size; and an island is to be no deeper than
// the square of the sub-steps, for what one pass takes to run through it.
double Chooser::stiffness_wanted(const IslandView& island) {
  const double gravity = constants_.gravity.norm();
  const auto touch = [&](std::uint32_t c) { return bears(island.records[c]); };
  if (!(gravity > 0) || std::none_of(island.contacts.begin(), island.contacts.end(), touch)) return 0;
  deepest_ = depth_from_ground(island);
  const double deepest = deepest_;
  double slenderness = 0;  // largest mass ratio over size, 1/m
  for (const std::uint32_t c : island.contacts) {
    if (!bears(island.records[c])) continue;
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
  const JointModel* const found = model_.find_joint(island.records[record]);
  if (!found) throw std::invalid_argument("step: a record names a joint that is not in the scene");
  const JointModel& joint = *found;
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
  bool was_heap = false;
  deepest_ = 0;
  for (const std::uint32_t i : island.bodies) {
    had = std::max(had, island.states[i].stiffness());
    was_heap = was_heap || island.states[i].in_heap();
  }
  const double wanted = stiffness_wanted(island);
  std::uint32_t stiffness = level_for(wanted);
  if (had > stiffness) stiffness = wanted < kSofterBelow * static_cast<double>(1u << had) ? had - 1 : had;
  // Where many bodies share each level, contacts do well that are stiffer than their sub-steps allow; a stack would
  // begin to sway, and so does what is heavy on what is light, which is why it wants more.
  const double per_level = was_heap ? kStillHeap : kHeap;
  const bool heap = deepest_ > 0 && static_cast<double>(island.bodies.size()) > per_level * deepest_ &&
                    stiffness > kLeastSubstepLevel && stiffness <= kMostHeapStiffness;
  const std::uint32_t least = heap ? stiffness - 1 : stiffness;
  return {1u << std::max(least, level_for(motion_wanted(island))), stiffness, heap};
}

std::uint32_t flight_substeps(const BodyState& state, const BodyModel& model, const StepConstants& constants) {
  if (model.isotropic) return 1;
  if (constants.substeps != 0) return constants.substeps;
  return 1u << level_for(constants.dt * state.w().norm() / kTurnPerSubstep);
}

}  // namespace soda::physics
