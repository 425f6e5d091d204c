#include "server/world/session_guest.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "common/scene_hash.h"

namespace soda::world {
namespace {

constexpr std::chrono::milliseconds kLook{200};
constexpr std::chrono::seconds kLogEvery{5};

}  // namespace

SessionGuest::SessionGuest(dds::Participant& participant, const std::string& session, const wire::Join& claim)
    : name_(session), claim_(claim), participant_(participant) {
  session_ = std::make_unique<dds::Reader<wire::Session>>(
      participant, dds::session_topic(),
      [this](wire::Session&& sample, const dds::WriterKey&) {
        const std::lock_guard lock(mutex_);
        if (sample.protocol() != claim_.protocol())
          other_protocol_ = sample.protocol();
        else
          offer(sample.instance()).session = std::move(sample);
        changed_.notify_all();
      },
      [this](int change) {
        const std::lock_guard lock(mutex_);
        hosts_ += change;
      });
  scene_ = std::make_unique<dds::Reader<wire::SceneChunk>>(
      participant, dds::scene_topic(), [this](wire::SceneChunk&& sample, const dds::WriterKey&) {
        const std::lock_guard lock(mutex_);
        auto& chunks = offer(sample.instance()).chunks;
        if (chunks.empty()) chunks.resize(sample.count());
        if (sample.count() != chunks.size())
          return dds::refusals().add("soda/scene", "the number of chunks has changed");
        chunks[sample.index()].assign(sample.bytes().begin(), sample.bytes().end());
        changed_.notify_all();
      });
  admission_ = std::make_unique<dds::Reader<wire::Admission>>(participant, dds::admission_topic(),
                                                              [this](wire::Admission&& sample, const dds::WriterKey&) {
                                                                if (sample.nonce() != claim_.nonce()) return;
                                                                const std::lock_guard lock(mutex_);
                                                                offer(sample.instance()).admission = std::move(sample);
                                                                changed_.notify_all();
                                                              });
  control_ = std::make_unique<dds::Reader<wire::Control>>(participant, dds::control_topic(),
                                                          [this](wire::Control&& sample, const dds::WriterKey&) {
                                                            const std::lock_guard tell_lock(tell_mutex_);
                                                            bool mine = false;
                                                            {
                                                              const std::lock_guard lock(mutex_);
                                                              offer(sample.instance()).control = sample;
                                                              mine = sample.instance() == instance_;
                                                            }
                                                            if (mine && listener_.control) listener_.control(sample);
                                                          });
  join_ = std::make_unique<dds::Writer<wire::Join>>(participant, dds::join_topic());
  join_->write(claim_);
}

SessionGuest::~SessionGuest() = default;

SessionGuest::Offer& SessionGuest::offer(std::uint64_t instance) {
  constexpr std::size_t kMost = 8;
  if (offers_.size() >= kMost && !offers_.contains(instance)) throw std::runtime_error("too many sessions of one name");
  return offers_[instance];
}

// So that world 0 can say in its log who came.
void SessionGuest::tell_claim() const {
  for (int i = 0; i < 20 && !join_->matched(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  join_->wait_acknowledged(std::chrono::seconds(1));
}

std::optional<SessionGuest::Admitted> SessionGuest::ready() const {
  for (const auto& [instance, offer] : offers_) {
    if (!offer.admission) continue;
    if (!offer.admission->accepted())
      throw Refused("world " + std::to_string(claim_.world()) + " was refused by session '" + name_ +
                    "': " + offer.admission->reason());
    if (!offer.session || offer.chunks.empty() ||
        std::any_of(offer.chunks.begin(), offer.chunks.end(), [](const auto& chunk) { return chunk.empty(); }))
      continue;
    Admitted admitted{*offer.session, {}};
    for (const std::string& chunk : offer.chunks) admitted.encoded_scene += chunk;
    if (scene_hash(admitted.encoded_scene) != offer.session->scene_hash())
      throw Refused("the scene that session '" + name_ + "' hands out is not the one that it describes");
    return admitted;
  }
  const bool none_of_mine =
      std::none_of(offers_.begin(), offers_.end(), [](const auto& entry) { return entry.second.session.has_value(); });
  if (none_of_mine && other_protocol_ != 0)
    throw Refused("session '" + name_ + "' speaks protocol version " + std::to_string(other_protocol_) +
                  " and this daemon version " + std::to_string(claim_.protocol()) + ": use the same build everywhere");
  return std::nullopt;
}

void SessionGuest::log_waiting() const {
  if (offers_.empty()) {
    spdlog::info("waiting for world 0 of session '{}' ...", name_);
    return;
  }
  const Offer& offer = offers_.begin()->second;
  if (!offer.session) {
    spdlog::info("waiting for the description of session '{}' ...", name_);
  } else if (!offer.admission) {
    spdlog::info("waiting to be admitted to session '{}' as world {} ...", name_, claim_.world());
  } else {
    const auto there =
        std::count_if(offer.chunks.begin(), offer.chunks.end(), [](const auto& c) { return !c.empty(); });
    spdlog::info("waiting for the scene of session '{}': {} of {} pieces are here ...", name_, there,
                 offer.chunks.size());
  }
}

std::optional<SessionGuest::Admitted> SessionGuest::join(const std::function<bool()>& stop) {
  auto next_log = std::chrono::steady_clock::now() + std::chrono::seconds(1);
  std::unique_lock lock(mutex_);
  while (!stop()) {
    try {
      if (auto admitted = ready()) {
        instance_ = admitted->session.instance();
        for (auto& [instance, offer] : offers_) offer.chunks.clear();  // a large scene need not be held twice
        return admitted;
      }
    } catch (const Refused&) {
      lock.unlock();  // the handlers need it, and DDS must go on for the claim to arrive
      tell_claim();
      throw;
    }
    if (std::chrono::steady_clock::now() >= next_log) {
      log_waiting();
      next_log += kLogEvery;
    }
    changed_.wait_for(lock, kLook);
  }
  return std::nullopt;
}

void SessionGuest::listen(SessionListener listener) {
  {
    const std::lock_guard tell_lock(tell_mutex_);
    listener_ = std::move(listener);
    std::optional<wire::Control> newest;
    {
      const std::lock_guard lock(mutex_);
      newest = offer(instance_).control;
    }
    if (newest) listener_.control(*newest);
  }
  log_ = std::make_unique<dds::Reader<wire::LogEntry>>(participant_, dds::action_log_topic(),
                                                       [this](wire::LogEntry&& sample, const dds::WriterKey&) {
                                                         const std::lock_guard tell_lock(tell_mutex_);
                                                         if (sample.instance() == instance_ && listener_.entry)
                                                           listener_.entry(sample);
                                                       });
}

void SessionGuest::stop_listening() {
  log_.reset();
  const std::lock_guard tell_lock(tell_mutex_);
  listener_ = {};
}

bool SessionGuest::host_gone() const {
  const std::lock_guard lock(mutex_);
  return hosts_ <= 0;
}

}  // namespace soda::world
