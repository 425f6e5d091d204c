// The one invariant, at the layer of the protocol: the same bits on 1 world or on many, whatever the network does.
// A failure names the seed; the same seed repeats the run exactly (--gtest_filter=... with its name). `simulate` runs
// many more.
#include <gtest/gtest.h>

#include <tuple>

#include "common/scene/generators.h"
#include "common/scene/scene_builder.h"
#include "tests/simulation/scenario.h"
#include "tests/simulation/scenes.h"
#include "tests/simulation/simulated_session.h"

namespace soda::test {
namespace {

// Boxes at rest across many cells, each alone.
Scene still_row() {
  SceneBuilder builder("still row");
  builder.add_ground(100);
  for (int i = 0; i < 20; ++i) builder.add(Box{Vec3(0.8, 0.8, 0.8)}, Vec3(-10 + i, 0, 0.4));
  return builder.finish();
}

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const HardScene& scene : hard_scenes()) names.emplace_back(scene.name);
  return names;
}

void expect_equal(const Reference& expected, const SessionResult& got, Step steps) {
  ASSERT_EQ(got.failure, "");
  ASSERT_EQ(got.steps.size(), static_cast<std::size_t>(steps) + 1);
  EXPECT_EQ(first_difference(expected.steps, got.steps), "");
  EXPECT_EQ(got.total.refused, 0u);
  EXPECT_EQ(got.kept, 0) << "what is final is not released: memory grows for ever";
}

using Param = std::tuple<std::string, WorldId, int>;  // scene, worlds, seed
class Equality : public testing::TestWithParam<Param> {};

TEST_P(Equality, SameBitsAsOneWorld) {
  const auto& [name, worlds, seed] = GetParam();
  const Reference& expected = reference(name);
  const HardScene& hard = hard_scene(name);
  const NetworkSettings network = network_of(static_cast<std::uint64_t>(seed));
  // Odd seeds have the territories that a session would have; even seeds cut where it hurts.
  const std::vector<WorldId> owner = seed % 2 ? std::vector<WorldId>() : slabs(expected.scene, worlds);
  const SessionResult got = run_session(expected.scene, worlds, hard.steps, network, owner);
  expect_equal(expected, got, hard.steps);
  // What makes it interesting must have happened.
  if (!owner.empty() && hard.mixes) {
    EXPECT_GT(got.total.frame_bodies_sent, 0u);
    EXPECT_GT(got.total.mixed_islands, 0u);
  }
  if (network.sync == border::Sync::kConservative) {
    EXPECT_EQ(got.total.anticipated, 0u);
    EXPECT_EQ(got.total.timeline.bodies_redone, 0u);
  } else if (!owner.empty() && hard.mixes && network.window > 3 && network.delay > 10) {
    EXPECT_GT(got.total.anticipated, 0u);
    EXPECT_GT(got.total.timeline.bodies_redone, 0u);
  }
  EXPECT_TRUE(network.double_share == 0 || got.total.duplicates > 0);
  EXPECT_TRUE(got.lost == 0 || got.total.messages_resent > 0);
}

std::string param_name(const testing::TestParamInfo<Param>& info) {
  return std::get<0>(info.param) + "_" + std::to_string(std::get<1>(info.param)) + "worlds_seed" +
         std::to_string(std::get<2>(info.param));
}

INSTANTIATE_TEST_SUITE_P(Sample, Equality,
                         testing::Combine(testing::ValuesIn(scene_names()), testing::Values(2u, 5u),
                                          testing::Values(1, 2)),
                         param_name);

// It has nobody to tell anything; once its memory grew for ever for that reason.
TEST(OneWorld, GivesTheHashesOfTheStepAlone) {
  const SessionResult got = run_session(reference("cubes").scene, 1, hard_scene("cubes").steps, {});
  expect_equal(reference("cubes"), got, hard_scene("cubes").steps);
}

// Territories in any shape, not even connected: every body is near somebody else's.
class AnyTerritories : public testing::TestWithParam<std::tuple<std::string, int>> {};

TEST_P(AnyTerritories, SameBitsAsOneWorld) {
  const auto& [name, seed] = GetParam();
  const Reference& expected = reference(name);
  const HardScene& hard = hard_scene(name);
  const WorldId worlds = 2 + static_cast<WorldId>(seed % 5);
  const std::vector<WorldId> owner = confetti(expected.scene, worlds, static_cast<std::uint64_t>(seed));
  const SessionResult got =
      run_session(expected.scene, worlds, hard.steps, network_of(static_cast<std::uint64_t>(seed)), owner);
  expect_equal(expected, got, hard.steps);
  EXPECT_GT(got.total.mixed_islands, 0u);
  EXPECT_GT(got.total.arrived, 0u);
}

std::string any_name(const testing::TestParamInfo<std::tuple<std::string, int>>& info) {
  return std::get<0>(info.param) + "_seed" + std::to_string(std::get<1>(info.param));
}

const auto kAnyScenes = testing::Values("cubes", "city", "cluster", "wide_bodies", "fast_bodies", "corner");
INSTANTIATE_TEST_SUITE_P(Sample, AnyTerritories, testing::Combine(kAnyScenes, testing::Range(2, 4)), any_name);

// Cells change hands at random steps, with whatever is in them: asleep, in flight, in islands of several worlds.
class Transfers : public testing::TestWithParam<std::string> {};

TEST_P(Transfers, SameBitsAsOneWorld) {
  const Reference& expected = reference(GetParam());
  const HardScene& hard = hard_scene(GetParam());
  std::uint64_t handed_over = 0;
  for (const std::uint64_t seed : {21, 22, 23, 24}) {
    const WorldId worlds = 2 + static_cast<WorldId>(seed % 4);
    const std::vector<WorldId> owner = seed % 2 ? std::vector<WorldId>() : slabs(expected.scene, worlds);
    const auto transfers = random_transfers(expected.scene, worlds, owner, hard.steps, seed);
    ASSERT_FALSE(transfers.empty());
    const SessionResult got = run_session(expected.scene, worlds, hard.steps, network_of(seed), owner, {}, transfers);
    expect_equal(expected, got, hard.steps);
    handed_over += got.total.timeline.handed_over;
  }
  EXPECT_GT(handed_over, 0u);
}

INSTANTIATE_TEST_SUITE_P(Sample, Transfers, testing::ValuesIn(scene_names()),
                         [](const auto& one) { return one.param; });

// Cells that worlds agree upon while they run: nobody knows of any transfer at the start.
class Given : public testing::TestWithParam<std::string> {};

TEST_P(Given, SameBitsAsOneWorld) {
  const Reference& expected = reference(GetParam());
  const HardScene& hard = hard_scene(GetParam());
  std::uint64_t handed_over = 0, transfers = 0;
  for (const std::uint64_t seed : {31, 32, 33, 34}) {
    const WorldId worlds = 2 + static_cast<WorldId>(seed % 4);
    NetworkSettings network = network_of(seed);
    network.give_share = seed % 2 ? 0.003 : 0.1;
    const std::vector<WorldId> owner = seed % 2 ? std::vector<WorldId>() : slabs(expected.scene, worlds);
    const SessionResult got = run_session(expected.scene, worlds, hard.steps, network, owner);
    expect_equal(expected, got, hard.steps);
    handed_over += got.total.timeline.handed_over;
    transfers += got.total.transfers;
  }
  EXPECT_GT(handed_over, 0u);
  EXPECT_GT(transfers, 3u);
}

INSTANTIATE_TEST_SUITE_P(Sample, Given, testing::ValuesIn(scene_names()), [](const auto& one) { return one.param; });

// Worlds that balance their loads by themselves.
TEST(Given, ByTheBalancer) {
  std::uint64_t transfers = 0, handed_over = 0, sessions = 0;
  for (const char* const name : {"corner", "sleeping_chain", "fast_bodies"}) {  // light: `simulate` does all
    const Reference& expected = reference(name);
    const Step steps = hard_scene(name).steps;
    for (const std::uint64_t seed : {41, 42}) {
      NetworkSettings network = network_of(seed);
      network.budget = seed % 2 ? -1 : 1e-6 * static_cast<double>(expected.scene.bodies.size()) / 4;
      const SessionResult got = run_session(expected.scene, 4, steps, network, slabs(expected.scene, 4));
      expect_equal(expected, got, steps);
      transfers += got.total.transfers;
      handed_over += got.total.timeline.handed_over;
      ++sessions;
    }
  }
  EXPECT_GT(transfers, sessions);
  EXPECT_GT(handed_over, 0u);
}

// News of a transfer must have gone all the way along a row of worlds before anybody there computes its step, the one
// furthest ahead, too. (Once a world eight neighbours away was ahead of them, and refused them for ever.)
TEST(Given, AlongRowsOfWorlds) {
  std::uint64_t transfers = 0, rows = 0;
  for (const std::string& name : scene_names()) {
    const Reference& expected = reference(name);
    const std::vector<WorldId> owner = slabs(expected.scene, 10);
    if (owner.empty()) continue;
    ++rows;
    for (const Step window : {1, 2, 8}) {
      NetworkSettings network;
      network.seed = static_cast<std::uint64_t>(window);
      network.window = window;
      network.lead = 200;
      network.stall_share = 0.9;
      network.give_share = 0.02;
      const Step steps = std::min<Step>(hard_scene(name).steps, 60);
      const SessionResult got = run_session(expected.scene, 10, steps, network, owner);
      ASSERT_EQ(got.failure, "") << name;
      EXPECT_EQ(got.total.refused, 0u);
      const auto begin = expected.steps.begin();
      EXPECT_EQ(first_difference({begin, begin + steps + 1}, got.steps), "") << name;
      transfers += got.total.transfers;
    }
  }
  EXPECT_GT(rows, 0u);
  EXPECT_GT(transfers, 20u);
}

// A step is told when all that others hear of is done. What nobody could hear of may come so far in one step that
// somebody does: then that is corrected.
TEST(Pieces, WhatIsToldTooEarlyIsCorrected) {
  SceneBuilder builder("bullets");
  builder.scene.gravity = Vec3::Zero();
  builder.scene.max_speed = 120;  // cells of 2 m
  for (int i = 0; i < 24; ++i) {
    builder.add(Sphere{0.1}, Vec3(-40 + 1.7 * i, i % 6, 0)).linear_velocity = Vec3(50, 0, 0);
    builder.add(Box{Vec3(0.2, 0.2, 0.2)}, Vec3(3 + i % 4, i % 6, 0));
    builder.add(Box{Vec3(0.2, 0.2, 0.2)}, Vec3(-38 + i, 8, 0)).linear_velocity = Vec3(0, 0.1, 0);
  }
  const Scene scene = builder.finish();
  constexpr Step kSteps = 60;
  const std::vector<StepDigest> expected = run_single(scene, kSteps);
  const std::vector<WorldId> owner = slabs(scene, 2);
  ASSERT_FALSE(owner.empty());
  const auto run = [&](border::Sync sync, std::uint64_t seed, std::size_t piece_bodies) {
    NetworkSettings network;
    network.sync = sync;
    network.seed = seed;
    network.delay = 1;
    network.piece_bodies = piece_bodies;
    const SessionResult got = run_session(scene, 2, kSteps, network, owner);
    EXPECT_EQ(got.failure, "");
    EXPECT_EQ(first_difference(expected, got.steps), "") << "seed " << seed << ", pieces of " << piece_bodies;
    EXPECT_GT(got.total.arrived, 10u);
    return got.total;
  };
  std::uint64_t corrected = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const border::CoreStats pieces = run(border::Sync::kAnticipative, seed, 4);
    EXPECT_GT(pieces.told_early, 20u);
    corrected += pieces.frames_corrected;
    const border::CoreStats whole = run(border::Sync::kAnticipative, seed, 1000);
    EXPECT_EQ(whole.told_early, 0u);
    EXPECT_EQ(whole.frames_corrected, 0u);
    const border::CoreStats conservative = run(border::Sync::kConservative, seed, 4);
    EXPECT_EQ(conservative.told_early, 0u) << "nothing is assumed in this mode";
    EXPECT_EQ(conservative.frames_corrected, 0u);
  }
  EXPECT_GT(corrected, 8u);
}

TEST(WideBodies, AreToldToEveryWorldTheyReach) {
  const Reference& expected = reference("wide_bodies");
  const SessionResult got = run_session(expected.scene, 8, 150, {});
  expect_equal(expected, got, 150);
  EXPECT_GT(got.total.wide_bodies, 0u);
  EXPECT_GT(got.total.parts_passed, 0u);
  EXPECT_GT(got.total.parts_left, 0u);
}

// A part came from others, with word that it is final, and then from its origin itself. (Once that word was forgotten
// then, and not passed on to a third world, which stood still. One seed of ten thousand met that. Since each part is
// passed on by one world only, this seed does not meet it any more, nor did any of 1,500 others without the mend.)
TEST(WideBodies, APartOnceFinalStaysSo) {
  Scenario scenario = scenario_of(6049);
  scenario.network.budget = 0;  // as it was then
  EXPECT_EQ(scenario.scene, "wide_bodies") << "seeds mean something else now: without the mend, which one fails?";
  EXPECT_EQ(run_scenario(scenario).failure, "");
}

// Word that a part is final was lost on its way from a neighbour that is not behind itself. (Once only those who were
// behind were asked again, and all stood still for ever.)
TEST(LostMessages, AreAskedForOfAllNeighbours) {
  Scenario scenario = scenario_of(10455);
  scenario.network.budget = 0;  // as it was then
  EXPECT_EQ(scenario.scene, "sleeping_chain") << "seeds mean something else now: without the mend, which one fails?";
  const SessionResult got = run_scenario(scenario);
  EXPECT_EQ(got.failure, "");
  EXPECT_GT(got.lost, 0u);
}

TEST(Sleep, NothingIsSentForWhatSleeps) {
  const Scene scene = still_row();
  const SessionResult slept = run_session(scene, 4, 400, {});
  ASSERT_EQ(slept.failure, "");
  const SessionResult half = run_session(scene, 4, 200, {});
  ASSERT_EQ(half.failure, "");
  EXPECT_GT(half.total.frames_sent, 0u);
  EXPECT_EQ(slept.total.frames_sent, half.total.frames_sent) << "frames were sent for sleeping bodies";
}

// What rests on a body that is taken away, or put elsewhere, must fall, though nothing else tells it to wake.
TEST(Actions, WhatRestedOnABodyFallsWhenItIsGone) {
  SceneBuilder builder("sleeping stacks");
  builder.add_ground(100);
  for (int x = 0; x < 6; ++x)
    for (int z = 0; z < 3; ++z) builder.add(Box{Vec3(0.8, 0.8, 0.8)}, Vec3(2.0 * x, 0, 0.4 + 0.8 * z));
  const Scene scene = builder.finish();
  constexpr Step kSteps = 220, kWhen = 150;
  const Actions log = {{1, kWhen, Remove{1}}, {2, kWhen, SetPose{10, Vec3(-20, 3, 5)}}};
  const auto expected = run_single(scene, kSteps, log);
  EXPECT_EQ(expected[kWhen - 2], expected[kWhen - 1]) << "they do not sleep";
  for (Step t = kWhen; t < kWhen + 20; ++t) EXPECT_NE(expected[t].hash, expected[t + 1].hash) << "step " << t;
  EXPECT_EQ(expected[kWhen].bodies, 18u);
  EXPECT_EQ(expected[kWhen + 1].bodies, 17u);
  for (const border::Sync sync : {border::Sync::kAnticipative, border::Sync::kConservative}) {
    NetworkSettings network;
    network.sync = sync;
    const SessionResult got = run_session(scene, 4, kSteps, network, {}, log);
    ASSERT_EQ(got.failure, "");
    EXPECT_EQ(first_difference(expected, got.steps), "");
    EXPECT_EQ(got.total.actions, 8u);
  }
}

// Some of what `simulate` does by the hundred, small ones, so that sanitizers see them, too.
TEST(Actions, OfAllKindsInSomeSessions) {
  int sessions = 0;
  std::uint64_t done = 0, redone = 0;
  for (std::uint64_t seed = 1; sessions < 8; ++seed) {
    const Scenario scenario = scenario_of(seed);
    if (scenario.actions.size() < 5 || scenario.network.sync == border::Sync::kConservative ||
        (scenario.scene != "cubes" && scenario.scene != "sleeping_chain" && scenario.scene != "corner"))
      continue;
    ++sessions;
    const SessionResult got = run_scenario(scenario);
    EXPECT_EQ(got.failure, "") << "seed " << seed << ": " << scenario.text();
    done += got.total.actions;
    redone += got.total.timeline.bodies_redone;
  }
  EXPECT_GT(done, 8u * 2 * 5 / 2);
  EXPECT_GT(redone, 0u);
}

// A body is handed over while its old owner is ahead, and falls asleep close by: for a while the old owner has records
// of its own and those it is told. (Once it then looked for the body where its own had been, and the session stood
// still.)
TEST(Handover, WhatFallsAsleepAfterItIsFound) {
  Scene scene = generate("piles", 2700, 1);
  scene.territory_cell = 10.3;  // borders go through piles
  constexpr Step kSteps = 260;
  NetworkSettings network;
  network.delay = 3;
  network.touch_share = 0.05;
  const SessionResult got = run_session(scene, 8, kSteps, network);
  ASSERT_EQ(got.failure, "");
  EXPECT_EQ(first_difference(run_single(scene, kSteps), got.steps), "");
  EXPECT_GT(got.total.anticipated, 0u);
  EXPECT_GT(got.total.departed, 0u);
}

TEST(MoreWorldsThanBodies, AreIdleButAgree) {
  const Reference& expected = reference("corner");
  const SessionResult got = run_session(expected.scene, 48, 60, {});
  ASSERT_EQ(got.failure, "");
  ASSERT_EQ(got.steps.size(), 61u);
  for (std::size_t t = 0; t <= 60; ++t) ASSERT_EQ(got.steps[t], expected.steps[t]) << "step " << t;
}

}  // namespace
}  // namespace soda::test
