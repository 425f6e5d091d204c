// The model of a cluster behind `soda-bench scaling` and `resilience`, where its times can be worked out by hand.
#include "bench/cluster.h"

#include <gtest/gtest.h>

#include <memory>

#include "common/scene/scene_builder.h"

namespace soda::bench {
namespace {

constexpr Step kSteps = 6;
constexpr double kEach = 0.25;  // s for a body, a power of two: sums are exact
constexpr WorldId kBodies = 8;  // half of them at either end of the territory, awake, without contacts

Scene two_groups() {
  SceneBuilder builder("two groups");
  builder.scene.gravity = Vec3::Zero();
  builder.scene.sleeping = false;
  builder.scene.territory_cell = 2;
  for (WorldId i = 0; i < kBodies; ++i)
    builder.add(Sphere{0.25}, Vec3(i % 2 ? 15 : -15, 3 * static_cast<double>(i), 0)).angular_velocity = Vec3(0, 0, 1);
  return builder.finish();
}

BodyCosts by_the_body() {
  BodyCosts costs;
  costs.per_body = kEach;
  return costs;
}

class ModelOfACluster : public testing::Test {
 protected:
  // Runs a session until its last step is final everywhere; its duration, s.
  double run(WorldId worlds, border::Sync sync, const Network& network) {
    const Scene scene = two_groups();
    const Grid grid = make_grid(scene);
    std::vector<WorldId> owner(grid.cells(), 0);  // two halves
    for (std::size_t i = 0; i < owner.size(); ++i)
      owner[i] =
          worlds == 1 ? 0 : 2 * static_cast<std::int32_t>(i % static_cast<std::size_t>(grid.size[0])) >= grid.size[0];
    map_ = {grid, worlds, owner};
    cluster_ = std::make_unique<Cluster>(scene, map_, border::CoreSettings{.last_step = kSteps, .sync = sync}, network,
                                         costs_);
    double end = 0;
    computed_ = -1;
    cluster_->worked = [&](WorldId) {
      bool computed = true, final = true;
      for (WorldId w = 0; w < worlds; ++w) {
        computed = computed && cluster_->core(w).clock() == kSteps;
        final = final && cluster_->core(w).final_step() == kSteps;
      }
      if (computed && computed_ < 0) computed_ = cluster_->now();
      if (!final) return;
      end = cluster_->now();
      cluster_->stop();
    };
    for (WorldId w = 0; w < worlds; ++w) cluster_->record(w);
    cluster_->run();
    return end;
  }

  BodyCosts costs_ = by_the_body();
  double computed_ = 0;  // s, when all had done the last step
  TerritoryMap map_;
  std::unique_ptr<Cluster> cluster_;
};

TEST(CostOfAMessage, LiesBetweenWhatIsKnown) {
  const CostBySize cost(std::vector<CostBySize::Known>{{100, 1}, {300, 2}, {400, 4}});
  EXPECT_EQ(cost(100), 1);
  EXPECT_EQ(cost(200), 1.5);
  EXPECT_EQ(cost(300), 2);
  EXPECT_EQ(cost(350), 3);
  EXPECT_EQ(cost(500), 6) << "as between the last two";
  EXPECT_EQ(cost(0), 0.5);
  EXPECT_EQ(CostBySize(3)(1000), 3);
}

TEST_F(ModelOfACluster, AWorldAloneTakesWhatItsWorkTakes) {
  EXPECT_EQ(run(1, border::Sync::kConservative, {}), kSteps * kBodies * kEach);
  EXPECT_EQ(cluster_->usage(0).busy(), kSteps * kBodies * kEach);
}

TEST_F(ModelOfACluster, TwoWorldsTakeHalfOfThatEach) {
  for (const border::Sync sync : {border::Sync::kConservative, border::Sync::kAnticipative}) {
    EXPECT_EQ(run(2, sync, {}), kSteps * kBodies / 2 * kEach);
    for (const WorldId w : {0u, 1u}) EXPECT_EQ(cluster_->usage(w).busy(), kSteps * kBodies / 2 * kEach);
  }
}

// Who waits for each other waits for each step's news; who runs ahead only for the first. What is final goes on by a
// step in each latency in both cases, for it is final when it is so with the neighbours.
TEST_F(ModelOfACluster, LatencyCostsThoseWhoWait) {
  constexpr double kLatency = 8;
  const double work = kSteps * kBodies / 2 * kEach;
  const double conservative = run(2, border::Sync::kConservative, {.latency = kLatency});
  EXPECT_LE(computed_, work + kSteps * kLatency);  // a core shows what it does when it begins with it
  EXPECT_GT(computed_, work + (kSteps - 1) * kLatency);
  EXPECT_GE(conservative, computed_);
  EXPECT_LE(conservative, computed_ + 3 * kLatency);
  EXPECT_EQ(cluster_->core(0).stats().anticipated, 0u);
  const double anticipative = run(2, border::Sync::kAnticipative, {.latency = kLatency});
  EXPECT_GT(cluster_->core(0).stats().anticipated, 0u);
  EXPECT_LE(computed_, work + kLatency);
  EXPECT_GE(anticipative, (kSteps - 1) * kLatency);
  EXPECT_LE(anticipative, conservative);
}

TEST_F(ModelOfACluster, MessagesTakeTheirTimeOfTheProcessorAndOfTheLine) {
  const double plain = run(2, border::Sync::kConservative, {});
  const double slow = run(2, border::Sync::kConservative, {.send = 2.0, .receive = 1.0});
  const std::uint64_t sent = cluster_->core(0).stats().messages_sent;
  ASSERT_GT(sent, 0u);
  // What the other has sent last may not have been taken when the session ends.
  const double network = cluster_->usage(0).seconds[static_cast<std::size_t>(Activity::kNetwork)];
  const auto received = static_cast<double>(cluster_->core(1).stats().messages_sent);
  EXPECT_LE(network, 2 * static_cast<double>(sent) + received);
  EXPECT_GE(network, 2 * static_cast<double>(sent) + received - 2);
  EXPECT_GE(slow, plain + kSteps * (2 + 1));

  const auto bytes = static_cast<double>(cluster_->core(0).stats().bytes_sent);
  EXPECT_GE(run(2, border::Sync::kConservative, {.bytes_per_second = 1}), plain + 0.5 * bytes);
}

TEST_F(ModelOfACluster, ARecordedWorldDoesTheSameAgain) {
  (void)run(2, border::Sync::kAnticipative, {.latency = 1, .send = 0.5});
  BodyCosts again = by_the_body();
  const Cluster::Usage replayed = cluster_->replay(1, cluster_->recorded(1), again);
  const Cluster nobody(two_groups(), map_, {.last_step = kSteps}, {.send = 0.5}, again, false);
  EXPECT_EQ(nobody.replay(1, cluster_->recorded(1), again).seconds, replayed.seconds) << "where there are no others";
  EXPECT_EQ(replayed.pieces, cluster_->usage(1).pieces);
  EXPECT_EQ(replayed.seconds, cluster_->usage(1).seconds);
  EXPECT_GT(replayed.busy(), 0);
}

}  // namespace
}  // namespace soda::bench
