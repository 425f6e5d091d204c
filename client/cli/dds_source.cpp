#include "client/cli/dds_source.h"

#include <utility>

namespace soda::cli {

DdsSource::DdsSource(const dds::NetworkOptions& network, const std::string& session, bool with_states,
                     bool for_recording)
    : participant_(network, session, "soda") {
  if (with_states)
    states_.emplace(participant_, dds::states_topic(),
                    [this](wire::StateChunk&& sample, const dds::WriterKey&) { push(std::move(sample)); });
  if (for_recording) {
    poses_.emplace(participant_, dds::poses_topic(),
                   [this](wire::Poses&& sample, const dds::WriterKey&) { push(std::move(sample)); });
    log_.emplace(participant_, dds::action_log_topic(),
                 [this](wire::LogEntry&& sample, const dds::WriterKey&) { push(std::move(sample)); });
    control_.emplace(participant_, dds::control_topic(),
                     [this](wire::Control&& sample, const dds::WriterKey&) { push(std::move(sample)); });
  }
  digests_.emplace(participant_, dds::digests_topic(),
                   [this](wire::Digests&& sample, const dds::WriterKey&) { push(std::move(sample)); });
  status_.emplace(participant_, dds::status_topic(),
                  [this](wire::Status&& sample, const dds::WriterKey&) { push(std::move(sample)); });
  session_.emplace(participant_, dds::session_topic(),
                   [this](wire::Session&& sample, const dds::WriterKey&) { push(std::move(sample)); });
}

void DdsSource::push(dds::Report report) {
  {
    const std::lock_guard lock(mutex_);
    queue_.push_back(std::move(report));
  }
  changed_.notify_one();
}

std::optional<dds::Report> DdsSource::next(std::chrono::milliseconds at_most) {
  std::unique_lock lock(mutex_);
  if (!changed_.wait_for(lock, at_most, [this] { return !queue_.empty(); })) return std::nullopt;
  dds::Report first = std::move(queue_.front());
  queue_.pop_front();
  return first;
}

}  // namespace soda::cli
