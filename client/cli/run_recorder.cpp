#include "client/cli/run_recorder.h"

#include <algorithm>
#include <utility>

#include "common/run_settings.h"

namespace soda::cli {

RunRecorder::RunRecorder(const std::filesystem::path& path, std::string encoded_scene)
    : writer_(path), encoded_scene_(std::move(encoded_scene)) {}

void RunRecorder::take(const wire::Session& session) {
  worlds_ = session.worlds();
  pose_every_ = session.pose_every();
  pb::RecordedSettings settings;
  settings.set_version(session.version());
  settings.set_scene_name(session.scene_name());
  settings.set_dt(session.dt());
  settings.set_last_step(session.last_step());
  settings.set_worlds(session.worlds());
  settings.set_sync(sync_name(session.sync()));
  settings.set_anticipation(session.window());
  settings.set_input_lead(session.lead());
  settings.set_pace(session.pace());
  settings.set_pose_every(session.pose_every());
  writer_.begin(session.scene_hash(), encoded_scene_, settings);
  encoded_scene_.clear();
}

void RunRecorder::take(const wire::LogEntry& entry) {
  if (entry.number() > logged_) entries_.emplace(entry.number(), entry);
  for (auto next = entries_.begin(); next != entries_.end() && next->first == logged_ + 1;
       next = entries_.erase(next)) {
    const auto& bytes = next->second.action();
    writer_.add_action(++logged_, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
  write();
}

void RunRecorder::take(const wire::Control& control) {
  if (control.phase() == wire::PHASE_GATHERING) return;
  closings_.emplace_back(control.closed(), control.logged());
  write();
}

void RunRecorder::take(const wire::Poses& poses) {
  Sample& sample = poses_[poses.step()];
  sample.missing.resize(worlds_);
  sample.heard.resize(worlds_);
  if (!sample.heard[poses.world()]) sample.missing[poses.world()] = poses.total();
  sample.heard[poses.world()] = true;
  const auto n = static_cast<std::uint32_t>(poses.ids().size());
  sample.missing[poses.world()] -= std::min(n, sample.missing[poses.world()]);
  for (const auto id : poses.ids()) sample.poses.add_ids(id);
  for (const float value : poses.values()) sample.poses.add_values(value);
  write();
}

bool RunRecorder::has(Step last_step) const {
  const bool poses = pose_every_ == 0 || posed_ == last_step - last_step % pose_every_;
  return digests_.empty() && next_step_ > last_step && poses_.empty() && poses;
}

void RunRecorder::digest(Step step, const StepDigest& digest) {
  digests_.push_back(digest);
  next_step_ = step + 1;
  write();
}

void RunRecorder::write() {
  std::erase_if(closings_, [&](const auto& closing) {
    if (closing.second > logged_) return false;
    covered_ = std::max(covered_, closing.first);
    return true;
  });
  for (; !digests_.empty(); digests_.pop_front()) {
    const Step step = next_step_ - static_cast<Step>(digests_.size());
    if (step > covered_) break;
    writer_.add_digest(step, digests_.front());
  }
  for (auto first = poses_.begin(); first != poses_.end(); first = poses_.erase(first)) {
    Sample& sample = first->second;
    const bool whole = std::all_of(sample.heard.begin(), sample.heard.end(), [](bool heard) { return heard; }) &&
                       std::all_of(sample.missing.begin(), sample.missing.end(), [](auto n) { return n == 0; });
    if (!whole) break;
    sample.poses.set_step(first->first);
    posed_ = first->first;
    writer_.add_poses(std::move(sample.poses));
  }
  writer_.flush_if_due();
}

void RunRecorder::close(bool complete) { writer_.close(complete); }

}  // namespace soda::cli
