// Where shapes are.
#pragma once

#include <optional>

#include "common/scene/scene.h"

namespace soda {

// Exact axis-aligned bounds, m. Planes have none.
std::optional<Aabb> extent_of(const Geometry& geometry, const Pose& pose);

// Of all shapes of a body where the scene has put it; of nothing but planes: none.
std::optional<Aabb> extent_of(const Scene& scene, const Body& body);

// The smallest box that holds both.
Aabb merged(const Aabb& a, const Aabb& b);

}  // namespace soda
