// Ctrl-C and its like as something to ask about, instead of something that interrupts.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <thread>

namespace soda {

// Make one at the start of main, before any other thread: the signals are blocked there and in all threads to come, and
// waited for by a thread of its own.
class StopSignals {
 public:
  StopSignals();  // SIGINT, SIGTERM, SIGHUP; ignores SIGPIPE
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  int received() const { return received_.load(); }  // the first signal that came, 0 if none
  // Called once, on the thread of the signals, when one comes, or at once if one came before. Null takes it back.
  void on_stop(std::function<void()> callback);

 private:
  void run();

  std::atomic<int> received_{0};
  std::atomic<bool> quit_{false};
  std::mutex mutex_;
  std::function<void()> callback_;
  std::thread thread_;
};

}  // namespace soda
