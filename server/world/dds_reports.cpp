#include "server/world/dds_reports.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace soda::world {
namespace {

// Nothing may be lost here: where a reader does not keep up, the world waits for it.
template <class T>
void write_surely(dds::Writer<T>& writer, const T& sample, const std::function<bool()>& give_up) {
  for (int attempt = 1; !writer.write(sample) && !give_up(); ++attempt)
    if (attempt == 3) spdlog::warn("a reader of this world's reports does not keep up; waiting for it");
}

}  // namespace

DdsReports::DdsReports(dds::Participant& participant, std::uint64_t instance, WorldId me, bool supervised,
                       bool with_states, bool with_poses, std::function<bool()> give_up)
    : supervised_(supervised),
      give_up_(std::move(give_up)),
      status_(participant, dds::status_topic()),
      digests_(participant, dds::digests_topic()),
      transfers_(participant, dds::transfers_topic()),
      transforms_(participant, dds::transforms_topic(),
                  [this](int change) {
                    if (change > 0) lack_.store(true);
                  }),
      lacks_(participant, dds::lack_topic(), [this, instance, me](wire::Lack&& lack, const dds::WriterKey&) {
        if (lack.instance() == instance && lack.world() == me) lack_.store(true);
      }) {
  if (with_states) states_ = std::make_unique<dds::Writer<wire::StateChunk>>(participant, dds::states_topic());
  if (with_poses) poses_ = std::make_unique<dds::Writer<wire::Poses>>(participant, dds::poses_topic());
}

bool DdsReports::listened_to() const {
  return !supervised_ || (digests_.matched() && status_.matched() && (!states_ || states_->matched()) &&
                          (!poses_ || poses_->matched()));
}

// A status that cannot be written is not worth waiting for: the next one says more.
void DdsReports::status(const wire::Status& sample) { status_.write(sample); }

void DdsReports::digests(const wire::Digests& sample) { write_surely(digests_, sample, give_up_); }

void DdsReports::state(const wire::StateChunk& sample) {
  if (!states_) throw std::logic_error("this session has no states to report");
  write_surely(*states_, sample, give_up_);
}

void DdsReports::poses(const wire::Poses& sample) {
  if (!poses_) throw std::logic_error("this session has no poses to report");
  write_surely(*poses_, sample, give_up_);
}

// It is told once, and who lacks it would be wrong about its cells for the rest of the session.
void DdsReports::transfer(const wire::Transfer& sample) { write_surely(transfers_, sample, give_up_); }

void DdsReports::transforms(const wire::Transforms& sample) { transforms_.write(sample); }

bool DdsReports::finish(std::chrono::milliseconds at_most) {
  const auto until = std::chrono::steady_clock::now() + at_most;
  const auto left = [&] {
    return std::max(std::chrono::milliseconds(1),
                    std::chrono::duration_cast<std::chrono::milliseconds>(until - std::chrono::steady_clock::now()));
  };
  bool all = digests_.wait_acknowledged(left());
  // Viewers shall see the end, but nobody waits long for them; world 0 has, for it has said that this world may go.
  (void)status_.wait_acknowledged(std::min(left(), std::chrono::milliseconds(300)));
  (void)transfers_.wait_acknowledged(std::min(left(), std::chrono::milliseconds(300)));
  (void)transforms_.wait_acknowledged(std::min(left(), std::chrono::milliseconds(300)));
  if (poses_) all = poses_->wait_acknowledged(left()) && all;
  if (states_) all = states_->wait_acknowledged(left()) && all;
  return all;
}

}  // namespace soda::world
