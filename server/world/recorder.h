// Makes reports of what has become final: digests in batches, whole states of the steps asked for, poses.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <unordered_map>
#include <utility>

#include "server/border/world_core.h"
#include "server/world/reports.h"
#include "server/world/view_feed.h"

namespace soda::world {

class Recorder final : public border::Observer {
 public:
  using Clock = std::chrono::steady_clock;
  // States of steps dump_first .. dump_last are reported; -1: none.
  // Poses of every pose_every-th step are; 0: none. `feed` hears of final steps, too.
  Recorder(std::uint64_t instance, WorldId me, Step dump_first, Step dump_last, Step pose_every, Reports& reports,
           ViewFeed& feed);

  void finalised(Step step, const border::Produced& produced) override;

  // Sends the digests gathered if they are many or old.
  void flush_if_due(Clock::time_point now);
  void flush();

 private:
  void report_state(Step step, const BodySet& produced);
  void report_poses(Step step, const BodySet& produced);

  const std::uint64_t instance_;
  const WorldId me_;
  const Step dump_first_, dump_last_, pose_every_;
  Reports& reports_;
  ViewFeed& feed_;
  wire::Digests batch_;
  using Pose7 = std::array<float, 7>;
  std::unordered_map<BodyId, std::pair<Step, Pose7>> posed_;  // what was reported last of each body, and when
  Clock::time_point batch_since_{};
};

}  // namespace soda::world
