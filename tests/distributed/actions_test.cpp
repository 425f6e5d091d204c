// Users at work on a running session, over DDS: what they do is answered, changes the future, and is the same on any
// number of worlds when it is done again from a recording.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>
#include <fstream>
#include <memory>
#include <thread>

#include "tests/distributed/live_session.h"

namespace soda::test {
namespace {

using Acting = LiveSession;

TEST_F(Acting, WhatIsDoneLiveIsDoneAgainFromTheRecording) {
  const std::string file = scene("city", 400);
  auto running = start(file, 3, 1500, {"--record", path("run.rec")});
  expect_says(ask({"act", "push", "17", "--impulse", "0", "0", "4000", "--point", "0.1", "0", "0"}),
              "action 1, at step");
  expect_says(ask({"act", "spawn", "--sphere", "0.3", "--at", "0", "0", "6"}), "body 402");  // 401 is the ground
  expect_says(ask({"act", "pose", "20", "--position", "1", "2", "7"}), "action 3");
  expect_says(ask({"act", "velocity", "402", "--linear", "5", "0", "3"}), "action 4");
  expect_says(ask({"act", "grab", "40", "--target", "0", "0", "5"}), "action 5");
  expect_says(ask({"act", "remove", "30"}), "action 6");
  expect_says(ask({"act", "move", "5", "--target", "4", "0", "5"}), "action 7");
  expect_says(ask({"act", "release", "5"}), "action 8");
  // Refused with the reason, and nothing else happens.
  expect_says(ask({"act", "push", "99999", "--impulse", "1", "0", "0"}, 1), "refused: there is no body 99999");
  expect_says(ask({"act", "push", "30", "--impulse", "1", "0", "0"}, 1), "refused: body 30 is removed at step");
  expect_says(ask({"act", "spawn", "--sphere", "-1", "--at", "0", "0", "6"}, 1), "spawn.body.shape[0].sphere.radius");
  expect_says(ask({"act", "velocity", "1", "--linear", "1e9", "0", "0"}, 1), "the scene's largest speed");
  ask({"speed", "max"});
  expect_exit(*running, 0);
  EXPECT_EQ(stat(path("stats"), "actions"), 8);
  // They came for steps that had been computed: the future was changed.
  EXPECT_GT(stat(path("stats"), "rollbacks"), 0);
  EXPECT_GT(stat(path("stats"), "bodies_redone"), 0);
  EXPECT_GT(stat(path("stats"), "anticipated"), 0);
  EXPECT_EQ(stat(path("stats"), "refused"), 0);
  for (const auto& way : std::vector<std::vector<std::string>>{
           {"--sync", "single"}, {"--worlds", "2"}, {"--worlds", "5", "--sync", "conservative"}}) {
    std::vector<std::string> arguments{"verify", path("run.rec"), "-q"};
    arguments.insert(arguments.end(), way.begin(), way.end());
    expect_says(run(arguments), "equal: 1501 steps");
  }
}

TEST_F(Acting, ARecordingThatSaysOtherwiseIsNotVerified) {
  const std::string file = scene("cubes", 60);
  const std::string acts = actions(file, 80, 10, 2);
  run({"run", file, "--sync", "single", "--steps", "90", "--pace", "max", "--actions", acts, "--record",
       path("a.rec")});
  expect_says(run({"verify", path("a.rec"), "--worlds", "2", "-q"}), "equal: 91 steps");
  // Cut off, it is verified up to there, or refused.
  const std::string whole = read_text(path("a.rec"));
  std::ofstream(path("cut.rec"), std::ios::binary) << whole.substr(0, whole.size() - 3);
  std::ofstream(path("short.rec"), std::ios::binary) << whole.substr(0, 100);
  std::ofstream(path("other.rec"), std::ios::binary) << "something else, which is long enough";
  expect_says(run({"verify", path("short.rec")}, 2), "is cut off before its first step");
  expect_says(run({"verify", path("other.rec")}, 2), "is not a recording");
}

TEST_F(Acting, AKilledRunLeavesARecordingUpToASecondBefore) {
  auto running = start(scene("cubes", 60), 2, 100000, {"--record", path("a.rec")});
  std::this_thread::sleep_for(4s);  // of real time: 240 steps
  expect_says(ask({"act", "push", "1", "--impulse", "0", "0", "50"}), "action 1");
  std::this_thread::sleep_for(2s);
  ASSERT_EQ(::kill(running->pid(), SIGKILL), 0);
  expect_exit(*running, -SIGKILL);
  const std::string said = run({"verify", path("a.rec"), "--worlds", "3", "-q"});
  expect_says(said, "not whole: the run did not come to its end");
  expect_says(said, "1 actions");
  std::size_t steps = 0;
  ASSERT_EQ(std::sscanf(said.substr(said.find("equal: ")).c_str(), "equal: %zu", &steps), 1) << said;
  EXPECT_GT(steps, 240u);
}

TEST_F(Acting, PausedASessionWaitsAndGoesStepByStep) {
  auto running = start(scene("cubes", 60), 2, 300);
  const auto displayed = [&](const std::string& output) {
    long long step = -1;
    std::sscanf(output.substr(output.find("displayed step") + 14).c_str(), "%lld", &step);
    return step;
  };
  ask({"pause"});
  std::this_thread::sleep_for(300ms);
  const long long at = displayed(ask({"pause"}));
  std::this_thread::sleep_for(500ms);
  EXPECT_EQ(displayed(ask({"pause"})), at) << "it went on";
  ask({"step", "7"});
  std::this_thread::sleep_for(500ms);
  EXPECT_EQ(displayed(ask({"pause"})), at + 7);
  expect_says(ask({"act", "push", "3", "--impulse", "0", "0", "9"}),
              "at step " + std::to_string(at + 7 + 5));  // lead 4
  ask({"speed", "4"});
  ask({"resume"});
  expect_says(ask({"step"}, 1), "single steps are for a paused session");
  expect_exit(*running, 0, 60s);
  EXPECT_EQ(lines_of(path("log")).size(), 301u);
}

class AllLong : public SessionTest {};

TEST_F(AllLong, MemoryStaysFlat) {
  const std::string file = scene("cubes", 60);
  const auto peak = [&](Step steps) {
    run({"run", file, "--worlds", "2", "--steps", std::to_string(steps), "--pace", "max", "-q", "--actions",
         actions(file, steps, 400, 5), "--stats", path("stats")},
        0, 600s);
    EXPECT_GT(stat(path("stats"), "actions"), 50);
    EXPECT_GT(stat(path("stats"), "anticipated"), 0);
    return stat(path("stats"), "peak_memory_bytes");
  };
  const double early = peak(20'000), late = peak(100'000);
  EXPECT_LT(late, early * 1.1);
}

TEST_F(Acting, ManyAtOnceAreAllAnsweredOnce) {
  auto running = start(scene("cubes", 60), 2, 100000, {"--record", path("a.rec")});
  std::vector<std::unique_ptr<Program>> users;
  for (int i = 1; i <= 10; ++i)
    users.push_back(std::make_unique<Program>(
        soda({"act", "push", std::to_string(i), "--impulse", "0", "0", "9", "--session", session}), directory()));
  for (const auto& user : users) expect_exit(*user, 0, 30s);
  running->signal(SIGINT);
  expect_exit(*running, 128 + SIGINT);
  expect_says(run({"verify", path("a.rec"), "--sync", "single", "-q"}), " 10 actions");
}

TEST_F(Acting, TheNameOfARunningSessionIsTaken) {
  const std::string file = scene("cubes", 60);
  auto running = start(file, 2, 100000);
  expect_says(run({"run", file, "--session", session, "--worlds", "2", "--record", path("other.rec")}, 2),
              "runs already");
  EXPECT_FALSE(std::filesystem::exists(path("other.rec"))) << "it has begun to write";
  // Who watches it notices its end, whatever it is.
  Program watch(soda({"watch", "--session", session}), directory());
  EXPECT_TRUE(watch.wrote("steps/s", 30s));
  ASSERT_EQ(::kill(running->pid(), SIGKILL), 0);
  expect_exit(*running, -SIGKILL);
  expect_exit(watch, 1, 60s);
  EXPECT_NE(watch.output().find("is gone"), std::string::npos) << watch.output();
}

TEST_F(Acting, NobodyThereIsSaid) {
  expect_says(ask({"act", "remove", "1"}, 3), "nobody answers in session");
  expect_says(run({"speed", "sometimes", "--session", session}, 2), "a pace is");
  expect_says(run({"run", scene("cubes", 20), "--actions", path("nowhere")}, 2), "nowhere");
  std::ofstream(path("bad.txtpb")) << "action { step: 4 push { body: 7777 impulse { z: 1 } } }\n";
  expect_says(run({"run", scene("cubes", 20), "--actions", path("bad.txtpb")}, 2),
              "bad.txtpb: action 1: there is no body 7777");
}

}  // namespace
}  // namespace soda::test
