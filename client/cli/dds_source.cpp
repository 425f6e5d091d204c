#include "client/cli/dds_source.h"

#include <utility>

namespace soda::cli {

DdsSource::DdsSource(const dds::NetworkOptions& network, const std::string& session, bool with_states,
                     bool for_recording)
    : participant_(network, session, "soda") {
  if (with_states) hear<wire::StateChunk>(dds::states_topic());
  if (for_recording) {
    hear<wire::Poses>(dds::poses_topic());
    hear<wire::LogEntry>(dds::action_log_topic());
    hear<wire::Control>(dds::control_topic());
  }
  hear<wire::Digests>(dds::digests_topic());
  hear<wire::Status>(dds::status_topic());
  hear<wire::Session>(dds::session_topic());
}

template <class T>
void DdsSource::hear(const dds::Topic& topic) {
  readers_.push_back(std::make_shared<dds::Reader<T>>(
      participant_, topic, [this](T&& sample, const dds::WriterKey&) { push(std::move(sample)); }));
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
