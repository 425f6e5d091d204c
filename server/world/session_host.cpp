#include "server/world/session_host.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "common/dds/checks.h"

namespace soda::world {
namespace {

constexpr std::chrono::milliseconds kLeaveAtMost{1000};

void hand_out(dds::Writer<wire::SceneChunk>& writer, std::uint64_t instance, const std::string& scene) {
  const std::size_t count = (scene.size() + dds::kMaxChunkBytes - 1) / dds::kMaxChunkBytes;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t begin = i * dds::kMaxChunkBytes;
    const std::size_t length = std::min(dds::kMaxChunkBytes, scene.size() - begin);
    wire::SceneChunk chunk;
    chunk.instance(instance);
    chunk.index(static_cast<std::uint32_t>(i));
    chunk.count(static_cast<std::uint32_t>(count));
    chunk.bytes().resize(length);
    std::memcpy(chunk.bytes().data(), scene.data() + begin, length);
    if (!writer.write(chunk)) throw std::runtime_error("cannot hand out the scene");
  }
}

}  // namespace

SessionHost::SessionHost(dds::Participant& participant, const wire::Session& session, const std::string& encoded_scene,
                         std::shared_ptr<const Scene> decoded_scene, std::vector<WantedAction> actions,
                         SessionListener listener)
    : session_(session),
      listener_(std::move(listener)),
      session_writer_(participant, dds::session_topic()),
      scene_writer_(participant, dds::scene_topic()),
      admission_writer_(participant, dds::admission_topic()),
      control_writer_(participant, dds::control_topic()),
      log_writer_(participant, dds::action_log_topic()),
      answer_writer_(participant, dds::answer_topic()) {
  hand_out(scene_writer_, session.instance(), encoded_scene);
  SessionService::Outlet outlet;
  outlet.control = [this](const wire::Control& control) {
    if (!control_writer_.write(control)) spdlog::warn("cannot publish the session's control");
    listener_.control(control);
  };
  outlet.entry = [this](const wire::LogEntry& entry) {
    if (!log_writer_.write(entry)) spdlog::warn("cannot publish an action; it is told again to those who lack it");
    listener_.entry(entry);
  };
  outlet.answer = [this](const wire::Answer& answer) {
    if (!answer_writer_.write(answer)) spdlog::warn("cannot answer a request");
  };
  service_ =
      std::make_unique<SessionService>(session_, std::move(decoded_scene), std::move(actions), std::move(outlet));
  session_reader_ = std::make_unique<dds::Reader<wire::Session>>(
      participant, dds::session_topic(),
      [this](wire::Session&& other, const dds::WriterKey& writer) { heard(other, writer); });
  join_reader_ = std::make_unique<dds::Reader<wire::Join>>(
      participant, dds::join_topic(), [this](wire::Join&& claim, const dds::WriterKey&) { heard(claim); });
  status_reader_ = std::make_unique<dds::Reader<wire::Status>>(
      participant, dds::status_topic(),
      [this](wire::Status&& status, const dds::WriterKey&) { service_->status(status); });
  request_reader_ = std::make_unique<dds::Reader<wire::Request>>(
      participant, dds::request_topic(),
      [this](wire::Request&& request, const dds::WriterKey&) { service_->request(request); });
  if (!session_writer_.write(session_)) throw std::runtime_error("cannot describe the session");
}

SessionHost::~SessionHost() {
  session_reader_.reset();
  join_reader_.reset();
  status_reader_.reset();
  request_reader_.reset();
  service_.reset();  // its thread uses the writers
}

void SessionHost::heard(const wire::Session& other, const dds::WriterKey& writer) {
  if (writer == session_writer_.key()) return;
  const bool was_first =
      service_->gathering() && (other.protocol() != session_.protocol() || other.started() < session_.started() ||
                                (other.started() == session_.started() && other.instance() < session_.instance()));
  if (!was_first) {
    spdlog::warn("another world 0 came to this session; it will give way");
    return;
  }
  const std::lock_guard lock(mutex_);
  conflict_ = "the session has a world 0 already; choose another --session, or end that one";
}

void SessionHost::heard(const wire::Join& claim) {
  const std::string reason = service_->join(claim);
  if (claim.protocol() != session_.protocol())
    spdlog::warn("refused a daemon that wants to join: {}", reason);
  else if (!reason.empty())
    spdlog::warn("refused a daemon that wants to be world {} ({}, process {}): {}", claim.world(), claim.host(),
                 claim.pid(), reason);
  wire::Admission answer;
  answer.instance(session_.instance());
  answer.nonce(claim.nonce());
  answer.accepted(reason.empty());
  answer.reason(reason);
  if (!admission_writer_.write(answer)) spdlog::warn("cannot answer a daemon that wants to join");
}

std::string SessionHost::conflict() const {
  const std::lock_guard lock(mutex_);
  return conflict_;
}

void SessionHost::leave(std::uint8_t phase) {
  service_->leave(phase);
  finish(kLeaveAtMost);
}

void SessionHost::finish(std::chrono::milliseconds at_most) { control_writer_.wait_acknowledged(at_most); }

}  // namespace soda::world
