// The worlds of a session, each on a machine of its own with one core, in one process and in virtual time: a
// discrete-event model of a cluster that runs the real protocol core. What a piece of work costs is said by a Costs:
// measured on the spot, or made up. Each world does what a daemon does (server/world/daemon.cpp): take what has come,
// do one piece of work, hand over what is to be sent, and sleep until something comes when there is nothing to do.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/territory.h"
#include "server/balance/balancer.h"
#include "server/border/world_core.h"
#include "server/physics/model.h"
#include "server/physics/stepper.h"

namespace soda::bench {

// What a message costs by its size: along straight lines between what is known, and beyond.
class CostBySize {
 public:
  CostBySize(double seconds = 0) : known_{{0, seconds}} {}  // NOLINT: the same for all
  struct Known {
    double bytes, seconds;
  };
  explicit CostBySize(std::vector<Known> known) : known_(std::move(known)) {}  // by size, ascending; not empty
  double operator()(std::size_t bytes) const;                                  // s

 private:
  std::vector<Known> known_;
};

// What messages cost, between any two machines.
struct Network {
  double latency = 0;                                            // s, from a machine to another
  double bytes_per_second = std::numeric_limits<double>::max();  // that leave a machine, one message after another
  CostBySize send{}, receive{};                                  // of the processor
};

enum class Activity { kReceiving, kWorking, kTelling, kNetwork };  // the last: handing over to the network and back
constexpr std::size_t kActivities = 4;

// What the core's work costs.
class Costs {
 public:
  virtual ~Costs() = default;
  virtual void begin(const border::WorldCore& core) = 0;
  // s of virtual time that what the world has done since begin(), or the last call, takes on its machine at `now`.
  virtual double spent(WorldId world, const border::WorldCore& core, Activity activity, double now) = 0;
};

// How fast this processor is just now: who shares it with others, or its caches, gets the same done in more CPU time.
// By the steps of a small scene that stays in a cache.
class Yardstick {
 public:
  Yardstick();
  double slowness();  // over when it was made; takes some milliseconds

 private:
  double seconds();  // for the same work each time
  physics::Model model_;
  physics::Stepper stepper_;
  BodySet start_;
  double at_first_ = 0;  // s, at best
};

// What it costs here: CPU time of this thread, times a factor by Activity; as if the processor were always as fast as
// when the yardstick was made, if there is one. Preemption is not in it, but what others leave in the caches is, and on
// a virtual machine what the host takes away: the very same piece of work takes three times as long once in a hundred
// times, and of many worlds there is always one which that befalls. So large pieces are told as at most twice the
// median of their like: those of the same world that compute about as many bodies. What reading the clock takes is left
// out.
class MeasuredCosts final : public Costs {
 public:
  explicit MeasuredCosts(Yardstick* yardstick = nullptr);
  std::array<double, kActivities> factors{1, 1, 1, 1};
  void begin(const border::WorldCore& core) override;
  double spent(WorldId world, const border::WorldCore& core, Activity activity, double now) override;

 private:
  double clipped(WorldId world, const border::WorldCore& core, double seconds);
  Yardstick* const yardstick_;
  std::uint64_t bodies_ = 0;                                          // computed before
  Step clock_ = 0;                                                    // likewise
  std::map<std::array<std::uint32_t, 3>, std::vector<double>> like_;  // s, by world and kind
  double reading_ = 1e9;                                              // s, of the clock
  double slowness_ = 1, known_at_ = -1e9;                             // s of CPU time
  double since_ = 0;
};

// As much for each body computed, and nothing else.
class BodyCosts final : public Costs {
 public:
  double per_body = 0;  // s
  void begin(const border::WorldCore& core) override { computed_ = core.stats().timeline.bodies_computed; }
  double spent(WorldId, const border::WorldCore& core, Activity activity, double) override {
    if (activity != Activity::kWorking) return 0;
    return per_body * static_cast<double>(core.stats().timeline.bodies_computed - computed_);
  }

 private:
  std::uint64_t computed_ = 0;
};

class Cluster {
 public:
  // As far as a session lets a world go (WorldCore::set_limit, close_actions).
  struct Order {
    Step limit, closed;
  };
  struct Piece {  // what a world is given before it works
    std::optional<Order> order;
    std::vector<std::vector<std::byte>> messages;
    bool patient = true;
  };
  struct Usage {
    std::array<double, kActivities> seconds{};  // by Activity
    std::uint64_t pieces = 0;                   // of work that did something
    double busy() const { return seconds[0] + seconds[1] + seconds[2] + seconds[3]; }
  };

  // `settings.me` is set for each world. `costs` must outlive the cluster. Without worlds it can only replay.
  Cluster(const Scene& scene, const TerritoryMap& map, const border::CoreSettings& settings, const Network& network,
          Costs& costs, bool with_worlds = true);

  // How fast the session is shown: for worlds that balance their loads (settings.balance). Such cannot be replayed.
  balance::Pace pace;
  // Called when a world has done something, what it says has left it, and it is not busy.
  std::function<void(WorldId)> worked;

  WorldId worlds() const { return static_cast<WorldId>(worlds_.size()); }
  const border::WorldCore& core(WorldId w) const { return *worlds_[w].core; }
  const Usage& usage(WorldId w) const { return worlds_[w].usage; }
  double now() const { return now_; }  // s

  void at(double time, std::function<void()> happens);  // what is planned first happens first
  void order(WorldId w, const Order& order);            // takes effect when the world looks
  // Until stop() is called. Throws std::runtime_error where nothing happens any more before.
  void run();
  void stop() { stopped_ = true; }

  // Before run(): keeps what a world is given, so that replay() can do the same again with a fresh core, piece by
  // piece, in another process if need be: what the world costs on a machine of its own, whose caches and heap it need
  // not share.
  void record(WorldId w) { worlds_[w].recorded = true; }
  const std::vector<Piece>& recorded(WorldId w) const { return worlds_[w].pieces; }
  Usage replay(WorldId w, const std::vector<Piece>& pieces, Costs& costs) const;

 private:
  struct Event {
    double time;
    std::uint64_t number;
    std::function<void()> happens;
    bool operator<(const Event& o) const { return time != o.time ? time > o.time : number > o.number; }
  };
  struct World {
    std::unique_ptr<border::WorldCore> core;
    std::unique_ptr<balance::Balancer> balancer;
    Piece next;  // what came while it was busy
    bool busy = false, recorded = false;
    std::uint64_t holds = 0;  // since when, by number; 0: not
    std::vector<Piece> pieces;
    double line_free = 0;  // when all that it has sent has left
    Usage usage;
  };
  struct Done {
    border::Progress progress;
    double seconds;
    std::vector<border::Outgoing> out;
  };
  std::unique_ptr<border::WorldCore> make_core(WorldId w) const;
  Done work(WorldId w, border::WorldCore& core, balance::Balancer* balancer, const Piece& piece, Costs& costs,
            Usage& usage) const;
  void look(WorldId w);
  void hold(WorldId w, double seconds);
  void hand_over(WorldId w, std::vector<border::Outgoing> out);

  const border::CoreSettings settings_;
  const Network network_;
  Costs& costs_;
  mutable border::Observer ignores_;
  mutable physics::Model model_;  // shared: nothing is spawned, and a thousand copies of a large scene would not fit
  TerritoryMap map_;
  std::vector<World> worlds_;
  std::vector<Event> events_;  // a heap
  std::uint64_t number_ = 0;
  double now_ = 0;
  bool running_ = false, stopped_ = false;
};

}  // namespace soda::bench
