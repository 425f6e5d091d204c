// Eigen's vector types under the names used everywhere in SODA, and the transcendental functions that may reach a
// state.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace soda {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;

struct Pose {
  Vec3 position = Vec3::Zero();         // m
  Quat orientation = Quat::Identity();  // unit quaternion, body frame to parent frame
};

inline Pose operator*(const Pose& a, const Pose& b) {
  return {a.position + a.orientation * b.position, a.orientation * b.orientation};
}

struct Aabb {
  Vec3 min = Vec3::Zero(), max = Vec3::Zero();  // m
  bool overlaps(const Aabb& o) const {
    return min.x() <= o.max.x() && o.min.x() <= max.x() && min.y() <= o.max.y() && o.min.y() <= max.y() &&
           min.z() <= o.max.z() && o.min.z() <= max.z();
  }
};

// Sine and cosine of an angle in radians, made of IEEE additions and multiplications only, so that every x86-64 host
// gives the same bits (glibc's choose a variant by CPU). Absolute error below 1e-15 for |angle| <= 1000 rad.
void sin_cos(double angle, double& sine, double& cosine);

// The angle, in (-pi, pi], of the direction (cosine, sine), which need not be of unit length; 0 of no direction.
// Likewise of IEEE operations only; error below 1e-15.
double angle_of(double sine, double cosine);

// The rotation exp(v): about v by |v| radians.
Quat rotation_of(const Vec3& rotation_vector);

// sqrt of the sum of squares is IEEE; normalises with one division per component. The argument must not be zero.
Quat normalized(const Quat& q);

}  // namespace soda
