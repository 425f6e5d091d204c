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
constexpr auto kGone = 15s;  // without a word of any world

constexpr std::size_t kMostAsked = 512;
constexpr std::size_t kMostQueued = std::size_t{128} << 20;  // bytes

std::size_t bytes_of(const wire::Transforms& sample) {
  return sizeof sample + sample.ids().size() * 77 + sample.gone().size() * 8;  // soda.idl
}

wire::Answer refusal(std::uint64_t number) {
  wire::Answer nobody;
  nobody.number(number);
  nobody.reason("the session does not answer");
  return nobody;
}

std::uint64_t random_client() {
  std::random_device device;
  return (std::uint64_t{device()} << 32 | device()) | 1;
}

}  // namespace

SessionClient::SessionClient(const dds::NetworkOptions& network, const std::string& session, Following following)
    : client_(random_client()),
      following_(std::move(following)),
      participant_(network, session, "soda-client"),
      requests_(participant_, dds::request_topic()),
      lacks_(participant_, dds::lack_topic()) {
  hear<wire::SceneChunk>(dds::scene_topic());
  hear<wire::Control>(dds::control_topic());
  hear<wire::Status>(dds::status_topic());
  hear<wire::LogEntry>(dds::action_log_topic());
  hear<wire::Answer>(dds::answer_topic());
  if (following_.transforms) {
    hear<wire::Transforms>(dds::transforms_topic());
    hear<wire::Transfer>(dds::transfers_topic());
  }
  hear<wire::Session>(dds::session_topic());
}

SessionClient::~SessionClient() { readers_.clear(); }

template <class T>
void SessionClient::hear(const dds::Topic& topic) {
  readers_.push_back(
      std::make_shared<dds::Reader<T>>(participant_, topic, [this](T&& sample, const dds::WriterKey& writer) {
        {
          const std::lock_guard lock(mutex_);
          if constexpr (std::is_same_v<T, wire::Transforms>)
            keep(Told{std::move(sample), writer});
          else
            queue_.emplace_back(std::move(sample));
        }
        changed_.notify_one();
        if (following_.on_news) following_.on_news();
      }));
}

// Nobody holds worlds up, so what is not taken in time cannot be kept without end.
void SessionClient::keep(Told&& told) {
  queued_bytes_ += bytes_of(told.sample);
  if (queued_bytes_ <= kMostQueued) {
    queue_.emplace_back(std::move(told));
    return;
  }
  std::erase_if(queue_, [](const News& news) { return std::holds_alternative<Told>(news); });
  queued_bytes_ = 0;
  dropped_ = true;
}

void SessionClient::poll(std::chrono::milliseconds at_most) {
  std::deque<News> news;
  bool dropped = false;
  {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, at_most, [this] { return !queue_.empty(); });
    news.swap(queue_);
    queued_bytes_ = 0;
    dropped = std::exchange(dropped_, false);
  }
  for (News& one : news) std::visit([this](auto& sample) { take(std::move(sample)); }, one);
  if (!scene_) assemble_scene();
  const auto now = Clock::now();
  ask_again(now);
  if (dropped)
    for (WorldId world = 0; world < worlds_.size(); ++world) lacking_.try_emplace(world, now - kLackAgain);
  tell_lacks(now);
  if (ended_.empty() && !worlds_.empty() && std::all_of(worlds_.begin(), worlds_.end(), [&](const World& world) {
        return world.status && now - world.heard > kGone;
      })) {
    fail("nothing has been heard of the session for some time");
    gone_ = true;
  }
  // A later session counts when ours is gone: if both are there, the later one gives way.
  if (rival_ && (!ended_.empty() || worlds_[0].silent(now))) {
    superseded_ = true;
    if (ended_.empty()) ended_ = "another session of this name has begun";
  }
  if (buffer_) buffer_->release_before(displayed() - following_.history);
}

void SessionClient::tell_lacks(Clock::time_point now) {
  for (auto& [world, told] : lacking_) {
    if (now - told < kLackAgain) continue;
    told = now;
    wire::Lack lack;
    lack.instance(session_->instance());
    lack.world(world);
    (void)lacks_.write(lack);  // if that fails: soon again
  }
}

template <class T>
bool SessionClient::mine(const T& sample) {
  return session_ && sample.instance() == session_->instance();
}

// ---- what comes: samples may overtake each other between topics
// ------------------------------------------------------

void SessionClient::fail(std::string why) {
  ended_ = std::move(why);
  failed_ = true;
}

void SessionClient::take(wire::Session&& sample) {
  if (sample.started() <= following_.after) return;
  if (session_) {
    rival_ = rival_ || (sample.instance() != session_->instance() && sample.started() > session_->started());
    return;
  }
  if (sample.protocol() != kProtocolVersion) {
    other_protocol_ = sample.protocol();
    return;
  }
  session_ = std::move(sample);
  if (control_ && !mine(*control_)) control_.reset();
  worlds_.resize(session_->worlds());
  tellers_.resize(session_->worlds());
  buffer_.emplace(session_->worlds());
  for (wire::Transfer& transfer : std::exchange(early_transfers_, {})) take(std::move(transfer));
  // What has come before this was not taken, and may be all that there is for now.
  if (following_.transforms)
    for (WorldId world = 0; world < worlds_.size(); ++world) lacking_.emplace(world, Clock::now());
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
    fail("the scene that the session hands out is not the one that it describes");
    return;
  }
  try {
    scene_ = std::make_shared<const Scene>(decode_scene(encoded, "the session's scene"));
  } catch (const std::exception& error) {
    fail(error.what());
    return;
  }
  for (wire::LogEntry& entry : std::exchange(early_, {})) take(std::move(entry));
}

void SessionClient::take(wire::Control&& sample) {
  if (session_ && !mine(sample)) return;
  control_ = std::move(sample);
  if (!session_ || !ended_.empty()) return;
  if (control_->phase() == wire::PHASE_ENDED) ended_ = "the session has ended";
  if (control_->phase() == wire::PHASE_STOPPED) ended_ = "the session was stopped";
  if (control_->phase() == wire::PHASE_FAILED) fail("the session has failed: a world is gone for good");
}

void SessionClient::take(wire::Status&& sample) {
  if (!mine(sample) || sample.world() >= worlds_.size()) return;
  World& world = worlds_[sample.world()];
  superseded_ = superseded_ || gone_;
  world.status = std::move(sample);
  world.heard = Clock::now();
}

void SessionClient::take(Told&& told) {
  const wire::Transforms& sample = told.sample;
  if (!mine(sample) || sample.world() >= worlds_.size()) return;
  const auto now = Clock::now();
  Teller& teller = tellers_[sample.world()];
  if (teller.writer != told.writer && now - teller.heard < dds::kSilence) return;
  teller = {told.writer, now};
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

void SessionClient::take(wire::Transfer&& sample) {
  if (!session_) {
    early_transfers_.push_back(std::move(sample));  // nobody tells it again
    return;
  }
  if (!mine(sample) || sample.world() >= worlds_.size() || sample.taker() >= worlds_.size()) return;
  // Who was given up by DDS and is met again tells all of them again.
  if (known_transfers_.emplace(sample.world(), sample.number()).second) transfers_.push_back(std::move(sample));
}

// ---- what is asked for
// -----------------------------------------------------------------------------------------------

std::uint64_t SessionClient::ask(wire::Request request) {
  request.client(client_);
  request.number(++number_);
  if (session_) request.instance(session_->instance());
  const auto now = Clock::now();
  if (asked_.size() >= kMostAsked) {
    answers_.push_back(refusal(number_));
    return number_;
  }
  asked_.emplace(number_, Asked{std::move(request), now, now});
  write_requests();
  return number_;
}

// In order: of a client that has asked for something, nothing is done that it has asked for before.
void SessionClient::write_requests() {
  for (auto at = asked_.upper_bound(written_); at != asked_.end() && requests_.write(at->second.request); ++at)
    written_ = at->first;
}

void SessionClient::ask_again(Clock::time_point now) {
  bool writable = true;
  for (auto at = asked_.begin(); at != asked_.end();) {
    Asked& asked = at->second;
    if (now - asked.first > kAskAtMost) {
      answers_.push_back(refusal(at->first));
      at = asked_.erase(at);
      continue;
    }
    if (now - asked.last > kAskAgain && at->first <= written_ && writable) {
      asked.last = now;
      writable = requests_.write(asked.request);  // it is done once, however often it arrives
    }
    ++at;
  }
  if (writable) write_requests();
}

std::vector<wire::Answer> SessionClient::take_answers() { return std::exchange(answers_, {}); }

}  // namespace soda::buffer
