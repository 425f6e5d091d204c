#include "client/cli/table.h"

#include <spdlog/fmt/fmt.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iterator>

#include "common/dds/topics.h"
#include "common/scene_hash.h"

namespace soda::cli {
namespace {

using namespace std::chrono_literals;

constexpr auto kDrawEvery = 200ms;
constexpr auto kLineEvery = 5s;
constexpr auto kSpeedOver = 1s;

struct TerminalSize {
  std::size_t rows = 24, columns = 80;
};
TerminalSize terminal_size() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_row == 0 || size.ws_col == 0) return {};
  return {size.ws_row, size.ws_col};
}

double real_seconds(const Collector& collector, Table::Clock::time_point now) {
  return collector.began() ? std::chrono::duration<double>(now - *collector.began()).count() : 0;
}

// "step 120/600, 2.00 s simulated in 2.10 s"
std::string progress(const Collector& collector, Table::Clock::time_point now) {
  const wire::Session& session = *collector.session();
  const Step final_step = std::max<Step>(0, collector.whole_steps() - 1);
  return fmt::format("step {}/{}, {:.2f} s simulated in {:.2f} s", final_step, session.last_step(),
                     static_cast<double>(final_step) * session.dt(), real_seconds(collector, now));
}

}  // namespace

const char* state_name(std::uint8_t state) {
  switch (state) {
    case wire::STATE_READY:
      return "ready";
    case wire::STATE_RUNNING:
      return "running";
    case wire::STATE_DONE:
      return "done";
    default:
      return "preparing";
  }
}

Table::Table(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

double Table::Speed::at(Clock::time_point now, Step final_now) {
  if (then == Clock::time_point{} || final_now < final_step) {
    then = now;
    final_step = final_now;
  } else if (now - then >= kSpeedOver) {
    steps_per_second = static_cast<double>(final_now - final_step) / std::chrono::duration<double>(now - then).count();
    then = now;
    final_step = final_now;
  }
  // In the first second: what there is.
  const double passed = std::chrono::duration<double>(now - then).count();
  if (steps_per_second == 0 && passed > 0.1) return static_cast<double>(final_now - final_step) / passed;
  return steps_per_second;
}

void Table::update(const Collector& collector) {
  const auto now = Clock::now();
  if (quiet_ || !collector.session()) return;
  const double speed = total_.at(now, collector.whole_steps());  // always, so that the first line can tell it
  if (now < next_) return;
  next_ = now + (terminal_ ? Clock::duration(kDrawEvery) : Clock::duration(kLineEvery));
  speeds_.resize(collector.worlds().size());
  if (terminal_)
    draw(collector, now, speed);
  else if (collector.began())
    print_line(collector, now, speed);
}

void Table::draw(const Collector& collector, Clock::time_point now, double total_speed) {
  std::vector<std::string> lines;
  const TerminalSize terminal = terminal_size();
  lines.push_back(fmt::format("{:>5} {:<12} {:>8} {:>8} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}", "world", "state", "cells",
                              "bodies", "clock", "final", "steps/s", "waiting", "syncs", "repairs"));
  const std::size_t room = std::max<std::size_t>(4, terminal.rows) - 3;
  const auto& worlds = collector.worlds();
  for (std::size_t i = 0; i < worlds.size(); ++i) {
    const wire::Status& s = worlds[i];
    const double speed = speeds_[i].at(now, s.final_step());
    if (lines.size() >= room && i + 1 < worlds.size()) continue;
    const auto heard = collector.heard(s.world());
    const char* state = !heard ? "not here yet" : now - *heard > dds::kSilence ? "silent" : state_name(s.state());
    lines.push_back(fmt::format("{:>5} {:<12} {:>8} {:>8} {:>9} {:>9} {:>9.0f} {:>8.2f}s {:>9} {:>9}", s.world(), state,
                                s.cells(), s.bodies(), s.clock(), s.final_step(), speed, s.waiting_seconds(), s.syncs(),
                                s.rollbacks()));
  }
  if (lines.size() < worlds.size() + 1) lines.insert(lines.end() - 1, fmt::format("{:>5}", "..."));
  lines.push_back(fmt::format("{} bodies, {}, {:.0f} steps/s, {:.2f} x real time", collector.bodies(),
                              progress(collector, now), total_speed, total_speed * collector.session()->dt()));
  std::string out;
  if (drawn_ > 0) out += fmt::format("\x1b[{}A", drawn_);
  // A line that wraps would be two, of which the next drawing knows nothing.
  for (const std::string& line : lines) out += "\x1b[2K" + line.substr(0, terminal.columns - 1) + "\n";
  for (int extra = static_cast<int>(lines.size()); extra < drawn_; ++extra) out += "\x1b[2K\n";
  drawn_ = std::max(drawn_, static_cast<int>(lines.size()));
  std::fputs(out.c_str(), stderr);
}

void Table::print_line(const Collector& collector, Clock::time_point now, double speed) {
  std::string line = fmt::format("{}, {} bodies in {} worlds, {:.0f} steps/s", progress(collector, now),
                                 collector.bodies(), collector.worlds().size(), speed);
  for (const wire::Status& s : collector.worlds())
    if (const auto heard = collector.heard(s.world()); heard && now - *heard > dds::kSilence)
      line += fmt::format(", world {} is silent", s.world());
  std::fprintf(stderr, "%s\n", line.c_str());
}

void Table::say(const std::string& line) {
  clear();
  std::fprintf(stderr, "%s\n", line.c_str());
  next_ = {};
}

void Table::clear() {
  if (drawn_ > 0) std::fprintf(stderr, "\x1b[%dA\x1b[J", drawn_);
  drawn_ = 0;
}

void print_summary(const Collector& collector, bool complete) {
  if (!collector.session()) return;
  const wire::Session& session = *collector.session();
  const Step steps = std::max<Step>(0, collector.whole_steps() - 1);
  const double wall = collector.wall_seconds();
  const double simulated = static_cast<double>(steps) * session.dt();
  std::uint64_t syncs = 0, mixed = 0, arrived = 0, bytes = 0, interruptions = 0, clamped = 0, held = 0;
  std::uint64_t anticipated = 0, rollbacks = 0, computed = 0, redone = 0;
  double waiting = 0, cpu = 0;
  for (const wire::Status& s : collector.worlds()) {
    syncs += s.syncs(), mixed += s.mixed_islands(), arrived += s.arrived(), bytes += s.bytes_sent();
    interruptions += s.interruptions(), clamped += s.clamped(), held += s.non_finite();
    anticipated += s.anticipated(), rollbacks += s.rollbacks();
    computed += s.bodies_computed(), redone += s.bodies_redone();
    waiting += s.waiting_seconds(), cpu += s.cpu_seconds();
  }
  std::string text = fmt::format("{}: {} bodies, {} steps on {} {}: {:.2f} s simulated in {:.2f} s",
                                 session.scene_name().empty() ? to_hex(session.scene_hash()) : session.scene_name(),
                                 collector.bodies(), steps, session.worlds(),
                                 session.worlds() == 1 ? "world" : "worlds", simulated, wall);
  if (wall > 0)
    text += fmt::format(" ({:.2f} x real time, {:.0f} steps/s)", simulated / wall, static_cast<double>(steps) / wall);
  if (!complete) text += fmt::format("\nended before step {}", session.last_step());
  text += fmt::format("\n{:.1f} s of CPU time", cpu);
  if (session.worlds() > 1)
    text += fmt::format(
        ", {:.1f} s waiting; {} synchronised steps, {} mixed islands, {} bodies changed worlds, {:.1f} MB sent",
        waiting, syncs, mixed, arrived, 1e-6 * static_cast<double>(bytes));
  if (anticipated > 0) text += fmt::format("\n{} steps anticipated", anticipated);
  if (anticipated > 0 && rollbacks > 0)
    text += fmt::format("; {} {} did {} of {} results of bodies again", rollbacks,
                        rollbacks == 1 ? "rollback" : "rollbacks", redone, computed);
  if (interruptions > 0) text += fmt::format("\n{} interrupted connections were taken up again", interruptions);
  if (clamped > 0) text += fmt::format("\nwarning: bodies were slowed to the scene's largest speed {} times", clamped);
  if (held > 0) text += fmt::format("\nwarning: {} results were not finite and held back", held);
  std::printf("%s\n", text.c_str());
  std::fflush(stdout);
}

}  // namespace soda::cli
