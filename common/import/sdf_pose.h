// libsdformat's vectors and poses as ours. Part of the SDF import.
#pragma once

#include <cmath>
#include <ignition/math/Pose3.hh>
#include <ignition/math/Vector3.hh>

#include "common/math.h"

namespace soda {

inline Vec3 vec3_of(const ignition::math::Vector3d& v) { return Vec3(v.X(), v.Y(), v.Z()); }

inline Pose pose_of(const ignition::math::Pose3d& p) {
  Quat q(p.Rot().W(), p.Rot().X(), p.Rot().Y(), p.Rot().Z());
  const double squared = q.squaredNorm();
  // A quaternion of no length, or not a number, is left for the checks to name.
  if (squared > 1e-12 && squared < 1e12 && !(std::abs(squared - 1) <= 1e-12)) q = normalized(q);
  return {vec3_of(p.Pos()), q};
}

inline Pose compose(const Pose& a, const Pose& b) {
  Pose c = a * b;
  const double squared = c.orientation.squaredNorm();
  if (squared > 1e-12 && !(std::abs(squared - 1) <= 1e-12)) c.orientation = normalized(c.orientation);
  return c;
}

inline Pose inverse(const Pose& p) {
  const Quat turn = p.orientation.conjugate();
  return {turn * -p.position, turn};
}

}  // namespace soda
