// One direction in which two bodies are pushed against each other; what impacts and joints are made of.
#pragma once

#include "server/physics/integrator.h"

namespace soda::physics {

// The speed along it is linear . (vb - va) + b_turn . wb - a_turn . wa; a positive impulse moves b along it, a against
// it.
struct Line {
  Vec3 linear;          // direction, or zero of a pure turn
  Vec3 a_turn, b_turn;  // angular Jacobian of each body
  Vec3 a_spin, b_spin;  // inverse inertia times that
};

// `b` is null where it does not move.
inline double speed_along(const Line& line, const MovingBody& a, const MovingBody* b) {
  const double of_a = line.linear.dot(a.v) + line.a_turn.dot(a.w);
  return (b ? line.linear.dot(b->v) + line.b_turn.dot(b->w) : 0.0) - of_a;
}

// Change of the speed along `at` by a unit impulse along `by`; `linear` is the sum of both inverse masses, 1/kg.
inline double response(const Line& at, const Line& by, double linear) {
  return linear * at.linear.dot(by.linear) + at.a_turn.dot(by.a_spin) + at.b_turn.dot(by.b_spin);
}

inline void push_along(const Line& line, double impulse, MovingBody& a, MovingBody* b) {
  a.v -= (a.inverse_mass * impulse) * line.linear;
  a.w -= impulse * line.a_spin;
  if (!b) return;
  b->v += (b->inverse_mass * impulse) * line.linear;
  b->w += impulse * line.b_spin;
}

// How much of an impulse may be applied so that its work is not positive: with impulse s p it is s b + s^2 (w - b).
inline double allowed(double work, double first_order) {
  if (work <= 0) return 1;
  return first_order < 0 ? -first_order / (work - first_order) : 0;
}

}  // namespace soda::physics
