// The session as seen by every world but 0: asks to be admitted, gets the description and the scene, and hears Control.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/dds/participant.h"
#include "common/ids.h"
#include "server/world/session_listener.h"

namespace soda::world {

// The daemon may not take part; what() is for people.
struct Refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class SessionGuest {
 public:
  // Claims a world at once.
  SessionGuest(dds::Participant& participant, const std::string& session, const wire::Join& claim);
  ~SessionGuest();

  struct Admitted {
    wire::Session session;
    std::string encoded_scene;  // its hash is right
  };
  // Blocks until the session has described itself, admitted this daemon and handed out its scene. Logs what it waits
  // for. Nothing if `stop` said so. Throws Refused.
  std::optional<Admitted> join(const std::function<bool()>& stop);

  // `listener` hears the newest Control and all that follow, and the action log, of the session that admitted this
  // daemon.
  void listen(SessionListener listener);
  void stop_listening();  // the listener does not run any more when this returns
  // Whether world 0 is gone.
  bool host_gone() const;

 private:
  struct Offer {  // a session that was heard of: one, unless two daemons claim to be world 0
    std::optional<wire::Session> session;
    std::optional<wire::Control> control;
    std::optional<wire::Admission> admission;
    std::vector<std::string> chunks;  // by index; "" if not there yet
  };

  // The offer of that session; with the lock held. There is room for a few, in case several daemons claim to be world
  // 0.
  Offer& offer(std::uint64_t instance);
  std::optional<Admitted> ready() const;  // with the lock held; throws Refused
  void log_waiting() const;               // likewise
  void tell_claim() const;

  const std::string name_;
  const wire::Join claim_;
  dds::Participant& participant_;
  std::mutex tell_mutex_;  // guards listener_, also while it runs; taken before mutex_
  SessionListener listener_;
  mutable std::mutex mutex_;  // guards the rest
  std::condition_variable changed_;
  std::map<std::uint64_t, Offer> offers_;  // by instance
  std::uint64_t instance_ = 0;             // that admitted this daemon
  std::uint32_t other_protocol_ = 0;       // of a session that speaks another version; 0: none was met
  int hosts_ = 0;                          // session writers matched
  std::unique_ptr<dds::Reader<wire::Session>> session_;
  std::unique_ptr<dds::Reader<wire::SceneChunk>> scene_;
  std::unique_ptr<dds::Reader<wire::Admission>> admission_;
  std::unique_ptr<dds::Reader<wire::Control>> control_;
  std::unique_ptr<dds::Reader<wire::LogEntry>> log_;
  std::unique_ptr<dds::Writer<wire::Join>> join_;
};

}  // namespace soda::world
