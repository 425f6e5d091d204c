#include "common/math.h"

#include <cmath>
#include <numbers>

namespace soda {
namespace {

// Taylor polynomials on |x| <= pi/4: the first term left out is below 3e-18 (sine) and 5e-17 (cosine).
double sine_polynomial(double x) {
  const double z = x * x;
  double p = -1.0 / 1307674368000.0;  // -1/15!
  p = p * z + 1.0 / 6227020800.0;
  p = p * z - 1.0 / 39916800.0;
  p = p * z + 1.0 / 362880.0;
  p = p * z - 1.0 / 5040.0;
  p = p * z + 1.0 / 120.0;
  p = p * z - 1.0 / 6.0;
  return x + x * z * p;
}

double cosine_polynomial(double x) {
  const double z = x * x;
  double p = 1.0 / 20922789888000.0;  // 1/16!
  p = p * z - 1.0 / 87178291200.0;
  p = p * z + 1.0 / 479001600.0;
  p = p * z - 1.0 / 3628800.0;
  p = p * z + 1.0 / 40320.0;
  p = p * z - 1.0 / 720.0;
  p = p * z + 1.0 / 24.0;
  p = p * z - 0.5;
  return 1.0 + z * p;
}

}  // namespace

void sin_cos(double angle, double& sine, double& cosine) {
  // Reduction to |x| <= pi/4 by multiples of pi/2, subtracted in two parts (Cody and Waite): the high part has 33
  // significant bits, so that its product with a quadrant number below 2^20 is exact.
  constexpr double kPiOver2High = 0x1.921fb544p+0, kPiOver2Low = 0x1.0b4611a626331p-34;
  constexpr double kTwoOverPi = 0.63661977236758134308;
  const double turns = angle * kTwoOverPi;
  const double quadrant = std::floor(turns + 0.5);
  const double x = (angle - quadrant * kPiOver2High) - quadrant * kPiOver2Low;
  const double s = sine_polynomial(x), c = cosine_polynomial(x);
  // quadrant modulo 4 without converting a possibly huge value to an integer
  const int q = static_cast<int>(quadrant - 4.0 * std::floor(quadrant * 0.25));
  sine = q == 0 ? s : q == 1 ? c : q == 2 ? -s : -c;
  cosine = q == 0 ? c : q == 1 ? -s : q == 2 ? -c : s;
}

double angle_of(double sine, double cosine) {
  constexpr double kPi = std::numbers::pi, kTanOfPiOver8 = 0.41421356237309503;
  const double x = std::abs(cosine), y = std::abs(sine);
  const double larger = x > y ? x : y, smaller = x > y ? y : x;
  if (!(larger > 0)) return 0;
  double t = smaller / larger, angle = 0;
  if (t > kTanOfPiOver8) angle = kPi / 4, t = (t - 1) / (t + 1);
  // atan t = t - t^3/3 + ...; the first term left out is below 1e-17 for |t| <= tan(pi/8).
  double p = 0;
  for (int k = 20; k >= 0; --k) p = p * (t * t) + (k % 2 ? -1.0 : 1.0) / (2 * k + 1);
  angle += t * p;
  if (y > x) angle = kPi / 2 - angle;
  if (cosine < 0) angle = kPi - angle;
  return sine < 0 ? -angle : angle;
}

Quat rotation_of(const Vec3& rotation_vector) {
  const double square = rotation_vector.squaredNorm();
  double scale, w;  // exp(v) = (w, scale * v)
  if (square < 1e-4) {
    // Series of sin(a/2)/a and cos(a/2) in a^2; what is left out is below 1e-19.
    scale = 0.5 - square * (1.0 / 48.0 - square * (1.0 / 3840.0 - square * (1.0 / 645120.0)));
    w = 1.0 - square * (1.0 / 8.0 - square * (1.0 / 384.0 - square * (1.0 / 46080.0)));
  } else {
    const double angle = std::sqrt(square);
    double s, c;
    sin_cos(0.5 * angle, s, c);
    scale = s / angle;
    w = c;
  }
  return Quat(w, scale * rotation_vector.x(), scale * rotation_vector.y(), scale * rotation_vector.z());
}

Quat normalized(const Quat& q) {
  const double length = std::sqrt(q.x() * q.x() + q.y() * q.y() + q.z() * q.z() + q.w() * q.w());
  return Quat(q.w() / length, q.x() / length, q.y() / length, q.z() / length);
}

}  // namespace soda
