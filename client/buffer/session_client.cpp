#include "client/buffer/session_client.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <random>
#include <type_traits>
#include <utility>

#include "common/actions/action_proto.h"
#include "common/scene/scene_file.h"
#include "common/scene_hash.h"
#include "common/version.h"

namespace soda::buffer {
namespace {

using namespace std::chrono_literals;

constexpr auto kAskAgain = 1000ms;
constexpr auto kAskAtMost = 10s;
constexpr auto kLackAgain = 500ms;

std::uint64_t random_client() {
  std::random_device device;
  return (std::uint64_t{device()} << 32 | device()) | 1;
}

}  // namespace

SessionClient::SessionClient(const dds::NetworkOptions& network, const std::string& session, Step history,
                             std::function<void()> on_news, bool transforms)
    : client_(random_client()),
      history_(history),
      on_news_(std::move(on_news)),
      participant_(network, session, "soda-client"),
      requests_(participant_, dds::request_topic()),
      lacks_(participant_, dds::lack_topic()) {
  hear<wire::SceneChunk>(dds::scene_topic());
  hear<wire::Control>(dds::control_topic());
  hear<wire::Status>(dds::status_topic());
  hear<wire::LogEntry>(dds::action_log_topic());
  hear<wire::Answer>(dds::answer_topic());
  if (transforms) hear<wire::Transforms>(dds::transforms_topic());
  hear<wire::Session>(dds::session_topic());
}

SessionClient::~SessionClient() { readers_.clear(); }

template <class T>
void SessionClient::hear(const dds::Topic& topic) {
  readers_.push_back(std::make_shared<dds::Reader<T>>(participant_, topic, [this](T&& sample, const dds::WriterKey&) {
    {
      const std::lock_guard lock(mutex_);
      queue_.emplace_back(std::move(sample));
    }
    changed_.notify_one();
    if (on_news_) on_news_();
  }));
}

void SessionClient::poll(std::chrono::milliseconds at_most) {
  std::deque<News> news;
  {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, at_most, [this] { return !queue_.empty(); });
    news.swap(queue_);
  }
  for (News& one : news) std::visit([this](auto& sample) { take(std::move(sample)); }, one);
  if (!scene_) assemble_scene();
  const auto now = Clock::now();
  ask_again(now);
  for (auto& [world, told] : lacking_) {
    if (now - told < kLackAgain) continue;
    told = now;
    wire::Lack lack;
    lack.instance(session_->instance());
    lack.world(world);
    (void)lacks_.write(lack);  // if that fails: soon again
  }
  if (buffer_) buffer_->release_before(displayed() - history_);
}

template <class T>
bool SessionClient::mine(const T& sample) {
  return session_ && sample.instance() == session_->instance();
}

// ---- what comes: samples may overtake each other between topics
// ------------------------------------------------------

void SessionClient::take(wire::Session&& sample) {
  if (sample.protocol() != kProtocolVersion) {
    other_protocol_ = sample.protocol();
    return;
  }
  if (session_) {
    if (sample.instance() != session_->instance() && sample.started() > session_->started() && ended_.empty())
      ended_ = "another session of this name has begun";
    return;
  }
  session_ = std::move(sample);
  worlds_.resize(session_->worlds());
  buffer_.emplace(session_->worlds());
}

void SessionClient::take(wire::SceneChunk&& sample) {
  if (scene_ || (session_ && !mine(sample))) return;
  if (chunks_.size() != sample.count()) chunks_.assign(sample.count(), {});
  chunks_[sample.index()].assign(sample.bytes().begin(), sample.bytes().end());
}

void SessionClient::assemble_scene() {
  if (!session_ || chunks_.empty() || !ended_.empty() ||
      std::any_of(chunks_.begin(), chunks_.end(), [](const std::string& chunk) { return chunk.empty(); }))
    return;
  std::string encoded;
  for (const std::string& chunk : chunks_) encoded += chunk;
  chunks_.clear();
  if (scene_hash(encoded) != session_->scene_hash()) {
    ended_ = "the scene that the session hands out is not the one that it describes";
    return;
  }
  try {
    scene_ = std::make_shared<const Scene>(decode_scene(encoded, "the session's scene"));
  } catch (const std::exception& error) {
    ended_ = error.what();
    return;
  }
  for (wire::LogEntry& entry : std::exchange(early_, {})) take(std::move(entry));
}

void SessionClient::take(wire::Control&& sample) {
  if (session_ && !mine(sample)) return;
  control_ = std::move(sample);
  if (!session_ || !ended_.empty()) return;
  if (control_->phase() == wire::PHASE_ENDED) ended_ = "the session has ended";
  if (control_->phase() == wire::PHASE_FAILED) ended_ = "the session has failed: a world is gone for good";
}

void SessionClient::take(wire::Status&& sample) {
  if (!mine(sample) || sample.world() >= worlds_.size()) return;
  World& world = worlds_[sample.world()];
  world.status = std::move(sample);
  world.heard = Clock::now();
}

void SessionClient::take(wire::Transforms&& sample) {
  if (!mine(sample) || sample.world() >= worlds_.size()) return;
  if (buffer_->add(sample))
    lacking_.erase(sample.world());
  else
    lacking_.try_emplace(sample.world(), Clock::now() - kLackAgain);
}

void SessionClient::take(wire::LogEntry&& sample) {
  if (session_ && !mine(sample)) return;
  if (!scene_) {
    early_.push_back(std::move(sample));
    return;
  }
  if (!logged_.insert(sample.number()).second) return;
  try {
    const std::string_view bytes(reinterpret_cast<const char*>(sample.action().data()), sample.action().size());
    const WantedAction action = decode_action(bytes, *scene_);
    if (const auto* spawn = std::get_if<Spawn>(&action.action); spawn && action.id)
      spawned_.push_back({*action.id, spawn->body});
  } catch (const ActionError& error) {
    spdlog::warn("entry {} of the action log cannot be read: {}", sample.number(), error.what());
  }
}

void SessionClient::take(wire::Answer&& sample) {
  if (sample.client() != client_ || asked_.erase(sample.number()) == 0) return;
  answers_.push_back(std::move(sample));
}

// ---- what is asked for
// -----------------------------------------------------------------------------------------------

std::uint64_t SessionClient::ask(wire::Request request) {
  request.client(client_);
  request.number(++number_);
  if (session_) request.instance(session_->instance());
  const auto now = Clock::now();
  (void)requests_.write(request);  // if that fails: soon again
  asked_.emplace(number_, Asked{std::move(request), now, now});
  return number_;
}

void SessionClient::ask_again(Clock::time_point now) {
  for (auto at = asked_.begin(); at != asked_.end();) {
    Asked& asked = at->second;
    if (now - asked.first > kAskAtMost) {
      wire::Answer nobody;
      nobody.number(at->first);
      nobody.reason("the session does not answer");
      answers_.push_back(std::move(nobody));
      at = asked_.erase(at);
      continue;
    }
    if (now - asked.last > kAskAgain) {
      asked.last = now;
      (void)requests_.write(asked.request);  // it is done once, however often it arrives
    }
    ++at;
  }
}

std::vector<wire::Answer> SessionClient::take_answers() { return std::exchange(answers_, {}); }

}  // namespace soda::buffer
