// The parts that generated scenes are put together from. Each adds exactly `count` dynamic bodies, centred on `middle`
// (m, on the ground), and returns how wide the square is that it used, m.
#pragma once

#include <cstdint>

#include "common/scene/random.h"
#include "common/scene/scene_builder.h"

namespace soda::generator {

double add_piles(SceneBuilder& builder, Random& random, std::uint32_t count, const Vec3& middle);
double add_towers(SceneBuilder& builder, std::uint32_t count, const Vec3& middle);
double add_machines(SceneBuilder& builder, Random& random, std::uint32_t count, const Vec3& middle);
double add_dominoes(SceneBuilder& builder, std::uint32_t count, const Vec3& middle);
// `slabs` in stacks and `people` in the streets between them. (count = slabs + people)
double add_city(SceneBuilder& builder, Random& random, std::uint32_t slabs, std::uint32_t people, const Vec3& middle);

// The smallest n with n * n >= count.
std::uint32_t square_side(std::uint32_t count);
std::uint32_t divide_up(std::uint32_t a, std::uint32_t b);
// Colour number n of a small palette.
std::uint32_t colour(std::uint32_t n);
// Wide enough for something that wide, with room to fall over; at least 200 m.
double ground_edge(double width);

}  // namespace soda::generator
