// What world 0 does for the session besides being a world: it admits worlds, starts the run when all are ready, paces
// it, and ends it when all are done. Knows no DDS: session_host.h brings it to the network; a run without network uses
// it as it is. Not in the step path.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "idl/soda.h"
#include "server/world/pacer.h"

namespace soda::world {

class SessionService {
 public:
  // `publish` is called from the service's own thread whenever anything changes, at most about 100 times a second.
  // World 0 needs no Join.
  SessionService(const wire::Session& session, std::function<void(const wire::Control&)> publish);
  ~SessionService();
  SessionService(const SessionService&) = delete;
  SessionService& operator=(const SessionService&) = delete;

  // From any thread. Why the claim is refused, or "". Before the start, the seat of a daemon that has fallen silent is
  // free for another. A world that is silent for long while the session runs ends it (PHASE_FAILED): nobody can take
  // its place.
  std::string join(const wire::Join& claim);
  void status(const wire::Status& status);

  bool ended() const;
  bool gathering() const;  // the run has not started

 private:
  struct Seat {
    std::uint64_t nonce = 0;  // of the daemon that holds it; 0: free
    std::string holder;       // "host, process pid", for messages
    double heard = 0;         // s, time of the last Status, or of the claim
    bool reported = false;    // there has been a Status
    std::uint8_t state = wire::STATE_PREPARING;
    Step final_step = 0;
  };

  void run();
  wire::Control next(double now);  // with the lock held
  void log_missing(double now);    // likewise
  bool silent(const Seat& seat, double now) const;
  bool all(std::uint8_t state, double now) const;  // whether all seats are taken and have got that far
  void excuse_own_pause(double now);
  void look_for_the_gone(double now);

  const wire::Session session_;
  const std::function<void(const wire::Control&)> publish_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Seat> seats_;
  Pacer pacer_;
  std::uint8_t phase_ = wire::PHASE_GATHERING;
  double next_log_ = 0;
  double looked_ = 0;  // s, time of the last next()
  bool news_ = false;  // since run() looked
  bool quit_ = false;
  std::thread thread_;
};

}  // namespace soda::world
