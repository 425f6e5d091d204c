// Piles, towers and rows of dominoes.
#include <algorithm>

#include "common/scene/generator_parts.h"

namespace soda::generator {

// Heaps of 27, the last one with the rest, on a square lattice. 3 x 3 x 3 boxes, turned at random, so far apart that
// none touch (the pitch exceeds the diagonal of .866 m), fall from a hand's height.
double add_piles(SceneBuilder& builder, Random& random, std::uint32_t count, const Vec3& middle) {
  constexpr std::uint32_t kPile = 27;
  constexpr double kBox = 0.5, kPitch = 0.9, kApart = 10;  // m
  const std::uint32_t side = square_side(divide_up(count, kPile));
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t pile = i / kPile, n = i % kPile;
    Vec3 at = middle;
    at += kApart * Vec3(pile % side - 0.5 * (side - 1), pile / side - 0.5 * (side - 1), 0);
    at += kPitch * Vec3(n % 3 - 1.0, n / 3 % 3 - 1.0, n / 9) + Vec3(0, 0, 0.55);
    at += random.between(Vec3::Constant(-0.01), Vec3::Constant(0.01));
    const Quat orientation = random.orientation();
    builder.add(Box{Vec3(kBox, kBox, kBox)}, at, orientation).colour = colour(pile);
  }
  return kApart * side;
}

// Ten boxes each, exactly on top of each other, the last tower with the rest.
double add_towers(SceneBuilder& builder, std::uint32_t count, const Vec3& middle) {
  constexpr std::uint32_t kTower = 10;
  constexpr double kApart = 3;  // m
  const std::uint32_t side = square_side(divide_up(count, kTower));
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t tower = i / kTower;
    Vec3 at = middle + kApart * Vec3(tower % side - 0.5 * (side - 1), tower / side - 0.5 * (side - 1), 0);
    at.z() += i % kTower + 0.5;
    builder.add(Box{Vec3(1, 1, 1)}, at).colour = colour(i);
  }
  return kApart * side;
}

// Rows along x, of up to 200, 1 m apart. The first of each row turns about its lower edge at 2.5 rad/s, towards the
// next.
double add_dominoes(SceneBuilder& builder, std::uint32_t count, const Vec3& middle) {
  constexpr std::uint32_t kRow = 200;
  constexpr double kSpacing = 0.25, kApart = 1, kPush = 2.5;  // m, m, rad/s
  const Vec3 size(0.05, 0.25, 0.5);
  const std::uint32_t rows = divide_up(count, kRow), longest = std::min(count, kRow);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t row = i / kRow, n = i % kRow;
    const Vec3 at =
        middle + Vec3((n - 0.5 * (longest - 1)) * kSpacing, (row - 0.5 * (rows - 1)) * kApart, 0.5 * size.z());
    Body& domino = builder.add(Box{size}, at, Quat::Identity(), 600);  // kg/m^3, wood
    domino.friction = 0.25;
    domino.colour = colour(n / 10);
    if (n != 0) continue;
    domino.angular_velocity = Vec3(0, kPush, 0);
    domino.linear_velocity = Vec3(kPush * 0.5 * size.z(), 0, kPush * 0.5 * size.x());  // omega x (centre - lower edge)
  }
  return std::max(longest * kSpacing, rows * kApart);
}

}  // namespace soda::generator
