#include "client/viewer/replay_source.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <variant>

namespace soda::viewer {
namespace {

constexpr double kFastest = 100;  // multiple of real time; "as fast as possible" makes no sense here

}  // namespace

ReplaySource::ReplaySource(const std::filesystem::path& path) : name_(path.filename().string()) {
  const Recording recording = load_recording(path, true);
  if (recording.poses.empty())
    throw RecordingError(path.string() + ": it has no poses to show (recorded with --record-poses 0?)");
  model_ = std::make_unique<SceneModel>(recording.scene, 0);
  dt_ = recording.scene.dt;
  cut_ = recording.cut;
  fill(recording);
}

// As a world would have told it: what moves from step to step. Steps between two samples are those of the earlier one.
void ReplaySource::fill(const Recording& recording) {
  std::map<Step, std::vector<BodyId>> removed;
  for (const LoggedAction& logged : recording.actions) {
    if (const auto* spawn = std::get_if<Spawn>(&logged.action))
      model_->add(spawn->body->bodies.front().id, *spawn->body);
    // Still there at the step of the action (docs/actions.md).
    if (const auto* remove = std::get_if<Remove>(&logged.action)) removed[logged.step + 1].push_back(remove->body);
  }
  first_ = recording.poses.front().step();
  last_ = recording.poses.back().step();
  auto poses = recording.poses.begin();
  std::uint64_t number = 0;
  for (Step step = first_; step <= last_; ++step) {
    wire::Transforms sample;
    sample.number(++number);
    sample.kind(step == first_ ? wire::VIEW_WHOLE : wire::VIEW_STEP);
    sample.step(step);
    sample.front(step);
    sample.final_step(step);
    for (; poses != recording.poses.end() && poses->step() == step; ++poses)
      for (int i = 0; i < poses->ids_size(); ++i) {
        if (!model_->has(poses->ids(i))) continue;
        sample.ids().push_back(poses->ids(i));
        const float* const values = poses->values().data() + std::ptrdiff_t{7} * i;
        sample.positions().insert(sample.positions().end(), values, values + 3);
        sample.orientations().insert(sample.orientations().end(), values + 3, values + 7);
      }
    sample.velocities().resize(6 * sample.ids().size());
    sample.flags().resize(sample.ids().size());
    if (const auto gone = removed.find(step); gone != removed.end())
      std::copy_if(gone->second.begin(), gone->second.end(), std::back_inserter(sample.gone()),
                   [&](BodyId id) { return model_->has(id); });
    buffer_.add(sample);
  }
  at_ = static_cast<double>(first_);
}

News ReplaySource::poll() {
  const auto now = Clock::now();
  const double passed = std::chrono::duration<double>(now - std::exchange(then_, now)).count();
  if (!paused_ && seen_) at_ = std::min(at_ + passed * speed_ / dt_, static_cast<double>(last_));
  News news;
  news.answers = std::exchange(answers_, {});
  return news;
}

Step ReplaySource::displayed() const { return static_cast<Step>(std::floor(at_)); }

view::Welcome ReplaySource::welcome() const {
  seen_ = true;
  view::Welcome welcome;
  model_->fill(welcome);
  welcome.set_session(name_);
  welcome.set_replay(true);
  welcome.set_worlds(1);
  welcome.set_last_step(last_);
  return welcome;
}

view::BodyList ReplaySource::bodies(std::uint32_t first, std::uint32_t& meshes) const {
  view::BodyList list;
  list.set_first(first);
  for (; meshes < model_->meshes(); ++meshes) model_->add_mesh(meshes, *list.add_meshes());
  for (std::uint32_t i = first; i < listed(); ++i) model_->list(buffer_.bodies().id(i), list);
  return list;
}

view::Clocks ReplaySource::clocks() const {
  view::Clocks clocks;
  clocks.set_displayed(displayed());
  clocks.set_pace(speed_);
  clocks.set_paused(paused_ || displayed() == last_);
  clocks.set_speed(paused_ || displayed() == last_ ? 0 : speed_);
  clocks.set_oldest(first_);
  clocks.set_newest(last_);
  clocks.set_final(last_);
  return clocks;
}

std::uint64_t ReplaySource::ask(const view::Do& wanted) {
  const auto seek = [&](double step) {
    at_ = std::clamp(step, static_cast<double>(first_), static_cast<double>(last_));
  };
  view::Answer answer;
  answer.set_accepted(true);
  switch (wanted.what_case()) {
    case view::Do::kPause:
      paused_ = true;
      break;
    case view::Do::kResume:
      paused_ = false;
      if (displayed() == last_) seek(static_cast<double>(first_));  // from the start again
      break;
    case view::Do::kSteps:
      seek(std::floor(at_) + static_cast<double>(wanted.steps()));
      break;
    case view::Do::kSpeed:
      speed_ = wanted.speed() > 0 ? std::min(wanted.speed(), kFastest) : kFastest;
      break;
    case view::Do::kSeek:
      seek(static_cast<double>(wanted.seek()));
      break;
    default:
      answer.set_accepted(false);
      answer.set_reason("this is a recording: nothing can be done to its bodies");
  }
  answer.set_step(displayed());
  answers_.emplace_back(++asked_, answer);
  return asked_;
}

}  // namespace soda::viewer
