#include "common/stop_signals.h"

#include <csignal>
#include <ctime>
#include <utility>

namespace soda {
namespace {

sigset_t stop_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (int number : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, number);
  return set;
}

}  // namespace

StopSignals::StopSignals() {
  std::signal(SIGPIPE, SIG_IGN);
  const sigset_t set = stop_signals();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  thread_ = std::thread([this] { run(); });
}

StopSignals::~StopSignals() {
  quit_.store(true);
  thread_.join();
}

void StopSignals::run() {
  const sigset_t set = stop_signals();
  const timespec look{0, 50'000'000};  // for quit_
  while (!quit_.load()) {
    const int number = sigtimedwait(&set, nullptr, &look);
    if (number <= 0) continue;
    int none = 0;
    if (!received_.compare_exchange_strong(none, number)) continue;
    const std::lock_guard lock(mutex_);
    if (callback_) callback_();
  }
}

void StopSignals::on_stop(std::function<void()> callback) {
  const std::lock_guard lock(mutex_);
  callback_ = std::move(callback);
  if (callback_ && received_.load() != 0) callback_();
}

}  // namespace soda
