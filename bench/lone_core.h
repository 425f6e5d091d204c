// A world of a session as benchmarks drive it: the protocol core alone, without daemon or network.
#pragma once

#include "bench/harness.h"
#include "common/territory.h"
#include "server/border/world_core.h"
#include "server/physics/model.h"

namespace soda::bench {

constexpr Step kWindow = 48;  // the default of `soda run --anticipation`

inline std::uint64_t bodies_redone(const border::WorldCore& core) { return core.stats().timeline.bodies_redone; }
inline std::uint64_t bodies_computed(const border::WorldCore& core) { return core.stats().timeline.bodies_computed; }

// The only world of its session, or one of those of a session whose messages the benchmark carries.
class LoneCore {
 public:
  LoneCore(const Scene& scene, const TerritoryMap& map, const border::CoreSettings& settings,
           border::Observer* observer = nullptr)
      : model_(scene), map_(map), core_(model_, map_, settings, observer ? *observer : ignores_) {}
  LoneCore(const Scene& scene, Step last_step)
      : LoneCore(scene, bisect(scene, make_grid(scene), 1), {.last_step = last_step, .actions = true}) {}
  LoneCore(const LoneCore&) = delete;
  LoneCore& operator=(const LoneCore&) = delete;

  border::WorldCore& operator*() { return core_; }
  border::WorldCore* operator->() { return &core_; }

  // All that can be done now, with the releasing of what has become final. CPU seconds.
  double work() {
    const double start = cpu_seconds();
    while (core_.work() == border::Progress::kWorked) {
    }
    (void)core_.take_outgoing();
    return cpu_seconds() - start;
  }
  double act(const LoggedAction& action) {  // and what follows from it
    const double start = cpu_seconds();
    core_.act(action);
    return cpu_seconds() - start + work();
  }

 private:
  border::Observer ignores_;
  physics::Model model_;
  TerritoryMap map_;
  border::WorldCore core_;
};

}  // namespace soda::bench
