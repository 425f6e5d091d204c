#include "server/world/daemon.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <utility>

#include "common/actions/action_proto.h"
#include "common/cpu_clock.h"
#include "common/grid.h"

namespace soda::world {
namespace {

using namespace std::chrono_literals;
using border::Progress;

constexpr auto kStatusEvery = 200ms;
constexpr auto kStatusAtMost = 5ms;  // while a paced session waits for news of progress
constexpr auto kIdleBehind = 4ms;    // where viewers are still to be told something
constexpr auto kIdle = 20ms;         // longest sleep: reports and signals are looked after in between
// A neighbour that is waited for and silent for that long is asked whether something has got lost; then half as often
// each time, because it may just be at a long step. Where that does not help it is also sent again what it has not
// acknowledged.
constexpr auto kPatience = 20ms;
constexpr auto kLongPatience = 500ms;
constexpr auto kPatienceMost = 4000ms;
constexpr auto kFlushAtMost = 5s;  // for neighbours that have left already
constexpr auto kFinishAtMost = 10s;

double seconds(std::chrono::steady_clock::duration d) { return std::chrono::duration<double>(d).count(); }
double seconds(const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); }

std::string host_name() {
  char name[256] = {};
  if (gethostname(name, sizeof name - 1) != 0) return "?";
  return name;
}

}  // namespace

Daemon::Daemon(Scene scene, const DaemonSettings& settings, Transport& transport, Reports& reports)
    : settings_(settings),
      transport_(transport),
      reports_(reports),
      model_(std::move(scene)),
      map_(initial_territories(model_.scene(), make_grid(model_.scene()), settings.worlds)),
      feed_(settings.instance, settings.me, model_.scene().dt, reports),
      recorder_(settings.instance, settings.me, settings.dump_first, settings.dump_last, settings.pose_every, reports,
                feed_) {
  border::CoreSettings core;
  core.me = settings.me;
  core.epoch = settings.epoch;
  core.session = settings.instance;
  core.last_step = settings.last_step;
  core.sync = settings.sync;
  core.window = settings.window;
  core.measure = settings.measure;
  core.actions = true;
  core.balance = settings.balance;
  core_ = std::make_unique<border::WorldCore>(model_, map_, core, recorder_);
  core_->set_limit(0);
  if (settings.balance && settings.worlds > 1) balancer_.emplace(*core_, map_.grid, settings.me, model_.scene().dt);
  lines_.resize(settings.worlds);
  open_lines();
}

// With worlds that have become neighbours.
void Daemon::open_lines() {
  const std::vector<WorldId>& all = core_->neighbours();
  if (opened_ == all.size()) return;
  const std::span<const WorldId> fresh = std::span(all).subspan(opened_);
  opened_ = all.size();
  for (const WorldId world : fresh) lines_.at(world) = {Clock::now(), kPatience, 0};
  transport_.open(fresh);
}

void Daemon::set_limit(Step newest) {
  limit_.store(newest);
  transport_.wake();
}

void Daemon::act(const wire::LogEntry& entry) {
  LoggedAction action;
  action.number = entry.number();
  try {
    const std::string_view bytes(reinterpret_cast<const char*>(entry.action().data()), entry.action().size());
    WantedAction wanted = decode_action(bytes, model_.scene());
    if (!wanted.step) throw ActionError("step: must be given");
    action.step = *wanted.step;
    action.action = std::move(wanted.action);
  } catch (const ActionError& e) {
    return spdlog::error("entry {} of the action log cannot be used: {}", entry.number(), e.what());
  }
  {
    const std::lock_guard lock(actions_mutex_);
    actions_.emplace(action.number, std::move(action));
    actions_came_ = true;
  }
  transport_.wake();
}

void Daemon::close_actions(Step step, ActionNumber logged) {
  {
    const std::lock_guard lock(actions_mutex_);
    closed_ = std::max(closed_, step);
    closed_logged_ = std::max(closed_logged_, logged);
    actions_came_ = true;
  }
  transport_.wake();
}

// Hands the core what is next in the log.
void Daemon::act_all() {
  std::vector<LoggedAction> next;
  Step closed = 0;
  ActionNumber logged = 0;
  {
    const std::lock_guard lock(actions_mutex_);  // not while the core works: it may wait for a reader of reports
    if (!std::exchange(actions_came_, false)) return;
    actions_.erase(actions_.begin(), actions_.upper_bound(core_->logged()));  // told again
    for (ActionNumber number = core_->logged() + 1; !actions_.empty() && actions_.begin()->first == number; ++number) {
      next.push_back(std::move(actions_.begin()->second));
      actions_.erase(actions_.begin());
    }
    closed = closed_, logged = closed_logged_;
  }
  for (const LoggedAction& action : next) core_->act(action);
  core_->close_actions(closed, logged);
}

void Daemon::set_pace(double pace) { pace_.store(pace); }

soda::balance::Pace Daemon::pace() const {
  const double pace = pace_.load();
  if (!(pace > 0) || limit_known_ == kNoLimit) return {};
  return {model_.scene().dt / pace, limit_known_ - settings_.window};
}

void Daemon::balance() {
  balancer_->consider(pace());
  for (border::Transfer& t : core_->take_transfers()) {
    if (t.giver != settings_.me) continue;  // its giver tells it
    spdlog::info("gives {} cells to world {} from step {} on", t.cells.size(), t.taker, t.step);
    wire::Transfer told;
    told.instance(settings_.instance);
    told.world(t.giver);
    told.number(t.number);
    told.step(t.step);
    told.taker(t.taker);
    told.cells(std::move(t.cells));
    reports_.transfer(told);
  }
}

void Daemon::release() {
  released_.store(true);
  transport_.wake();
}

void Daemon::stop() {
  stopped_.store(true);
  transport_.wake();
}

bool Daemon::receive_all() {
  bool any = false;
  while (auto incoming = transport_.receive()) {
    any = true;
    if (incoming->kind == Incoming::Kind::kInterrupted) {
      ++interruptions_;
      spdlog::info("the connection with world {} was interrupted; taking it up again", incoming->from);
      core_->reconnect(incoming->from);
    } else if (!core_->receive(incoming->bytes)) {
      ++refusals_;
      if (refusals_ <= 8 || std::has_single_bit(refusals_))
        spdlog::warn("refused a message of {} bytes from world {}: {} (refusal {})", incoming->bytes.size(),
                     incoming->from, core_->last_refusal(), refusals_);
    } else {
      // Questions, and what comes early because something is missing before it, are no news.
      Line& from = lines_.at(incoming->from);
      if (std::exchange(from.delivered, core_->delivered(incoming->from)) == from.delivered) continue;
      from.heard = Clock::now();
      from.patience = kPatience;
    }
  }
  return any;
}

void Daemon::send_all() {
  for (border::Outgoing& message : core_->take_outgoing()) transport_.send(message.to, std::move(message.bytes));
}

void Daemon::ask_the_silent(Clock::time_point now) {
  bool asked = false;
  for (const WorldId neighbour : core_->waiting_for()) {
    Line& from = lines_.at(neighbour);
    if (now - from.heard < from.patience) continue;
    spdlog::debug("nothing came from world {} for {:.2f} s; asking it", neighbour, seconds(from.patience));
    if (from.patience < kLongPatience)
      core_->ask(neighbour);
    else
      core_->reconnect(neighbour);
    from.heard = now;
    from.patience = std::min<Clock::duration>(2 * from.patience, kPatienceMost);
    asked = true;
  }
  if (asked) send_all();
}

wire::Status Daemon::status() const {
  const border::CoreStats& stats = core_->stats();
  wire::Status s;
  s.instance(settings_.instance);
  s.world(settings_.me);
  s.epoch(settings_.epoch);
  s.state(state_);
  static const std::string host = host_name();
  s.host(host);
  s.pid(static_cast<std::uint32_t>(getpid()));
  s.clock(std::max<Step>(0, core_->clock()));  // below 0 before state 0 is known
  s.final_step(std::max<Step>(0, core_->final_step()));
  s.front(std::max<Step>(0, core_->front()));
  s.bodies(core_->own_bodies());
  s.cells(core_->own_cells());
  s.neighbours(static_cast<std::uint32_t>(core_->neighbours().size()));
  const std::vector<WorldId> lacking = state_ == wire::STATE_RUNNING ? core_->waiting_for() : std::vector<WorldId>();
  s.waiting_for(lacking.empty() ? kNoWorld : lacking.front());
  s.steps(stats.steps);
  s.syncs(stats.syncs);
  s.mixed_islands(stats.mixed_islands);
  s.arrived(stats.arrived);
  s.departed(stats.departed);
  s.wide_bodies(stats.wide_bodies);
  s.messages_sent(stats.messages_sent);
  s.bytes_sent(stats.bytes_sent);
  s.frames_sent(stats.frames_sent);
  s.frame_bodies_sent(stats.frame_bodies_sent);
  s.parts_sent(stats.parts_sent);
  s.messages_resent(stats.messages_resent);
  s.duplicates(stats.duplicates);
  s.refused(stats.refused);
  s.clamped(stats.clamped);
  s.non_finite(stats.non_finite);
  s.logged(core_->logged());
  s.held_back(stats.held_back);
  s.anticipated(stats.anticipated);
  s.bodies_computed(stats.timeline.bodies_computed);
  s.bodies_redone(stats.timeline.bodies_redone);
  s.rollbacks(stats.timeline.steps_redone);
  s.longest_rollback(stats.timeline.longest_rollback);
  const RepairMeter::Repair& repair = repairs_.newest();
  s.repairs(repairs_.count());
  s.repair_step(repair.step);
  s.repair_steps(static_cast<std::uint32_t>(repair.steps));
  s.repair_bodies(repair.bodies);
  s.repair_seconds(seconds(repair.work));
  s.interruptions(interruptions_);
  s.work_seconds(seconds(working_));
  s.waiting_seconds(seconds(waiting_));
  s.paced_seconds(seconds(paced_));
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  s.cpu_seconds(seconds(usage.ru_utime) + seconds(usage.ru_stime));
  s.peak_memory(static_cast<std::uint64_t>(usage.ru_maxrss) * 1024);
  const auto share = [&](std::size_t at, const physics::ModelShare& of) {
    s.shares()[at].islands(of.islands);
    s.shares()[at].bodies(of.bodies);
    s.shares()[at].contacts(of.contacts);
    s.shares()[at].seconds(of.seconds);
  };
  static_assert(std::tuple_size_v<std::remove_reference_t<decltype(s.shares())>> ==
                1 + std::tuple_size_v<decltype(stats.shares.solved)>);
  share(0, stats.shares.flights);
  for (std::size_t k = 0; k < stats.shares.solved.size(); ++k) share(k + 1, stats.shares.solved[k]);
  s.joints_together(stats.shares.joints_together);
  s.joints_alone(stats.shares.joints_alone);
  s.turning_flights(stats.shares.turning_flights);
  s.bouncing(stats.shares.bouncing);
  if (balancer_) {
    s.step_seconds(balancer_->load().work);
    s.steps_on_time(balancer_->load().on_time);
  }
  s.transfers(stats.transfers);
  s.cells_given(stats.cells_given);
  return s;
}

void Daemon::report_status(std::uint8_t state, Clock::time_point now) {
  state_ = state;
  status_at_ = now;
  status_final_ = core_->final_step();
  reports_.status(status());
}

void Daemon::report_if_due(Clock::time_point now) {
  recorder_.flush_if_due(now);
  // A session lets nobody run ahead of the slowest that it has heard of, by a little when it is paced and by some
  // windows when it is not, so news of progress must not be late.
  const Step due = limit_known_ < kNoLimit ? 1 : settings_.window;
  const bool progress = now - status_at_ >= kStatusAtMost && core_->final_step() >= status_final_ + due;
  if (progress || now - status_at_ >= kStatusEvery) report_status(state_, now);
}

Daemon::Clock::duration Daemon::patience() const {
  const double step = seconds(working_) / static_cast<double>(std::max<Step>(1, core_->clock()));
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(border::kPatienceShare * step));
}

void Daemon::idle(Progress progress, Clock::duration at_most) {
  const auto before = Clock::now();
  if (progress == Progress::kHolding) at_most = std::min(at_most, *hold_until_ - before);
  if (at_most <= Clock::duration::zero()) return;
  if (progress == Progress::kWaiting && limit_known_ >= 0) ask_the_silent(before);
  transport_.wait(at_most);
  const auto passed = Clock::now() - before;
  if (state_ != wire::STATE_RUNNING) return;
  if (progress == Progress::kWaiting || progress == Progress::kHolding) waiting_ += passed;
  if (progress == Progress::kAtLimit) paced_ += passed;
}

Daemon::End Daemon::run() {
  std::fill(lines_.begin(), lines_.end(), Line{Clock::now(), kPatience, 0});
  report_status(wire::STATE_PREPARING, Clock::now());
  while (!stopped_.load()) {
    const auto before = Clock::now();
    const double cpu_before = cpu_seconds();
    receive_all();
    open_lines();
    act_all();
    if (const Step limit = limit_.load(); limit != limit_known_) {
      limit_known_ = limit;
      core_->set_limit(limit);
      // Before the start nobody could be silent.
      if (state_ < wire::STATE_RUNNING) {
        std::fill(lines_.begin(), lines_.end(), Line{before, kPatience, 0});
        report_status(wire::STATE_RUNNING, before);
      }
    }
    // Before the start nobody may have been told anything: a seat may still change hands.
    Progress progress = Progress::kWaiting;
    if (limit_known_ >= 0) {
      const Step front = core_->front();
      progress = core_->work(!hold_until_ || before < *hold_until_);
      if (progress != Progress::kHolding)
        hold_until_.reset();
      else if (!hold_until_)
        hold_until_ = before + patience();
      if (balancer_) balance();
      send_all();
      open_lines();
      repairs_.worked(front, *core_, Clock::now() - before);
    }
    const auto now = Clock::now();
    working_ += now - before;
    if (balancer_) balancer_->worked(cpu_seconds() - cpu_before);
    report_if_due(now);
    const bool told = feed_.report(*core_, progress != Progress::kWorked, now);
    if (state_ == wire::STATE_PREPARING && transport_.connected() && reports_.listened_to())
      report_status(wire::STATE_READY, now);
    if (progress == Progress::kDone) {
      if (state_ != wire::STATE_DONE && limit_known_ >= 0) {
        recorder_.flush();
        report_status(wire::STATE_DONE, now);
      }
      if (state_ == wire::STATE_DONE && released_.load()) break;
    }
    if (progress != Progress::kWorked) idle(progress, told ? kIdle : kIdleBehind);
  }
  if (stopped_.load()) return End::kStopped;
  transport_.flush(kFlushAtMost);
  if (!reports_.finish(kFinishAtMost)) spdlog::warn("some reader of this world's reports has not acknowledged all");
  return End::kDone;
}

}  // namespace soda::world
