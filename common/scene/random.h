// Random numbers that are the same on every machine and with every compiler: integers by xoshiro256++, doubles from
// their bits. (The distributions of the standard library differ between its implementations.)
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "common/math.h"

namespace soda {

// D. Blackman, S. Vigna, "Scrambled linear pseudorandom number generators", 2021. Seeded through splitmix64.
class Random {
 public:
  explicit Random(std::uint64_t seed) {
    for (std::uint64_t& word : state_) {
      seed += 0x9e3779b97f4a7c15u;
      std::uint64_t z = seed;
      z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
      z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
      word = z ^ (z >> 31);
    }
  }

  std::uint64_t bits() {
    const std::uint64_t result = std::rotl(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = std::rotl(state_[3], 45);
    return result;
  }

  // In [0, 1), a multiple of 2^-53.
  double unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

  double between(double low, double high) { return low + (high - low) * unit(); }

  // 0 .. n - 1, for n below 2^32 (the bias is below n / 2^64 of it).
  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>((bits() >> 32) * n >> 32); }

  // Each component on its own, in the order x, y, z (the order of a call's arguments is the compiler's choice).
  Vec3 between(const Vec3& low, const Vec3& high) {
    Vec3 v;
    for (int i = 0; i < 3; ++i) v[i] = between(low[i], high[i]);
    return v;
  }

  Vec3 direction() {  // uniform on the unit sphere, by rejection
    for (;;) {
      const Vec3 v = between(Vec3::Constant(-1), Vec3::Constant(1));
      const double squared = v.x() * v.x() + v.y() * v.y() + v.z() * v.z();
      if (squared > 0.01 && squared <= 1) return v / std::sqrt(squared);
    }
  }

  Quat orientation() {  // uniform over all rotations, by rejection in four dimensions
    for (;;) {
      std::array<double, 4> q;
      double squared = 0;
      for (double& c : q) c = between(-1, 1), squared += c * c;
      if (squared > 0.01 && squared <= 1) return normalized(Quat(q[0], q[1], q[2], q[3]));
    }
  }

 private:
  std::array<std::uint64_t, 4> state_;
};

}  // namespace soda
