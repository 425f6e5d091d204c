// Soft constraints: a harmonic oscillator of some frequency and damping, integrated implicitly over a sub-step
// (E. Catto, "Solver2D", 2024, and "Soft Constraints", GDC 2011).
#pragma once

#include <numbers>

namespace soda::physics {

struct Softness {
  double bias_rate;      // 1/s: velocity asked for per unit of error
  double mass_scale;     // of the effective mass
  double impulse_scale;  // of the impulse so far, that is given back
};

// `hertz` > 0, `damping` the ratio to critical, `h` the sub-step in s.
inline Softness soften(double hertz, double damping, double h) {
  const double omega = 2 * std::numbers::pi * hertz;
  const double a1 = 2 * damping + h * omega, a2 = h * omega * a1, a3 = 1 / (1 + a2);
  return {omega / a1, a2 * a3, a3};
}

}  // namespace soda::physics
