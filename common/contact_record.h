// The memory of a contact between two steps: where it was last detected and the impulses that it carried.
// Plain memory, part of the state. A record without points does not exist. Joints have records, too: what they carried.
#pragma once

#include <cstdint>
#include <type_traits>

#include "common/ids.h"

namespace soda {

constexpr int kMaxContactPoints = 4;  // per record

// Arms, normal and friction are in world axes. They stay frozen while the record is kept, even as the bodies turn a
// little: that is what keeps tall stacks from bending like a column of soft springs (docs/physics.md).
struct ContactPoint {
  double arm_a[3];  // m, from a's centre of mass to its surface, when detected
  double arm_b[3];  // m, from b's centre of mass (static: origin) to its surface, when detected
  double impulse;   // N s, along the normal, at the rate of the last sub-step solved: what it gives in a whole step
};

struct ContactRecord {
  BodyId a = 0;             // the dynamic body that the record belongs to: of two dynamic bodies the lower id
  BodyId b = 0;             // a dynamic body's id (higher than a), or kStaticBit | id of a static body
  std::uint32_t part = 0;   // which pair of child shapes and which face group: distinguishes the records of one pair
  std::uint32_t count = 0;  // points in use, 1 .. kMaxContactPoints
  double normal[3] = {0, 0, 0};            // unit, from a to b
  double offset[3] = {0, 0, 0};            // m, from a's centre of mass to b's, when the points were detected
  double orientation_a[4] = {0, 0, 0, 1};  // of a, when detected: x, y, z, w
  double orientation_b[4] = {0, 0, 0, 1};
  double friction[3] = {0, 0, 0};               // N s, friction impulse on b, likewise
  double twist = 0;                             // N m s, friction about the normal
  ContactPoint points[kMaxContactPoints] = {};  // the first `count` are in use, the others all zero

  bool with_static() const { return (b & kStaticBit) != 0; }
};

// ---- records of joints: `part` is this and the joint's number among those of the two bodies. One point holds
// impulses, at the rate of the last sub-step: arm_a the linear one on b, N s, arm_b the angular one, N m s, both in
// world axes; `impulse`, `friction` and `twist` those of limits, motor and spring. Without normal and anchors.
constexpr std::uint32_t kJointPart = 0xffffff00u;
inline bool is_joint(const ContactRecord& record) { return record.part >= kJointPart; }

static_assert(std::is_trivially_copyable_v<ContactRecord>, "sent and hashed as raw bytes");
static_assert(sizeof(ContactRecord) == 392, "no padding: all bytes are meaningful");

// The canonical order of records: by owner, then partner, then part.
inline bool record_before(const ContactRecord& l, const ContactRecord& r) {
  if (l.a != r.a) return l.a < r.a;
  if (l.b != r.b) return l.b < r.b;
  return l.part < r.part;
}

}  // namespace soda
