#include "client/cli/stats_file.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <string_view>

#include "client/cli/status_sum.h"
#include "client/cli/table.h"
#include "common/run_settings.h"
#include "common/scene_hash.h"

namespace soda::cli {
namespace {

// Keys and values of one JSON object, a line each.
class Object {
 public:
  explicit Object(int indent) : indent_(indent) {}

  template <class T>
  void add(std::string_view key, const T& value) {
    raw(key, fmt::format("{}", value));
  }
  void add(std::string_view key, double value) { raw(key, fmt::format("{}", value)); }
  void add(std::string_view key, bool value) { raw(key, value ? "true" : "false"); }
  void text(std::string_view key, std::string_view value) { raw(key, quoted(value)); }
  void raw(std::string_view key, std::string_view json) {
    body_ += fmt::format("{}\n{:{}}{}: {}", body_.empty() ? "" : ",", "", indent_ + 2, quoted(key), json);
  }
  std::string str() const { return fmt::format("{{{}\n{:{}}}}", body_, "", indent_); }

 private:
  static std::string quoted(std::string_view text) {
    std::string out = "\"";
    for (const char c : text) {
      if (c == '"' || c == '\\') out += '\\';
      if (static_cast<unsigned char>(c) < 0x20)
        out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
      else
        out += c;
    }
    return out + '"';
  }

  int indent_;
  std::string body_;
};

// What adds up over the worlds.
void add_counters(Object& object, const wire::Status& s) {
  object.add("bodies", s.bodies());
  object.add("cells", s.cells());
  object.add("steps", s.steps());
  object.add("syncs", s.syncs());
  object.add("mixed_islands", s.mixed_islands());
  object.add("arrived", s.arrived());
  object.add("departed", s.departed());
  object.add("wide_bodies", s.wide_bodies());
  object.add("messages_sent", s.messages_sent());
  object.add("bytes_sent", s.bytes_sent());
  object.add("frames_sent", s.frames_sent());
  object.add("frame_bodies_sent", s.frame_bodies_sent());
  object.add("parts_sent", s.parts_sent());
  object.add("messages_resent", s.messages_resent());
  object.add("duplicates", s.duplicates());
  object.add("refused", s.refused());
  object.add("clamped", s.clamped());
  object.add("non_finite", s.non_finite());
  object.add("actions", s.logged());
  object.add("held_back", s.held_back());
  object.add("anticipated", s.anticipated());
  object.add("bodies_computed", s.bodies_computed());
  object.add("bodies_redone", s.bodies_redone());
  object.add("rollbacks", s.rollbacks());
  object.add("longest_rollback", s.longest_rollback());
  object.add("interruptions", s.interruptions());
  object.add("work_seconds", s.work_seconds());
  object.add("waiting_seconds", s.waiting_seconds());
  object.add("paced_seconds", s.paced_seconds());
  object.add("cpu_seconds", s.cpu_seconds());
  object.add("peak_memory_bytes", s.peak_memory());
  object.add("transfers", s.transfers());
  object.add("cells_given", s.cells_given());
}

std::string world_json(const wire::Status& s) {
  Object object(4);
  object.add("world", s.world());
  object.text("state", state_name(s.state()));
  object.text("host", s.host());
  object.add("pid", s.pid());
  object.add("clock", s.clock());
  object.add("final_step", s.final_step());
  object.add("front", s.front());
  object.add("neighbours", s.neighbours());
  object.add("step_seconds", s.step_seconds());
  if (std::isfinite(s.steps_on_time())) object.add("steps_on_time", s.steps_on_time());  // else for ever
  add_counters(object, s);
  return object.str();
}

}  // namespace

void write_stats(const std::filesystem::path& path, const Collector& collector, bool complete) {
  Object root(0);
  root.add("complete", complete);
  if (collector.session()) {
    const wire::Session& session = *collector.session();
    const Step steps = std::max<Step>(0, collector.whole_steps() - 1);
    const double wall = collector.wall_seconds();
    root.text("scene", session.scene_name());
    root.text("scene_hash", to_hex(session.scene_hash()));
    root.text("sync", sync_name(session.sync()));
    root.add("worlds", session.worlds());
    root.add("last_step", session.last_step());
    root.add("final_step", steps);
    root.add("dt", session.dt());
    root.add("pace", session.pace());
    root.add("bodies", collector.bodies());
    root.add("wall_seconds", wall);
    root.add("steps_per_second", wall > 0 ? static_cast<double>(steps) / wall : 0.0);
    Object total(2);
    add_counters(total, sum_of(collector.worlds()));
    root.raw("total", total.str());
    std::string list;
    for (const wire::Status& s : collector.worlds()) list += (list.empty() ? "\n    " : ",\n    ") + world_json(s);
    root.raw("per_world", "[" + list + "\n  ]");
  }
  std::ofstream file(path);
  file << root.str() << '\n';
  file.close();
  if (!file) throw ReportError(path.string() + ": cannot be written");
}

}  // namespace soda::cli
