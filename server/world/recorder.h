// Makes reports of what the core computes: digests in batches, whole states of the steps asked for, transforms if
// anybody wants them.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <unordered_map>
#include <utility>

#include "server/border/world_core.h"
#include "server/world/reports.h"

namespace soda::world {

class Recorder final : public border::Observer {
 public:
  using Clock = std::chrono::steady_clock;
  // States of steps dump_first .. dump_last are reported; -1: none.
  // Poses of every pose_every-th step are; 0: none.
  Recorder(std::uint64_t instance, WorldId me, double dt, Step dump_first, Step dump_last, Step pose_every,
           Reports& reports);

  void finalised(Step step, const border::Produced& produced) override;

  // Sends the digests gathered if they are many or old.
  void flush_if_due(Clock::time_point now);
  void flush();

 private:
  void report_state(Step step, const BodySet& produced);
  void report_transforms(Step step, const BodySet& produced);
  void report_poses(Step step, const BodySet& produced);

  const std::uint64_t instance_;
  const WorldId me_;
  const double dt_;
  const Step dump_first_, dump_last_, pose_every_;
  Reports& reports_;
  wire::Digests batch_;
  using Pose7 = std::array<float, 7>;
  std::unordered_map<BodyId, std::pair<Step, Pose7>> posed_;  // what was reported last of each body, and when
  Clock::time_point batch_since_{};
};

}  // namespace soda::world
