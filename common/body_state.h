// What is known of a dynamic body at one step: plain memory, saved and restored by copying, hashed and sent as it is.
#pragma once

#include <cstdint>
#include <type_traits>

#include "common/ids.h"
#include "common/math.h"

namespace soda {

enum BodyFlags : std::uint32_t {
  kAsleep = 1u << 0,
  // Bit 1 + axis: the drive's target velocity is turned round along that axis (see Drive in scene.h).
  kDriveReversed = 1u << 1,
  // Bits 4 to 6: the stiffness of contacts that its island was last solved with (physics/choices.h), 0 where none was
  // chosen.
  kStiffness = 1u << 4,
  kInHeap = 1u << 7,  // so was its island, then
};

struct BodyState {
  BodyId id = 0;
  double position[3] = {0, 0, 0};          // m, centre of mass
  double orientation[4] = {0, 0, 0, 1};    // unit quaternion x, y, z, w: body frame to world
  double linear_velocity[3] = {0, 0, 0};   // m/s, of the centre of mass
  double angular_velocity[3] = {0, 0, 0};  // rad/s, world frame
  std::uint32_t quiet_steps = 0;           // steps in a row below the sleep thresholds
  std::uint32_t flags = 0;                 // BodyFlags

  std::uint32_t stiffness() const { return flags / kStiffness & 7u; }
  void set_stiffness(std::uint32_t level) { flags = (flags & ~(7u * kStiffness)) | level * kStiffness; }
  bool in_heap() const { return (flags & kInHeap) != 0; }
  void set_in_heap(bool in) { flags = (flags & ~std::uint32_t{kInHeap}) | (in ? std::uint32_t{kInHeap} : 0u); }
  bool asleep() const { return (flags & kAsleep) != 0; }
  Vec3 x() const { return Vec3(position[0], position[1], position[2]); }
  Quat q() const { return Quat(orientation[3], orientation[0], orientation[1], orientation[2]); }
  Vec3 v() const { return Vec3(linear_velocity[0], linear_velocity[1], linear_velocity[2]); }
  Vec3 w() const { return Vec3(angular_velocity[0], angular_velocity[1], angular_velocity[2]); }
  void set_x(const Vec3& a) { position[0] = a.x(), position[1] = a.y(), position[2] = a.z(); }
  void set_q(const Quat& a) {
    orientation[0] = a.x(), orientation[1] = a.y(), orientation[2] = a.z(), orientation[3] = a.w();
  }
  void set_v(const Vec3& a) { linear_velocity[0] = a.x(), linear_velocity[1] = a.y(), linear_velocity[2] = a.z(); }
  void set_w(const Vec3& a) { angular_velocity[0] = a.x(), angular_velocity[1] = a.y(), angular_velocity[2] = a.z(); }
};

static_assert(sizeof(BodyState) == 120 && std::is_trivially_copyable_v<BodyState>, "sent and hashed as raw bytes");

}  // namespace soda
