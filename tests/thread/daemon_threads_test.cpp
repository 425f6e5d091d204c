// Several daemons in the threads of one process, with the session service that paces them: for ThreadSanitizer, and for
// debugging without a network. Whatever the number of worlds and however much is lost, the hashes are the same.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "common/scene/generators.h"
#include "common/version.h"
#include "server/world/daemon.h"
#include "server/world/session_service.h"
#include "tests/support/in_process_transport.h"
#include "tests/support/random_actions.h"

namespace soda::world {
namespace {

// What all worlds of a session report, added up by step.
class Ledger {
 public:
  struct Row {
    std::uint64_t bodies = 0, hash = 0;
    WorldId worlds = 0;
    bool operator==(const Row&) const = default;
  };

  void add(const wire::Digests& sample) {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < sample.hashes().size(); ++i) {
      Row& row = rows_[sample.first() + static_cast<Step>(i)];
      row.bodies += sample.bodies()[i];
      row.hash += sample.hashes()[i];
      ++row.worlds;
    }
  }
  std::map<Step, Row> rows() const {
    const std::lock_guard lock(mutex_);
    return rows_;
  }

 private:
  mutable std::mutex mutex_;
  std::map<Step, Row> rows_;
};

class LedgerReports final : public Reports {
 public:
  LedgerReports(Ledger& ledger, std::function<void(const wire::Status&)> on_status)
      : ledger_(ledger), on_status_(std::move(on_status)) {}
  bool listened_to() const override { return true; }
  void status(const wire::Status& sample) override { on_status_(sample); }
  void digests(const wire::Digests& sample) override { ledger_.add(sample); }
  void state(const wire::StateChunk&) override {}
  void poses(const wire::Poses&) override {}
  void transfer(const wire::Transfer&) override {}
  bool wants_transforms() const override { return true; }
  bool take_lack() override { return false; }
  void transforms(const wire::Transforms& sample) override { transforms_ += sample.ids().size(); }
  bool finish(std::chrono::milliseconds) override { return true; }

 private:
  Ledger& ledger_;
  std::function<void(const wire::Status&)> on_status_;
  std::size_t transforms_ = 0;
};

struct RunResult {
  std::map<Step, Ledger::Row> rows;
  std::uint64_t interruptions = 0, resent = 0, mixed_islands = 0;
};

RunResult run(const Scene& scene, WorldId worlds, Step steps, double pace, double loss,
              std::vector<WantedAction> actions = {}, bool silent = false) {
  wire::Session session;
  session.protocol(kProtocolVersion);
  session.instance(1);
  session.worlds(worlds);
  session.last_step(steps);
  session.window(48);
  session.lead(4);
  session.dt(scene.dt);
  session.pace(pace);

  Ledger ledger;
  test::InProcessNetwork network(worlds, loss, silent);
  std::unique_ptr<SessionService> service;
  std::vector<std::unique_ptr<test::InProcessTransport>> transports;
  std::vector<std::unique_ptr<LedgerReports>> reports;
  std::vector<std::unique_ptr<Daemon>> daemons;
  for (WorldId me = 0; me < worlds; ++me) {
    transports.push_back(std::make_unique<test::InProcessTransport>(network, me));
    reports.push_back(std::make_unique<LedgerReports>(ledger, [&](const wire::Status& s) { service->status(s); }));
    DaemonSettings settings;
    settings.instance = session.instance();
    settings.me = me;
    settings.worlds = worlds;
    settings.last_step = steps;
    daemons.push_back(std::make_unique<Daemon>(scene, settings, *transports.back(), *reports.back()));
  }
  SessionService::Outlet outlet;
  outlet.control = [&](const wire::Control& control) {
    for (const auto& daemon : daemons) {
      if (control.phase() != wire::PHASE_GATHERING) {
        daemon->close_actions(control.closed(), control.logged());
        daemon->set_limit(control.limit());
      }
      if (control.phase() == wire::PHASE_ENDED) daemon->release();
    }
  };
  outlet.entry = [&](const wire::LogEntry& entry) {
    for (const auto& daemon : daemons) daemon->act(entry);
  };
  outlet.answer = [](const wire::Answer&) {};
  service = std::make_unique<SessionService>(session, std::make_shared<const Scene>(scene), std::move(actions), outlet);
  for (WorldId me = 1; me < worlds; ++me) {
    wire::Join claim;
    claim.protocol(kProtocolVersion);
    claim.nonce(100 + me);
    claim.world(me);
    EXPECT_EQ(service->join(claim), "");
  }
  std::vector<std::thread> threads;
  std::atomic<int> done{0};
  for (const auto& daemon : daemons) threads.emplace_back([&] { done += daemon->run() == Daemon::End::kDone; });
  for (std::thread& thread : threads) thread.join();
  service.reset();
  EXPECT_EQ(done.load(), static_cast<int>(worlds));

  RunResult result{ledger.rows()};
  for (const auto& daemon : daemons) {
    result.interruptions += daemon->interruptions();
    result.resent += daemon->core().stats().messages_resent;
    result.mixed_islands += daemon->core().stats().mixed_islands;
  }
  // Every world reported every step once.
  EXPECT_EQ(result.rows.size(), static_cast<std::size_t>(steps + 1));
  for (const auto& [step, row] : result.rows) EXPECT_EQ(row.worlds, worlds) << "step " << step;
  return result;
}

std::map<Step, Ledger::Row> without_worlds(std::map<Step, Ledger::Row> rows) {
  for (auto& [step, row] : rows) row.worlds = 0;
  return rows;
}

constexpr Step kSteps = 150;

std::vector<WantedAction> some_actions(const Scene& scene) {
  std::vector<WantedAction> wanted;
  for (LoggedAction& action : test::random_actions(scene, kSteps, 20, false, 3))
    wanted.push_back({std::move(action.action), action.step, {}});
  return wanted;
}

TEST(DaemonThreads, SeveralWorldsGiveTheBitsOfOne) {
  const Scene scene = generate("heap", 200, 1);
  const RunResult one = run(scene, 1, kSteps, 0, 0);
  for (const WorldId worlds : {2u, 4u, 6u}) {
    const RunResult several = run(scene, worlds, kSteps, 0, 0);
    EXPECT_EQ(without_worlds(several.rows), without_worlds(one.rows)) << worlds << " worlds";
    EXPECT_GT(several.mixed_islands, 0u);
  }
}

TEST(DaemonThreads, LossesChangeNothing) {
  const Scene scene = generate("heap", 200, 1);
  const RunResult one = run(scene, 1, kSteps, 0, 0);
  const RunResult lossy = run(scene, 3, kSteps, 0, 0.02);
  EXPECT_EQ(without_worlds(lossy.rows), without_worlds(one.rows));
  EXPECT_GT(lossy.interruptions, 0u);
  EXPECT_GT(lossy.resent, 0u);
}

// Nobody is told that a datagram was lost: its number is missing, or who waits for it asks.
TEST(DaemonThreads, LossesThatNobodyToldOfChangeNothing) {
  const Scene scene = generate("heap", 200, 1);
  const RunResult one = run(scene, 1, kSteps, 0, 0);
  const RunResult lossy = run(scene, 3, kSteps, 0, 0.02, {}, true);
  EXPECT_EQ(without_worlds(lossy.rows), without_worlds(one.rows));
  EXPECT_EQ(lossy.interruptions, 0u);
  EXPECT_GT(lossy.resent, 0u);
}

TEST(DaemonThreads, ActionsAreTheSameForAll) {
  const Scene scene = generate("heap", 200, 1);
  const RunResult quiet = run(scene, 1, kSteps, 0, 0);
  const RunResult one = run(scene, 1, kSteps, 0, 0, some_actions(scene));
  EXPECT_NE(one.rows, quiet.rows);
  const RunResult several = run(scene, 4, kSteps, 0, 0.01, some_actions(scene));
  EXPECT_EQ(without_worlds(several.rows), without_worlds(one.rows));
  const RunResult paced = run(scene, 2, kSteps, 4, 0, some_actions(scene));
  EXPECT_EQ(without_worlds(paced.rows), without_worlds(one.rows));
}

TEST(DaemonThreads, PacingChangesNothing) {
  const Scene scene = generate("heap", 100, 1);
  const RunResult one = run(scene, 1, kSteps, 0, 0);
  const RunResult paced = run(scene, 2, kSteps, 4, 0);
  EXPECT_EQ(without_worlds(paced.rows), without_worlds(one.rows));
}

}  // namespace
}  // namespace soda::world
