// A scene on so many worlds of the model of a cluster, each run in a process of its own, and what it says.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "bench/cluster.h"
#include "common/scene/scene.h"

namespace soda::bench {

struct Mode {
  const char* name;
  border::Sync sync;
  bool barrier;  // nobody begins a step before everybody has done the one before
};
inline constexpr Mode kAnticipative{"anticipative", border::Sync::kAnticipative, false},
    kConservative{"conservative", border::Sync::kConservative, false},
    kBarrier{"barrier", border::Sync::kConservative, true};
inline constexpr Mode kModes[] = {kAnticipative, kConservative, kBarrier};

// What a run of the model says; times are s per step and world.
struct Outcome {
  double step = 0;                         // from one step to the next
  std::array<double, kActivities> mean{};  // by Activity
  double busy_mean = 0, busy_max = 0;
  double pieces = 0;  // of work, per step and world
  double bodies_max_over_mean = 0;
  double messages = 0, bytes = 0;  // per step and world
  double mixed_islands = 0;        // per step, in all
  double redone = 0;               // share of all results
  double alone = 1;                // a world's work without the others in its caches, over with them
};

class Experiment {
 public:
  // `scene` and `yardstick` must outlive it.
  Experiment(const Scene& scene, WorldId worlds, Step steps, Yardstick& yardstick)
      : scene_(scene), worlds_(worlds), steps_(steps), yardstick_(yardstick) {}

  // A session. Throws std::runtime_error where it, or its process, fails.
  Outcome run(const Mode& mode, const Network& network);
  // The least busy of some: others on the machine only add to what is measured.
  Outcome best(const Mode& mode, const Network& network, int rounds);
  // The next run measures anew what a world's work costs alone.
  void forget() { factors_[0].reset(), factors_[1].reset(); }

 private:
  using Factors = std::array<double, kActivities>;
  Factors factors(const Mode& mode, const Network& network);
  std::size_t heap(WorldId worlds) const;

  const Scene& scene_;
  const WorldId worlds_;
  const Step steps_;
  Yardstick& yardstick_;
  std::optional<Factors> factors_[2];
};

}  // namespace soda::bench
