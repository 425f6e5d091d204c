// The session service on the network: world 0's side.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "common/dds/participant.h"
#include "server/world/session_listener.h"
#include "server/world/session_service.h"

namespace soda::world {

class SessionHost {
 public:
  // Describes the session, hands out the scene and admits worlds from now on. `listener` hears what is published, for
  // world 0 itself; it is called from the service's thread, at once, too. Throws ActionError.
  SessionHost(dds::Participant& participant, const wire::Session& session, const std::string& encoded_scene,
              std::shared_ptr<const Scene> decoded_scene, std::vector<WantedAction> actions, SessionListener listener);
  ~SessionHost();

  // Why world 0 must leave, or "": another world 0 was there before.
  std::string conflict() const;
  // Blocks until all members have the last Control, or the time is up.
  void finish(std::chrono::milliseconds at_most);
  // Tells all that the session is over before its end, as wire::PHASE_STOPPED or PHASE_FAILED.
  void leave(std::uint8_t phase);

 private:
  void heard(const wire::Session& other, const dds::WriterKey& writer);
  void heard(const wire::Join& claim);

  const wire::Session session_;
  const SessionListener listener_;
  mutable std::mutex mutex_;
  std::string conflict_;
  dds::Writer<wire::Session> session_writer_;
  dds::Writer<wire::SceneChunk> scene_writer_;
  dds::Writer<wire::Admission> admission_writer_;
  dds::Writer<wire::Control> control_writer_;
  dds::Writer<wire::LogEntry> log_writer_;
  dds::Writer<wire::Answer> answer_writer_;
  std::unique_ptr<SessionService> service_;
  std::unique_ptr<dds::Reader<wire::Session>> session_reader_;
  std::unique_ptr<dds::Reader<wire::Join>> join_reader_;
  std::unique_ptr<dds::Reader<wire::Status>> status_reader_;
  std::unique_ptr<dds::Reader<wire::Request>> request_reader_;
};

}  // namespace soda::world
