// From the records of a pair at the last step to its records now: kept where the pair has hardly moved (recycled), else
// detected anew with impulses handed over to points found in the same place.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/contact_record.h"
#include "server/physics/detector.h"
#include "server/physics/shape_store.h"

namespace soda::physics {

// A body as a party to a contact.
struct Party {
  BodyId key;     // id, or kStaticBit | id
  Vec3 position;  // m, centre of mass (static: origin)
  Quat orientation;
  Mat3 rotation;  // of orientation
  std::span<const Child> children;
  double inner_extent;  // m, smallest half extent of its children
  double radius;        // m, about the centre of mass; 0 of a static body, which does not turn
};

struct ContactCounters {
  std::uint64_t detected = 0, recycled = 0;  // child pairs
};

class ContactUpdater {
 public:
  // Appends the records of pair (a, b) at the poses given; none where they are further apart than `max_distance`.
  // `previous` are the pair's records at the last step, in canonical order.
  void update(const Party& a, const Party& b, std::span<const ContactRecord> previous, double max_distance,
              std::vector<ContactRecord>& out);
  ContactCounters counters;

 private:
  void detect(const Party& a, std::uint32_t child_a, const Party& b, std::uint32_t child_b,
              std::span<const ContactRecord> previous, double max_distance, std::vector<ContactRecord>& out);
  Detector detector_;
  std::vector<DetectedPoint> points_, group_;
};

// Which children a record is about: ContactRecord::part without the face group.
constexpr std::uint32_t child_pair(std::uint32_t child_a, std::uint32_t child_b) {
  return child_a << 20 | child_b << 8;
}

}  // namespace soda::physics
