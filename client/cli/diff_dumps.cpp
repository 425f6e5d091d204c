// Comparing whole states: names the first step, body and field that differ, in hexadecimal floats, which hide no bit.
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/diff_command.h"
#include "common/dump.h"
#include "common/scene_hash.h"

namespace soda::cli {
namespace {

std::string show(double value) {
  char text[64];
  std::snprintf(text, sizeof text, "%a (%.17g)", value, value);
  return text;
}
std::string show(std::uint32_t value) { return std::to_string(value); }

// The first field of two things that differs.
class Fields {
 public:
  bool found() const { return !field_.empty(); }
  std::string text() const { return field_ + ": " + a_ + " and " + b_; }

  template <class T>
  void look(const std::string& field, const T& a, const T& b) {
    if (found() || std::memcmp(&a, &b, sizeof(T)) == 0) return;  // bits, not values: -0 differs from 0
    field_ = field;
    a_ = show(a);
    b_ = show(b);
  }
  template <std::size_t N>
  void look(const std::string& field, const double (&a)[N], const double (&b)[N]) {
    static const char* const axes = "xyzw";
    for (std::size_t i = 0; i < N; ++i) look(field + "." + axes[i], a[i], b[i]);
  }

 private:
  std::string field_, a_, b_;
};

std::string difference(const BodyState& a, const BodyState& b) {
  Fields fields;
  fields.look("position", a.position, b.position);
  fields.look("orientation", a.orientation, b.orientation);
  fields.look("linear_velocity", a.linear_velocity, b.linear_velocity);
  fields.look("angular_velocity", a.angular_velocity, b.angular_velocity);
  fields.look("quiet_steps", a.quiet_steps, b.quiet_steps);
  fields.look("flags", a.flags, b.flags);
  return fields.found() ? fields.text() : "";
}

std::string difference(const ContactRecord& a, const ContactRecord& b) {
  Fields fields;
  fields.look("count", a.count, b.count);
  fields.look("normal", a.normal, b.normal);
  fields.look("offset", a.offset, b.offset);
  fields.look("orientation_a", a.orientation_a, b.orientation_a);
  fields.look("orientation_b", a.orientation_b, b.orientation_b);
  fields.look("friction", a.friction, b.friction);
  fields.look("twist", a.twist, b.twist);
  for (int i = 0; i < kMaxContactPoints; ++i) {
    const std::string point = "points[" + std::to_string(i) + "].";
    fields.look(point + "arm_a", a.points[i].arm_a, b.points[i].arm_a);
    fields.look(point + "arm_b", a.points[i].arm_b, b.points[i].arm_b);
    fields.look(point + "impulse", a.points[i].impulse, b.points[i].impulse);
  }
  return fields.found() ? fields.text() : "";
}

std::string name_of(const BodyState& body) { return "body " + std::to_string(body.id); }

std::string name_of(const ContactRecord& record) {
  std::string name = "contact of body " + std::to_string(record.a) + " with ";
  name += record.with_static() ? "static body " + std::to_string(record.b & ~kStaticBit)
                               : "body " + std::to_string(record.b);
  return record.part == 0 ? name : name + ", part " + std::to_string(record.part);
}

bool before(const BodyState& a, const BodyState& b) { return a.id < b.id; }
bool before(const ContactRecord& a, const ContactRecord& b) { return record_before(a, b); }

// The first difference of two lists in order, or "".
template <class T>
std::string difference(const std::vector<T>& a, const std::vector<T>& b) {
  for (std::size_t i = 0; i < a.size() || i < b.size(); ++i) {
    if (i == b.size() || (i < a.size() && before(a[i], b[i]))) return name_of(a[i]) + " is only in the first";
    if (i == a.size() || before(b[i], a[i])) return name_of(b[i]) + " is only in the second";
    const std::string field = difference(a[i], b[i]);
    if (!field.empty()) return name_of(a[i]) + ": " + field;
  }
  return "";
}

std::string difference(const BodySet& a, const BodySet& b) {
  const std::string bodies = difference(a.bodies, b.bodies);
  return bodies.empty() ? difference(a.contacts, b.contacts) : bodies;
}

// The next state of `reader` at or after that step.
std::optional<DumpStep> next_from(DumpReader& reader, Step step) {
  for (;;) {
    auto state = reader.next();
    if (!state || state->step >= step) return state;
  }
}

}  // namespace

bool equal_dumps(const std::filesystem::path& a, const std::filesystem::path& b) {
  DumpReader reader_a(a), reader_b(b);
  if (reader_a.header().scene_hash != reader_b.header().scene_hash) {
    std::printf("the scenes differ: %s and %s\n", to_hex(reader_a.header().scene_hash).c_str(),
                to_hex(reader_b.header().scene_hash).c_str());
    return false;
  }
  Step step = std::max(reader_a.header().first, reader_b.header().first);
  const Step last = std::min(reader_a.header().last, reader_b.header().last);
  Step compared = 0;
  for (; step <= last; ++step, ++compared) {
    const auto in_a = next_from(reader_a, step), in_b = next_from(reader_b, step);
    if (!in_a || !in_b) throw DiffError((!in_a ? a : b).string() + ": ends before step " + std::to_string(step));
    if (in_a->step != step || in_b->step != step)
      throw DiffError("step " + std::to_string(step) + " is missing in " + (in_a->step != step ? a : b).string());
    const std::string found = difference(in_a->state, in_b->state);
    if (found.empty()) continue;
    std::printf("step %" PRId64 " is the first to differ: %s\n", step, found.c_str());
    return false;
  }
  if (compared == 0) throw DiffError("the dumps have no step in common");
  std::printf("equal: %" PRId64 " steps\n", compared);
  return true;
}

}  // namespace soda::cli
