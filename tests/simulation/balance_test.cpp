// Worlds that balance their loads while they run: the protocol core with its balancer, as in a daemon, but in lockstep
// and with made-up costs, so that a run is the same on every machine.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <deque>
#include <memory>
#include <numeric>

#include "common/scene/random.h"
#include "common/scene/scene_builder.h"
#include "server/balance/balancer.h"
#include "tests/simulation/simulated_session.h"

namespace soda::test {
namespace {

// A crowd that walks from one corner of a field to the other among some who stand about.
Scene crowd(std::uint32_t walkers) {
  constexpr double kSeconds = 30;
  SceneBuilder builder("crowd");
  builder.scene.sleeping = false;
  builder.scene.gravity = Vec3::Zero();
  builder.scene.max_speed = 60;
  builder.scene.territory_cell = 2;
  Random random(7);
  const Sphere person{0.25};
  for (const double x : {-32.0, 32.0})
    for (const double y : {-32.0, 32.0}) builder.add(person, Vec3(x, y, 0));
  for (int i = 0; i < 15; ++i)
    for (int j = 0; j < 15; ++j)
      builder.add(person, Vec3(4 * i - 28 + random.between(-1, 1), 4 * j - 28, 0)).angular_velocity = Vec3(0, 0, 1);
  const double radius = 0.7 * std::sqrt(walkers / 3.14);
  for (std::uint32_t i = 0; i < walkers; ++i) {
    const double angle = 2.399963 * i, r = radius * std::sqrt((i + 0.5) / walkers);  // as in a sunflower
    Body& body = builder.add(person, Vec3(-18 + r * std::cos(angle), -18 + r * std::sin(angle), 0.6));
    body.linear_velocity = Vec3(36 / kSeconds, 36 / kSeconds, 0);
  }
  return builder.finish();
}

class Digests : public border::Observer {
 public:
  void finalised(Step, const border::Produced& produced) override {
    steps.push_back({produced.bodies(), produced.hash()});
  }
  std::vector<StepDigest> steps;
};

// Worlds that all take one step after the other; the work of a world at a step is the bodies that it computes.
class Lockstep {
 public:
  Lockstep(const Scene& scene, WorldId worlds, Step steps, bool balance)
      : map_(bisect(scene, make_grid(scene), worlds)), owner_(map_.owner), digests_(worlds), balance_(balance) {
    for (WorldId w = 0; w < worlds; ++w) {
      models_.push_back(std::make_unique<physics::Model>(scene));
      cores_.push_back(std::make_unique<border::WorldCore>(
          *models_[w], map_,
          border::CoreSettings{.me = w, .epoch = 1, .session = 9, .last_step = steps, .balance = balance},
          digests_[w]));
      balancers_.push_back(std::make_unique<balance::Balancer>(*cores_[w], map_.grid, w, scene.dt));
    }
    computed_.resize(worlds);
  }

  void step(Step step, const balance::Pace& pace) {
    for (auto& core : cores_) core->set_limit(step);
    for (bool moved = true; moved;) {
      moved = false;
      for (WorldId w = 0; w < cores_.size(); ++w) {
        border::WorldCore& core = *cores_[w];
        while (core.work() == border::Progress::kWorked) moved = true;
        const std::uint64_t before = std::exchange(computed_[w], core.stats().timeline.bodies_computed);
        balancers_[w]->worked(1e-6 * static_cast<double>(computed_[w] - before));
        if (balance_) balancers_[w]->consider(pace);
        for (border::Outgoing& out : core.take_outgoing()) {
          moved = true;
          ASSERT_TRUE(cores_[out.to]->receive(out.bytes)) << cores_[out.to]->last_refusal();
        }
      }
    }
    note_transfers();
  }

  // Bodies computed so far, by world.
  std::vector<double> work() const { return {computed_.begin(), computed_.end()}; }
  std::vector<StepDigest> steps() const {
    std::vector<StepDigest> sum(digests_[0].steps.size());
    for (const Digests& d : digests_)
      for (std::size_t t = 0; t < sum.size(); ++t) {
        sum[t].bodies += d.steps.at(t).bodies;
        sum[t].hash += d.steps.at(t).hash;
      }
    return sum;
  }
  const border::WorldCore& core(WorldId w) const { return *cores_[w]; }
  const balance::Balancer& balancer(WorldId w) const { return *balancers_[w]; }
  int transfers = 0;

 private:
  // Every transfer leaves all territories in one piece.
  void note_transfers() {
    for (auto& core : cores_) {
      const std::vector<border::Transfer> known = core->take_transfers();
      if (core != cores_.front()) continue;
      for (const border::Transfer& t : known) {
        for (const std::uint32_t cell : t.cells) owner_[cell] = t.taker;
        EXPECT_TRUE(balance::connected(map_.grid, owner_, t.giver)) << "world " << t.giver << ", step " << t.step;
        EXPECT_TRUE(balance::connected(map_.grid, owner_, t.taker)) << "world " << t.taker << ", step " << t.step;
        ++transfers;
      }
    }
  }

  TerritoryMap map_;
  std::vector<WorldId> owner_;
  std::deque<Digests> digests_;
  std::vector<std::unique_ptr<physics::Model>> models_;
  std::vector<std::unique_ptr<border::WorldCore>> cores_;
  std::vector<std::unique_ptr<balance::Balancer>> balancers_;
  std::vector<std::uint64_t> computed_;
  bool balance_;
};

struct Walked {
  double worst = 0;  // of the slowest world's load over the mean, over a quarter of a second, after a second
  int transfers = 0;
  std::vector<StepDigest> steps;
};

Walked walk(const Scene& scene, WorldId worlds, Step steps, bool balance) {
  Walked result;
  Lockstep session(scene, worlds, steps, balance);
  std::vector<double> before = session.work();
  for (Step t = 1; t <= steps; ++t) {
    session.step(t, {});
    if (t % 15 != 0) continue;
    std::vector<double> now = session.work(), load(worlds);
    for (WorldId w = 0; w < worlds; ++w) load[w] = now[w] - before[w];
    before = now;
    const double mean = std::accumulate(load.begin(), load.end(), 0.0) / worlds;
    if (t > 60) result.worst = std::max(result.worst, *std::max_element(load.begin(), load.end()) / mean);
  }
  result.transfers = session.transfers;
  result.steps = session.steps();
  return result;
}

TEST(Balance, FollowsACrowdFromCornerToCorner) {
  const Scene scene = crowd(1200);
  const Step steps = 1800;
  const Walked off = walk(scene, 4, steps, false), on = walk(scene, 4, steps, true);
  std::printf("slowest world's load over the mean: %.2f, without balancing %.2f; %d transfers\n", on.worst, off.worst,
              on.transfers);
  EXPECT_GT(off.worst, 2);
  EXPECT_LT(on.worst, 1.25);
  EXPECT_GT(on.transfers, 10);
  EXPECT_EQ(off.transfers, 0);
  EXPECT_EQ(first_difference(off.steps, on.steps), "");
  EXPECT_EQ(first_difference(run_single(scene, steps), on.steps), "");
}

}  // namespace
}  // namespace soda::test
