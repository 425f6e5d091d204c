#include "server/world/session_service.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "common/dds/topics.h"

namespace soda::world {
namespace {

constexpr std::chrono::milliseconds kTick{10};  // of a paced run: finer than a frame of any display
constexpr double kLogEvery = 5;                 // s, while worlds are missing
constexpr double kSilenceSeconds = std::chrono::duration<double>(dds::kSilence).count();

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

SessionService::SessionService(const wire::Session& session, std::function<void(const wire::Control&)> publish)
    : session_(session),
      publish_(std::move(publish)),
      seats_(session.worlds()),
      pacer_(session.pace() / session.dt(), session.window(), session.last_step()),
      next_log_(seconds_now() + kLogEvery) {
  seats_[0].nonce = session.instance();
  seats_[0].holder = "this process";
  thread_ = std::thread([this] { run(); });
}

SessionService::~SessionService() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
    news_ = true;
  }
  changed_.notify_one();
  thread_.join();
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
  const bool silent = seat.heard > 0 && seconds_now() - seat.heard > kSilenceSeconds;
  if (seat.nonce != 0 && !(silent && phase_ == wire::PHASE_GATHERING))
    return "world " + std::to_string(claim.world()) + " is taken already (by " + seat.holder + ")";
  seat = Seat{};
  seat.nonce = claim.nonce();
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
    seat.state = std::max(seat.state, status.state());
    seat.final_step = std::max<Step>(seat.final_step, status.final_step());
    news_ = true;
  }
  changed_.notify_one();
}

bool SessionService::ended() const {
  const std::lock_guard lock(mutex_);
  return phase_ == wire::PHASE_ENDED;
}

void SessionService::log_missing(double now) {
  if (now < next_log_) return;
  next_log_ = now + kLogEvery;
  std::string missing, unready;
  for (std::size_t i = 0; i < seats_.size(); ++i) {
    if (seats_[i].nonce == 0)
      missing += " " + std::to_string(i);
    else if (seats_[i].state < wire::STATE_READY)
      unready += " " + std::to_string(i);
  }
  if (!missing.empty()) spdlog::info("waiting for worlds to join:{}", missing);
  if (!unready.empty()) spdlog::info("waiting for worlds to get ready:{}", unready);
}

wire::Control SessionService::next(double now) {
  const auto all = [this](std::uint8_t state) {
    return std::all_of(seats_.begin(), seats_.end(),
                       [state](const Seat& s) { return s.nonce != 0 && s.state >= state; });
  };
  if (phase_ == wire::PHASE_GATHERING && all(wire::STATE_READY)) {
    phase_ = wire::PHASE_RUNNING;
    spdlog::info("all worlds are ready; the session starts");
  }
  if (phase_ == wire::PHASE_RUNNING && all(wire::STATE_DONE)) phase_ = wire::PHASE_ENDED;
  if (phase_ == wire::PHASE_GATHERING) log_missing(now);
  wire::Control control;
  control.instance(session_.instance());
  control.phase(phase_);
  if (phase_ != wire::PHASE_GATHERING) {
    Step slowest = session_.last_step();
    for (const Seat& seat : seats_) slowest = std::min(slowest, seat.final_step);
    const Pacer::Order order = pacer_.at(now, slowest);
    control.displayed(order.displayed);
    control.limit(order.limit);
  }
  return control;
}

void SessionService::run() {
  wire::Control last;
  last.displayed(-1);
  std::unique_lock lock(mutex_);
  while (!quit_) {
    news_ = false;
    const wire::Control control = next(seconds_now());
    if (control.phase() != last.phase() || control.displayed() != last.displayed() || control.limit() != last.limit()) {
      last = control;
      lock.unlock();
      publish_(control);
      std::this_thread::sleep_for(kTick / 2);  // however often worlds report
      lock.lock();
      if (quit_) break;
    }
    const bool ticking = phase_ == wire::PHASE_RUNNING && session_.pace() > 0;
    changed_.wait_for(lock, ticking ? kTick : std::chrono::milliseconds(500), [this] { return news_; });
  }
}

}  // namespace soda::world
