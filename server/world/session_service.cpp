#include "server/world/session_service.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "common/dds/topics.h"

namespace soda::world {
namespace {

constexpr std::chrono::milliseconds kTick{5};  // of a paced run: finer than a frame of any display
constexpr double kTellAgain = 0.5;             // s that a world may lack entries of the log that were told
constexpr std::size_t kTellAtOnce = 256;       // of those, again
constexpr double kLogMissingEvery = 5;         // s, while worlds are missing
constexpr double kWarnMissing = 10;            // s after which that is strange where all were started together
constexpr double kJoining = 60;                // s that a daemon may take to load the scene and say so
constexpr double kGone = 120;                  // s of silence after which a running world will not come back
constexpr double kPause = 2;                   // s between two looks at the clock: this process stood still
constexpr double kSilenceSeconds = std::chrono::duration<double>(dds::kSilence).count();

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

SessionService::SessionService(const wire::Session& session, std::shared_ptr<const Scene> scene,
                               std::vector<WantedAction> actions, Outlet outlet)
    : session_(session),
      outlet_(std::move(outlet)),
      seats_(session.worlds()),
      pacer_(session.pace() / session.dt(), session.window(), session.lead(), session.last_step()),
      desk_(session.instance(), std::move(scene), std::move(actions)),
      began_(seconds_now()),
      next_log_(began_ + kLogMissingEvery),
      looked_(began_) {
  seats_[0].nonce = session.instance();
  seats_[0].holder = "this process";
  seats_[0].heard = seconds_now();
  thread_ = std::thread([this] { run(); });
}

SessionService::~SessionService() { quit(); }

void SessionService::quit() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
    news_ = true;
  }
  changed_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void SessionService::leave(std::uint8_t phase) {
  {
    const std::lock_guard lock(mutex_);
    if (!over()) phase_ = phase;
  }
  quit();
}

std::string SessionService::join(const wire::Join& claim) {
  if (claim.protocol() != session_.protocol())
    return "it speaks protocol version " + std::to_string(claim.protocol()) + " and this session version " +
           std::to_string(session_.protocol()) + " (soda " + session_.version() + "): use the same build everywhere";
  if (claim.scene_hash() != 0 && claim.scene_hash() != session_.scene_hash()) {
    char text[128];
    std::snprintf(text, sizeof text, "it insists on scene %016llx and this session runs %016llx",
                  static_cast<unsigned long long>(claim.scene_hash()),
                  static_cast<unsigned long long>(session_.scene_hash()));
    return text;
  }
  const std::lock_guard lock(mutex_);
  if (claim.world() >= seats_.size())
    return "there is no world " + std::to_string(claim.world()) + ": the session has worlds 0 to " +
           std::to_string(seats_.size() - 1);
  Seat& seat = seats_[claim.world()];
  if (seat.nonce == claim.nonce()) return "";  // told again
  if (seat.nonce != 0 && !(silent(seat, seconds_now()) && phase_ == wire::PHASE_GATHERING))
    return "world " + std::to_string(claim.world()) + " is taken already (by " + seat.holder + ")";
  seat = Seat{};
  seat.nonce = claim.nonce();
  seat.heard = seconds_now();
  seat.holder = claim.host() + ", process " + std::to_string(claim.pid());
  const auto free = std::count_if(seats_.begin(), seats_.end(), [](const Seat& s) { return s.nonce == 0; });
  spdlog::info("world {} joined ({}); {} missing", claim.world(), seat.holder, free);
  return "";
}

void SessionService::status(const wire::Status& status) {
  {
    const std::lock_guard lock(mutex_);
    if (status.instance() != session_.instance() || status.world() >= seats_.size()) return;
    Seat& seat = seats_[status.world()];
    if (seat.nonce == 0) return;
    seat.heard = seconds_now();
    seat.reported = true;
    seat.state = std::max(seat.state, status.state());
    seat.final_step = std::max<Step>(seat.final_step, status.final_step());
    seat.logged = std::max(seat.logged, status.logged());
    news_ = true;
  }
  changed_.notify_one();
}

void SessionService::request(const wire::Request& request) {
  // Before anything is locked: a large body takes its time.
  std::optional<WantedAction> wanted;
  std::string problem;
  try {
    if (request.kind() == wire::REQUEST_ACTION) wanted = desk_.read(request);
  } catch (const ActionError& e) {
    problem = e.what();
  }
  {
    const std::lock_guard lock(mutex_);
    if (request.instance() != 0 && request.instance() != session_.instance()) return;
    std::optional<wire::Answer> answer;
    if (!desk_.is_repeated(request, answer)) {
      answer = problem.empty() ? answer_to(request, std::move(wanted)) : desk_.answer(request, problem, displayed_);
      desk_.note(*answer);
    }
    if (!answer) return;
    answers_.push_back(*answer);
    news_ = true;
  }
  changed_.notify_one();
}

wire::Answer SessionService::answer_to(const wire::Request& request, std::optional<WantedAction> wanted) {
  if (over()) return desk_.answer(request, "the session has ended", displayed_);
  switch (request.kind()) {
    case wire::REQUEST_ACTION:
      if (closed_ >= session_.last_step())
        return desk_.answer(request, "the session's last step is closed for actions", displayed_);
      return desk_.act(request, std::move(wanted.value()), closed_ + 1);
    case wire::REQUEST_PAUSE:
      pacer_.pause();
      break;
    case wire::REQUEST_RESUME:
      pacer_.resume();
      break;
    case wire::REQUEST_STEP:
      if (!pacer_.paused()) return desk_.answer(request, "single steps are for a paused session", displayed_);
      pacer_.step(static_cast<Step>(request.value()));
      break;
    default:
      pacer_.set_rate(request.value() / session_.dt());
  }
  return desk_.answer(request, "", displayed_);
}

// What is new in the log, and what a world lacks of what was told some time ago. Nothing before the start: not all who
// are to hear it may be there.
void SessionService::tell_log(double now) {
  if (phase_ == wire::PHASE_GATHERING) return;
  const auto& log = desk_.entries();
  for (Seat& seat : seats_) {
    if (seat.logged >= told_ || !seat.reported) {
      seat.behind_since = now;
    } else if (now - seat.behind_since > kTellAgain) {
      seat.behind_since = now;
      const std::size_t end = std::min(told_, seat.logged + kTellAtOnce);
      entries_.insert(entries_.end(), log.begin() + static_cast<std::ptrdiff_t>(seat.logged),
                      log.begin() + static_cast<std::ptrdiff_t>(end));
    }
  }
  for (; told_ < log.size(); ++told_) entries_.push_back(log[told_]);
}

bool SessionService::gathering() const {
  const std::lock_guard lock(mutex_);
  return phase_ == wire::PHASE_GATHERING;
}

bool SessionService::silent(const Seat& seat, double now) const {
  return now - seat.heard > (seat.reported ? kSilenceSeconds : kJoining);
}

bool SessionService::all(std::uint8_t state, double now) const {
  return std::all_of(seats_.begin(), seats_.end(), [&](const Seat& s) {
    return s.nonce != 0 && s.state >= state && (phase_ != wire::PHASE_GATHERING || !silent(s, now));
  });
}

// What others said while this process stood still may still be on its way.
void SessionService::excuse_own_pause(double now) {
  const double passed = now - std::exchange(looked_, now);
  if (passed < kPause) return;
  for (Seat& seat : seats_) seat.heard += passed;
}

void SessionService::look_for_the_gone(double now) {
  for (std::size_t i = 0; i < seats_.size(); ++i) {
    const Seat& seat = seats_[i];
    if (seat.state >= wire::STATE_DONE || now - seat.heard < kGone) continue;
    spdlog::error("world {} ({}) has been silent for {:.0f} s; the session ends", i, seat.holder, now - seat.heard);
    phase_ = wire::PHASE_FAILED;
    return;
  }
}

bool SessionService::ended() const {
  const std::lock_guard lock(mutex_);
  return phase_ == wire::PHASE_ENDED;
}

void SessionService::log_missing(double now) {
  if (now < next_log_) return;
  next_log_ = now + kLogMissingEvery;
  std::string missing, unready;
  for (std::size_t i = 0; i < seats_.size(); ++i) {
    if (seats_[i].nonce == 0)
      missing += " " + std::to_string(i);
    else if (seats_[i].state < wire::STATE_READY || silent(seats_[i], now))
      unready += " " + std::to_string(i);
  }
  const bool warn = !warned_ && now - began_ >= kWarnMissing;
  warned_ = warned_ || warn;
  const auto level = warn ? spdlog::level::warn : spdlog::level::info;
  if (!missing.empty()) spdlog::log(level, "waiting for worlds to join:{}", missing);
  if (!unready.empty()) spdlog::log(level, "waiting for worlds to get ready:{}", unready);
}

wire::Control SessionService::next(double now) {
  excuse_own_pause(now);
  if (phase_ == wire::PHASE_GATHERING && all(wire::STATE_READY, now)) {
    phase_ = wire::PHASE_RUNNING;
    spdlog::info("all worlds are ready; the session starts");
  }
  if (phase_ == wire::PHASE_RUNNING && all(wire::STATE_DONE, now)) phase_ = wire::PHASE_ENDED;
  if (phase_ == wire::PHASE_RUNNING) look_for_the_gone(now);
  if (phase_ == wire::PHASE_GATHERING) log_missing(now);
  wire::Control control;
  control.instance(session_.instance());
  control.phase(phase_);
  if (phase_ != wire::PHASE_GATHERING) {
    Step slowest = session_.last_step();
    for (const Seat& seat : seats_) slowest = std::min(slowest, seat.final_step);
    const Pacer::Order order = pacer_.at(now, slowest);
    displayed_ = order.displayed;
    closed_ = order.closed;
    control.displayed(order.displayed);
    control.limit(order.limit);
    control.closed(order.closed);
  }
  tell_log(now);
  control.logged(told_);
  control.pace(pacer_.rate() * session_.dt());
  control.paused(pacer_.paused());
  return control;
}

void SessionService::run() {
  wire::Control last;
  last.displayed(-1);
  std::unique_lock lock(mutex_);
  while (!quit_) {
    news_ = false;
    const wire::Control control = next(seconds_now());
    if (!(control == last) || !entries_.empty() || !answers_.empty()) {
      const auto entries = std::exchange(entries_, {});
      const auto answers = std::exchange(answers_, {});
      lock.unlock();
      for (const wire::LogEntry& entry : entries) outlet_.entry(entry);
      if (!(control == last)) outlet_.control(control);
      for (const wire::Answer& answer : answers) outlet_.answer(answer);
      last = control;
      std::this_thread::sleep_for(kTick / 2);  // however often worlds report
      lock.lock();
      if (quit_) break;
    }
    const bool ticking = phase_ == wire::PHASE_RUNNING && pacer_.rate() > 0 && !pacer_.paused();
    changed_.wait_for(lock, ticking ? kTick : std::chrono::milliseconds(500), [this] { return news_; });
  }
  if (over() && last.phase() != phase_) outlet_.control(next(seconds_now()));
}

}  // namespace soda::world
