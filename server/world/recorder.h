// Makes reports of what the core computes: digests in batches, whole states of the steps asked for, transforms if
// anybody wants them.
#pragma once

#include <chrono>
#include <cstdint>

#include "server/border/world_core.h"
#include "server/world/reports.h"

namespace soda::world {

class Recorder final : public border::Observer {
 public:
  using Clock = std::chrono::steady_clock;
  // States of steps dump_first .. dump_last are reported; -1: none.
  Recorder(std::uint64_t instance, WorldId me, double dt, Step dump_first, Step dump_last, Reports& reports);

  void finalised(Step step, const border::Produced& produced) override;

  // Sends the digests gathered if they are many or old.
  void flush_if_due(Clock::time_point now);
  void flush();

 private:
  void report_state(Step step, const BodySet& produced);
  void report_transforms(Step step, const BodySet& produced);

  const std::uint64_t instance_;
  const WorldId me_;
  const double dt_;
  const Step dump_first_, dump_last_;
  Reports& reports_;
  wire::Digests batch_;
  Clock::time_point batch_since_{};
};

}  // namespace soda::world
