#include "client/export/tracks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <unordered_map>
#include <utility>

#include "common/overloaded.h"
#include "common/scene/tessellation.h"

namespace soda::gltf {
namespace {

constexpr Step kEver = std::numeric_limits<Step>::max();

TrackPose rounded(const Pose& pose) {
  TrackPose result;
  for (int i = 0; i < 3; ++i) result.position[i] = static_cast<float>(pose.position[i]);
  for (int i = 0; i < 4; ++i) result.orientation[i] = static_cast<float>(pose.orientation.coeffs()[i]);
  return result;
}

class Builder {
 public:
  Builder(Recording& recording, const std::string& name, const Range& range)
      : recording_(recording), name_(name), samples_(chosen(range)) {
    add_bodies();
  }

  Tracks build(const Progress& progress) {
    const auto total = static_cast<std::size_t>(
        std::upper_bound(recording_.poses.begin(), recording_.poses.end(), samples_.back(),
                         [](Step step, const pb::RecordedPoses& poses) { return step < poses.step(); }) -
        recording_.poses.begin());
    auto next_chosen = samples_.begin();
    for (std::size_t i = 0; i < total; ++i) {
      const pb::RecordedPoses poses = std::exchange(recording_.poses[i], {});  // its memory goes when it has been read
      const Step step = poses.step();
      do_moves(step);
      tell(poses);
      if (step == *next_chosen) {
        settle(step);
        ++next_chosen;
      }
      if (progress) progress(i + 1, total);
    }
    return finished();
  }

 private:
  struct Life {  // of a body
    Track track;
    Step appears = 0, vanishes = kEver;  // there at steps in [appears, vanishes)
    TrackPose latest;                    // as last told
    TrackPose keyed;                     // at the last key, or the start
    Step last_key = -1;
    bool told = false;  // it is in told_
  };
  struct Move {  // by a user, at once
    Step step;   // of the action; it is elsewhere one step later
    std::size_t body;
    TrackPose to;
  };

  [[noreturn]] void refuse(const std::string& reason) const { throw RecordingError(name_ + ": " + reason); }

  // The samples that are to be in the tracks.
  std::vector<Step> chosen(const Range& range) {
    if (range.from < 0 || range.every < 1 || (range.to && *range.to < range.from))
      throw std::invalid_argument("--from, --to, --every: must be 0 <= from <= to and every > 0");
    const auto& poses = recording_.poses;
    for (std::size_t i = 0; i < poses.size(); ++i)
      if (poses[i].step() < 0 || (i > 0 && poses[i].step() <= poses[i - 1].step())) refuse("poses are not in order");
    // What was done to bodies is known up to the last digest only.
    const Step end = static_cast<Step>(recording_.digests.size()) - 1;
    std::vector<Step> all;
    for (const pb::RecordedPoses& sample : poses)
      if (sample.step() <= end) all.push_back(sample.step());
    if (all.empty()) refuse("has no poses to show (was it recorded with --record-poses 0?)");
    if (range.from > end)
      throw std::invalid_argument("--from: step " + std::to_string(range.from) + " is after the end of " + name_ +
                                  ", which is step " + std::to_string(end));
    auto first = std::upper_bound(all.begin(), all.end(), range.from);
    if (first != all.begin()) --first;
    const Step to = range.to.value_or(end);
    if (to - *first > std::numeric_limits<std::uint32_t>::max()) refuse("is too long: use --from and --to");
    std::vector<Step> result{*first};
    for (auto sample = first; sample != all.end() && *sample <= to; ++sample) {
      const bool is_last = sample + 1 == all.end() || *(sample + 1) > to;  // shows where it all ends: never left out
      if (*sample - result.back() >= (is_last ? 1 : range.every)) result.push_back(*sample);
    }
    return result;
  }

  void add_body(const Scene& scene, const Body& body, Step appears) {
    if (!index_.emplace(body.id, lives_.size()).second) refuse("spawns body " + std::to_string(body.id) + " again");
    Life& life = lives_.emplace_back();
    life.track.scene = &scene;
    life.track.body = &body;
    life.appears = appears;
    life.latest = life.keyed = rounded(display_pose(body));
  }

  // With all that is known from the log of when they are there and where they are put.
  void add_bodies() {
    for (const Body& body : recording_.scene.bodies) add_body(recording_.scene, body, 0);
    for (const LoggedAction& entry : recording_.actions)
      std::visit(Overloaded{[&](const Spawn& a) { add_body(*a.body, a.body->bodies.front(), entry.step); },
                            [&](const Remove& a) {
                              Life& life = lives_[index_of(a.body)];
                              life.vanishes = std::min(life.vanishes, entry.step + 1);
                            },
                            [&](const SetPose& a) {
                              moves_.push_back({entry.step, index_of(a.body), rounded({a.position, a.orientation})});
                            },
                            [](const auto&) {}},
                 entry.action);
    std::stable_sort(moves_.begin(), moves_.end(), [](const Move& l, const Move& r) { return l.step < r.step; });
  }

  std::size_t index_of(BodyId id) const {
    const auto at = index_.find(id);
    if (at == index_.end() || lives_[at->second].track.body->is_static)
      refuse("tells of body " + std::to_string(id) + ", which is not a dynamic one of its scene or spawned");
    return at->second;
  }

  // What was put elsewhere by `step`: without these keys it would glide there.
  void do_moves(Step step) {
    for (; next_move_ < moves_.size() && moves_[next_move_].step < step; ++next_move_) {
      const Move& move = moves_[next_move_];
      Life& life = lives_[move.body];
      if (move.step < life.appears || move.step + 1 >= life.vanishes) continue;
      if (move.step >= samples_.front()) {
        add_key(life, move.step, life.latest, settled_);
        add_key(life, move.step + 1, move.to, move.step);
      }
      life.latest = move.to;
    }
  }

  void tell(const pb::RecordedPoses& poses) {
    check_poses(poses, name_);
    for (int i = 0; i < poses.ids_size(); ++i) {
      const std::size_t body = index_of(poses.ids(i));
      Life& life = lives_[body];
      if (poses.step() < life.appears || poses.step() >= life.vanishes)
        refuse("poses at step " + std::to_string(poses.step()) + ": body " + std::to_string(poses.ids(i)) +
               " is not there then");
      const float* const values = poses.values().data() + 7 * i;
      std::copy_n(values, 3, life.latest.position.begin());
      std::copy_n(values + 3, 4, life.latest.orientation.begin());
      if (!std::exchange(life.told, true)) told_.push_back(body);
    }
  }

  // At a sample that was chosen: bodies are where they were told to be.
  void settle(Step step) {
    if (step == samples_.front())
      for (Life& life : lives_) life.track.start = life.keyed = life.latest;
    for (const std::size_t body : told_) {
      Life& life = lives_[body];
      life.told = false;
      if (step == life.appears)
        life.track.start = life.keyed = life.latest;
      else if (step != samples_.front())
        add_key(life, step, life.latest, settled_);
    }
    told_.clear();
    settled_ = step;
  }

  // Where the body is at `step`; up to `rested` nothing had changed since its last key.
  void add_key(Life& life, Step step, TrackPose pose, Step rested) {
    float along = 0;
    for (int i = 0; i < 4; ++i) along += pose.orientation[i] * life.keyed.orientation[i];
    if (along < 0)
      for (float& v : pose.orientation) v = -v;
    if (pose == life.keyed) return;
    rested = std::max({rested, samples_.front(), life.appears});
    if (rested > life.last_key && rested < step) push(life, rested, life.keyed);
    push(life, step, pose);
    life.keyed = pose;
  }
  void push(Life& life, Step step, const TrackPose& pose) {
    if (life.last_key == step) {  // what was told of this step is newer than what the log says
      life.track.positions.back() = pose.position;
      life.track.orientations.back() = pose.orientation;
      return;
    }
    life.last_key = step;
    life.track.steps.push_back(static_cast<std::uint32_t>(step - samples_.front()));
    life.track.positions.push_back(pose.position);
    life.track.orientations.push_back(pose.orientation);
  }

  Tracks finished() {
    Tracks tracks;
    const Step first = samples_.front(), last = samples_.back();
    tracks.first = first;
    for (const Step step : samples_) tracks.samples.push_back(static_cast<std::uint32_t>(step - first));
    for (Life& life : lives_) {
      if (life.appears > last || life.vanishes <= first) continue;
      if (life.appears > first) life.track.appears = static_cast<std::uint32_t>(life.appears - first);
      if (life.vanishes <= last) life.track.vanishes = static_cast<std::uint32_t>(life.vanishes - first);
      tracks.bodies.push_back(std::move(life.track));
    }
    return tracks;
  }

  Recording& recording_;
  const std::string& name_;
  std::vector<Step> samples_;  // chosen
  std::vector<Life> lives_;
  std::unordered_map<BodyId, std::size_t> index_;  // into lives_
  std::vector<Move> moves_;                        // ascending by step
  std::size_t next_move_ = 0;
  std::vector<std::size_t> told_;  // bodies told of since the last sample that was chosen
  Step settled_ = -1;              // that sample's step
};

}  // namespace

Tracks tracks_of(Recording& recording, const std::string& name, const Range& range, const Progress& progress) {
  return Builder(recording, name, range).build(progress);
}

}  // namespace soda::gltf
