// What world 0 does for the session besides being a world: it admits worlds, starts the run when all are ready, paces
// it, takes what users want to be done, and ends it when all are done. Knows no DDS: session_host.h brings it to the
// network; a run without network uses it as it is. Not in the step path.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/scene/scene.h"
#include "idl/soda.h"
#include "server/world/action_desk.h"
#include "server/world/pacer.h"

namespace soda::world {

class SessionService {
 public:
  // How the service speaks: called from its own thread. Control whenever anything changes, at most about 200 times a
  // second; entries of the log before the Control that counts them, some again for worlds that lack them.
  struct Outlet {
    std::function<void(const wire::Control&)> control;
    std::function<void(const wire::LogEntry&)> entry;
    std::function<void(const wire::Answer&)> answer;
  };
  // World 0 needs no Join. `actions` are in the log from the start. Throws ActionError where one of them is refused.
  SessionService(const wire::Session& session, std::shared_ptr<const Scene> scene, std::vector<WantedAction> actions,
                 Outlet outlet);
  ~SessionService();
  // The session is over before its end, as `phase` says. Tells that, last of all.
  void leave(std::uint8_t phase);
  SessionService(const SessionService&) = delete;
  SessionService& operator=(const SessionService&) = delete;

  // From any thread. Why the claim is refused, or "". Before the start, the seat of a daemon that has fallen silent is
  // free for another. A world that is silent for long while the session runs ends it (PHASE_FAILED): nobody can take
  // its place.
  std::string join(const wire::Join& claim);
  void status(const wire::Status& status);
  void request(const wire::Request& request);

  bool ended() const;
  bool gathering() const;  // the run has not started

 private:
  void quit();
  bool over() const { return phase_ >= wire::PHASE_ENDED; }
  struct Seat {
    std::uint64_t nonce = 0;  // of the daemon that holds it; 0: free
    std::string holder;       // "host, process pid", for messages
    double heard = 0;         // s, time of the last Status, or of the claim
    bool reported = false;    // there has been a Status
    std::uint8_t state = wire::STATE_PREPARING;
    Step final_step = 0;
    std::uint64_t logged = 0;  // entries of the log that it has
    double behind_since = 0;   // s, that it lacks some that were told
  };

  void run();
  wire::Control next(double now);  // with the lock held
  void log_missing(double now);    // likewise
  bool silent(const Seat& seat, double now) const;
  bool all(std::uint8_t state, double now) const;  // whether all seats are taken and have got that far
  void excuse_own_pause(double now);
  void look_for_the_gone(double now);
  wire::Answer answer_to(const wire::Request& request, std::optional<WantedAction> wanted);
  void tell_log(double now);

  const wire::Session session_;
  const Outlet outlet_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Seat> seats_;
  Pacer pacer_;
  ActionDesk desk_;
  Step closed_ = 0, displayed_ = 0;
  std::size_t told_ = 0;                 // entries of the log
  std::vector<wire::LogEntry> entries_;  // to be told now
  std::vector<wire::Answer> answers_;    // likewise
  std::uint8_t phase_ = wire::PHASE_GATHERING;
  const double began_;  // s, as all times here
  double next_log_ = 0;
  bool warned_ = false;  // that worlds are missing
  double looked_ = 0;    // s, time of the last next()
  bool news_ = false;    // since run() looked
  bool quit_ = false;
  std::thread thread_;
};

}  // namespace soda::world
