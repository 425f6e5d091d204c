// One world at work: a loop, on the caller's thread, that carries messages between the protocol core and a transport,
// lets the core work, and reports. Everything that depends on time happens here, and none of it can change a bit of the
// result.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "common/scene/scene.h"
#include "common/territory.h"
#include "server/balance/balancer.h"
#include "server/border/world_core.h"
#include "server/physics/model.h"
#include "server/world/pacer.h"
#include "server/world/recorder.h"
#include "server/world/repair_meter.h"
#include "server/world/reports.h"
#include "server/world/transport.h"
#include "server/world/view_feed.h"

namespace soda::world {

struct DaemonSettings {
  std::uint64_t instance = 0;  // of the session; copied into reports
  WorldId me = 0;
  WorldId worlds = 1;
  std::uint32_t epoch = 0;
  Step last_step = 0;
  border::Sync sync = border::Sync::kAnticipative;
  Step window = 48;                      // K
  Step dump_first = -1, dump_last = -1;  // states to report; -1: none
  Step pose_every = 0;                   // steps whose poses are reported; 0: none
  bool measure = false;                  // what each way of solving islands costs
  bool balance = true;                   // worlds that have much to do give cells to neighbours
};

class Daemon {
 public:
  // `transport` and `reports` must outlive the daemon. Throws SceneError for what physics cannot simulate,
  // std::invalid_argument for more worlds than cells.
  Daemon(Scene scene, const DaemonSettings& settings, Transport& transport, Reports& reports);

  enum class End { kDone, kStopped };
  // Runs until the last step is final everywhere and release() was called, or until stop(). Nothing is computed before
  // the first set_limit(). Reports are complete and acknowledged when it returns kDone.
  End run();

  // From any thread.
  void set_limit(Step newest);  // the clock does not go on beyond it
  // An entry of the session's action log, in any order, any number of times; and how far actions are closed.
  void act(const wire::LogEntry& entry);
  void close_actions(Step step, ActionNumber logged);
  // How fast the session is shown: times real time; 0: as fast as possible.
  void set_pace(double pace);
  void release();  // the session has ended: who is done may leave
  void stop();     // leave as soon as possible

  // After run().
  const border::WorldCore& core() const { return *core_; }
  std::uint64_t interruptions() const { return interruptions_; }

 private:
  using Clock = std::chrono::steady_clock;
  // What is known of a neighbour's silence.
  struct Line {
    Clock::time_point heard{};    // last news, or last question because none came
    Clock::duration patience{};   // how long to wait before the next question
    std::uint64_t delivered = 0;  // messages, when last heard
  };

  bool receive_all();
  void send_all();
  void ask_the_silent(Clock::time_point now);
  void report_if_due(Clock::time_point now);
  void report_status(std::uint8_t state, Clock::time_point now);
  Clock::duration patience() const;
  void idle(border::Progress progress, Clock::duration at_most);
  void act_all();
  void open_lines();
  soda::balance::Pace pace() const;
  void balance();
  wire::Status status() const;

  const DaemonSettings settings_;
  Transport& transport_;
  Reports& reports_;
  physics::Model model_;
  TerritoryMap map_;
  ViewFeed feed_;
  Recorder recorder_;
  std::unique_ptr<border::WorldCore> core_;
  std::optional<soda::balance::Balancer> balancer_;
  std::vector<Line> lines_;  // by world
  std::size_t opened_ = 0;   // of the core's neighbours, with a line and a connection

  std::atomic<Step> limit_{-1};                   // -1: not started
  std::mutex actions_mutex_;                      // guards what follows
  std::map<ActionNumber, LoggedAction> actions_;  // that the core does not have yet
  Step closed_ = 0;                               // by the newest Control
  ActionNumber closed_logged_ = 0;
  bool actions_came_ = false;
  std::atomic<double> pace_{0};
  std::atomic<bool> released_{false}, stopped_{false};
  Step limit_known_ = -1;                        // by the core
  std::optional<Clock::time_point> hold_until_;  // while the core waits for what is on its way

  std::uint8_t state_ = wire::STATE_PREPARING;
  Clock::time_point status_at_{};
  Step status_final_ = 0;
  std::uint64_t interruptions_ = 0;
  std::uint64_t refusals_ = 0;
  RepairMeter repairs_;
  Clock::duration working_{}, waiting_{}, paced_{};
};

}  // namespace soda::world
