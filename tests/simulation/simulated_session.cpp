#include "tests/simulation/simulated_session.h"

#include <algorithm>
#include <cstdio>
#include <deque>
#include <limits>
#include <memory>
#include <queue>
#include <random>
#include <utility>

#include "common/state_hash.h"
#include "server/balance/balancer.h"
#include "server/physics/model.h"
#include "server/physics/stepper.h"
#include "server/timeline/effects.h"

namespace soda::test {
namespace {

class Digests : public border::Observer {
 public:
  void finalised(Step step, const border::Produced& produced) override {
    if (step != static_cast<Step>(steps.size())) out_of_order = true;
    steps.push_back({produced.bodies(), produced.hash()});
  }
  std::vector<StepDigest> steps;
  bool out_of_order = false;
};

struct Flight {
  std::uint64_t at, number;
  WorldId to;
  std::shared_ptr<std::vector<std::byte>> bytes;
  bool operator<(const Flight& o) const { return at != o.at ? at > o.at : number > o.number; }  // earliest on top
};

// World 0's session service: tells every world of actions, in order, and of how far they are closed, in no order with
// those.
class Service {
 public:
  Service(const Actions& log, const NetworkSettings& network, WorldId worlds)
      : log_(log), network_(network), random_(network.seed + 77), inboxes_(worlds) {
    const auto earlier = [](const LoggedAction& l, const LoggedAction& r) { return l.step < r.step; };
    live_ = std::is_sorted(log.begin(), log.end(), earlier);
  }

  // Whether anything was done.
  bool tick(std::uint64_t now, const std::vector<std::unique_ptr<border::WorldCore>>& cores) {
    bool moved = false;
    Step slowest = cores.front()->final_step();
    for (const auto& core : cores) slowest = std::min(slowest, core->final_step());
    if (slowest + network_.lead > closed_ && random_() % 4 == 0) {
      const Step closed = slowest + network_.lead;
      const Step ahead = live_ ? closed + static_cast<Step>(random_() % 3) : std::numeric_limits<Step>::max();
      while (logged_ < log_.size() && log_[logged_].step <= ahead) {
        for (Inbox& inbox : inboxes_) {
          inbox.last = std::max(inbox.last, now + delay());
          inbox.actions.emplace_back(inbox.last, logged_);
        }
        ++logged_;
      }
      closed_ = closed;
      for (Inbox& inbox : inboxes_) inbox.closings.push_back({now + delay(), closed, logged_});
      moved = true;
    }
    for (std::size_t w = 0; w < cores.size(); ++w) {
      Inbox& inbox = inboxes_[w];
      for (; !inbox.actions.empty() && inbox.actions.front().first <= now; inbox.actions.pop_front()) {
        cores[w]->act(log_[inbox.actions.front().second]);
        cores[w]->act(log_[inbox.actions.front().second]);  // told again: nothing
        moved = true;
      }
      moved = std::erase_if(inbox.closings,
                            [&](const Closing& closing) {
                              if (closing.at > now) return false;
                              cores[w]->close_actions(closing.step, closing.logged);
                              return true;
                            }) > 0 ||
              moved || !inbox.actions.empty() || !inbox.closings.empty();
    }
    return moved;
  }

 private:
  struct Closing {
    std::uint64_t at;
    Step step;
    ActionNumber logged;
  };
  struct Inbox {
    std::deque<std::pair<std::uint64_t, std::size_t>> actions;  // when they arrive, position in the log
    std::uint64_t last = 0;
    std::vector<Closing> closings;
  };
  std::uint64_t delay() { return 1 + random_() % static_cast<std::uint64_t>(2 * network_.delay + 1); }

  const Actions& log_;
  const NetworkSettings network_;
  std::mt19937_64 random_;
  std::vector<Inbox> inboxes_;
  bool live_ = true;
  Step closed_ = 0;
  std::size_t logged_ = 0;
};

class Session {
 public:
  Session(const Scene& scene, WorldId worlds, Step steps, const NetworkSettings& network,
          const std::vector<WorldId>& owner, const Actions& log, const std::vector<border::Transfer>& transfers)
      : scene_(scene),
        network_(network),
        random_(network.seed),
        trade_random_(network.seed + 4711),
        digests_(worlds),
        slowness_(worlds),
        service_(log, network, worlds) {
    const Grid grid = make_grid(scene);
    map_ = owner.empty() ? bisect(scene, grid, worlds) : TerritoryMap{grid, worlds, owner};
    for (WorldId w = 0; w < worlds; ++w) {
      models_.push_back(std::make_unique<physics::Model>(scene));
      cores_.push_back(std::make_unique<border::WorldCore>(*models_[w], map_,
                                                           border::CoreSettings{.me = w,
                                                                                .epoch = 1,
                                                                                .session = 42,
                                                                                .last_step = steps,
                                                                                .sync = network.sync,
                                                                                .window = network.window,
                                                                                .piece_bodies = network.piece_bodies,
                                                                                .transfers = transfers,
                                                                                .balance = trades(network),
                                                                                .actions = true},
                                                           digests_[w]));
      slowness_[w] = uniform() * network.stall_share;
      if (network.budget == 0) continue;
      balancers_.push_back(std::make_unique<balance::Balancer>(*cores_[w], map_.grid, w, scene.dt));
      burdens_.emplace_back();
    }
    for (const auto& core : cores_) result_.least_neighbours += core->neighbours().size();
  }

  SessionResult run() {
    std::uint64_t idle_since = 0;
    std::vector<border::Progress> progress(cores_.size(), border::Progress::kWorked);
    // Without any delivery or work for this long a world asks again, as a daemon does after a while.
    const std::uint64_t patience = 40ull * static_cast<std::uint64_t>(network_.delay + 1);
    for (std::uint64_t now = 0;; ++now) {
      bool moved = service_.tick(now, cores_);
      for (; !flights_.empty() && flights_.top().at <= now; flights_.pop()) {
        const Flight& f = flights_.top();
        if (!cores_[f.to]->receive(*f.bytes)) return fail("refused: " + cores_[f.to]->last_refusal());
        ++result_.delivered;
      }
      for (WorldId w = 0; w < cores_.size(); ++w) {
        // Nobody stalls while everything is at rest: it is a standstill only where all have had their turn.
        if (uniform() < slowness_[w] && now - idle_since <= patience / 2) continue;
        // In every other session worlds wait for what is on its way.
        progress[w] = cores_[w]->work(network_.seed % 2 == 0 && !flights_.empty() && uniform() < 0.8);
        result_.held += progress[w] == border::Progress::kHolding;
        moved = moved || progress[w] == border::Progress::kWorked;
        if (network_.touch_share > 0 && progress[w] == border::Progress::kWorked && uniform() < network_.touch_share &&
            !cores_[w]->is_indexed())
          return fail("world " + std::to_string(w) + " would not find a body that it knows");
        if (network_.touch_share > 0 && progress[w] != border::Progress::kWorked && uniform() < network_.touch_share)
          if (!touch(*cores_[w])) return fail(result_.failure);
        if (network_.give_share > 0) trade(*cores_[w]);
        if (network_.budget != 0) balance(w);
        for (border::Outgoing& out : cores_[w]->take_outgoing()) post(now, out);
      }
      const bool done = std::all_of(progress.begin(), progress.end(),
                                    [](border::Progress p) { return p == border::Progress::kDone; });
      if (done && flights_.empty()) break;
      if (moved || !flights_.empty()) idle_since = now;
      if (now - idle_since > patience) {
        // Only a lost message can bring everything to rest, and asking again gets things going, if not each time.
        Step finals = 0;
        for (const auto& core : cores_) finals += core->final_step();
        if (std::exchange(finals_, finals) != finals) stuck_ = 0;
        if (result_.lost == 0 || ++stuck_ > 200) return fail(standstill());
        for (auto& core : cores_)
          for (const WorldId n : core->waiting_for()) stuck_ > 100 ? core->reconnect(n) : core->ask(n);
        idle_since = now;
      }
    }
    for (WorldId w = 0; w < cores_.size(); ++w) {
      if (digests_[w].out_of_order) return fail("final steps out of order");
      result_.steps.resize(digests_[w].steps.size());
      for (std::size_t t = 0; t < result_.steps.size(); ++t) {
        result_.steps[t].bodies += digests_[w].steps[t].bodies;
        result_.steps[t].hash += digests_[w].steps[t].hash;
      }
    }
    return collect();
  }

 private:
  static bool trades(const NetworkSettings& network) { return network.give_share > 0 || network.budget != 0; }
  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }

  // Some cells to some neighbour, which mostly takes them.
  void trade(border::WorldCore& core) {
    for (const border::Asked& asked : core.take_offers()) core.answer(asked, trade_random_() % 5 != 0);
    const double now = static_cast<double>(trade_random_() >> 11) * 0x1p-53;
    if (now >= network_.give_share || core.offering() || core.neighbours().empty()) return;
    const WorldId taker = core.neighbours()[trade_random_() % core.neighbours().size()];
    const auto one_in = std::vector<std::uint64_t>{1, 2, 10}[trade_random_() % 3];
    std::vector<std::uint32_t> cells;
    for (std::uint32_t cell = 0; cell < map_.grid.cells(); ++cell)
      if (core.may_give(cell) && trade_random_() % one_in == 0) cells.push_back(cell);
    core.give(taker, std::move(cells));
  }

  // Bodies cost each world something else, which changes now and then.
  void balance(WorldId w) {
    Burden& burden = burdens_[w];
    if (trade_random_() % 300 == 0) burden.each = std::vector<double>{1e-6, 2e-6, 8e-6}[trade_random_() % 3];
    const std::uint64_t computed = cores_[w]->stats().timeline.bodies_computed;
    balancers_[w]->worked(burden.each * static_cast<double>(computed - std::exchange(burden.computed, computed)));
    Step displayed = cores_[w]->final_step();
    for (const auto& core : cores_) displayed = std::min(displayed, core->final_step());
    balancers_[w]->consider({std::max(0.0, network_.budget), displayed});
  }

  // A repair of what has not changed must leave every step as it is, byte by byte.
  bool touch(border::WorldCore& core) {
    // Beyond the front, what waits has no results yet, and may get them when it is looked at again.
    const Step first = core.final_step(), front = core.front();
    if (first == front) return true;
    const Step step = first + static_cast<Step>(random_() % static_cast<std::uint64_t>(front - first));
    std::vector<std::uint64_t> before;
    for (Step t = first; t <= front; ++t) before.push_back(core.digest(t));
    std::vector<BodyId> bodies;
    const double share = uniform() * uniform();
    for (const Body& body : scene_.bodies)
      if (uniform() < share) bodies.push_back(body.id);
    const auto computed = core.stats().timeline.bodies_computed;
    core.touch(step, bodies);
    while (core.work() == border::Progress::kWorked) {
    }
    result_.touched += core.stats().timeline.bodies_computed > computed;  // it may wait for neighbours, too
    for (Step t = core.final_step(); t <= front; ++t)
      if (core.digest(t) != before[static_cast<std::size_t>(t - first)]) {
        result_.failure = "a repair of step " + std::to_string(step) + ", where nothing had changed, changed step " +
                          std::to_string(t);
        return false;
      }
    return true;
  }

  void post(std::uint64_t now, border::Outgoing& out) {
    const auto bytes = std::make_shared<std::vector<std::byte>>(std::move(out.bytes));
    if (uniform() < network_.loss_share) {
      ++result_.lost;
      return;
    }
    int copies = 1;
    if (uniform() < network_.double_share) ++copies, ++result_.doubled;
    for (int i = 0; i < copies; ++i) {
      double delay = uniform() * network_.delay;
      if (uniform() < network_.slow_share) delay *= 10;
      flights_.push({now + 1 + static_cast<std::uint64_t>(delay), ++number_, out.to, bytes});
    }
  }

  std::string standstill() const {
    std::string s = "standstill, no message on its way:";
    for (WorldId w = 0; w < cores_.size(); ++w) {
      s += " world " + std::to_string(w) + " clock " + std::to_string(cores_[w]->clock()) + " final " +
           std::to_string(cores_[w]->final_step()) + " waits for";
      for (const WorldId n : cores_[w]->waiting_for()) s += " " + std::to_string(n);
      s += ": " + cores_[w]->why_not_final() + "\n";
    }
    return s;
  }

  SessionResult fail(std::string why) {
    result_.failure = "seed " + std::to_string(network_.seed) + ": " + std::move(why);
    return collect();
  }

  SessionResult collect() {
    for (const auto& core : cores_) {
      add(result_.total, core->stats());
      result_.kept = std::max(result_.kept, core->final_step() - core->oldest());
    }
    return result_;
  }

  const Scene& scene_;
  NetworkSettings network_;
  TerritoryMap map_;
  std::mt19937_64 random_, trade_random_;
  std::vector<Digests> digests_;
  std::vector<std::unique_ptr<physics::Model>> models_;
  std::vector<std::unique_ptr<border::WorldCore>> cores_;
  struct Burden {
    double each = 1e-6;  // s for a body
    std::uint64_t computed = 0;
  };
  std::vector<std::unique_ptr<balance::Balancer>> balancers_;
  std::vector<Burden> burdens_;
  std::vector<double> slowness_;
  Service service_;
  std::priority_queue<Flight> flights_;
  std::uint64_t number_ = 0, stuck_ = 0;
  Step finals_ = 0;  // of all worlds, when everything was at rest last
  SessionResult result_;
};

}  // namespace

void add(border::CoreStats& sum, const border::CoreStats& s) {
  sum.steps += s.steps;
  sum.syncs += s.syncs;
  sum.mixed_islands += s.mixed_islands;
  sum.arrived += s.arrived;
  sum.departed += s.departed;
  sum.wide_bodies += s.wide_bodies;
  sum.messages_sent += s.messages_sent;
  sum.bytes_sent += s.bytes_sent;
  sum.frames_sent += s.frames_sent;
  sum.frames_corrected += s.frames_corrected;
  sum.frame_bodies_sent += s.frame_bodies_sent;
  sum.parts_sent += s.parts_sent;
  sum.parts_passed += s.parts_passed;
  sum.parts_left += s.parts_left;
  sum.messages_resent += s.messages_resent;
  sum.duplicates += s.duplicates;
  sum.refused += s.refused;
  sum.anticipated += s.anticipated;
  sum.told_early += s.told_early;
  sum.actions += s.actions;
  sum.offers += s.offers;
  sum.offers_declined += s.offers_declined;
  sum.transfers += s.transfers;
  sum.cells_given += s.cells_given;
  sum.links_opened += s.links_opened;
  sum.held_back += s.held_back;
  sum.timeline.bodies_computed += s.timeline.bodies_computed;
  sum.timeline.bodies_redone += s.timeline.bodies_redone;
  sum.timeline.steps_redone += s.timeline.steps_redone;
  sum.timeline.handed_over += s.timeline.handed_over;
  sum.timeline.longest_rollback = std::max(sum.timeline.longest_rollback, s.timeline.longest_rollback);
}

namespace {

// What is done at a step, to all bodies at once.
void do_actions(const timeline::Effects& effects, Step step, BodySet& set) {
  for (const BodyId id : effects.acted_on(step)) {
    auto body = std::lower_bound(set.bodies.begin(), set.bodies.end(), id,
                                 [](const BodyState& b, BodyId i) { return b.id < i; });
    const bool there = body != set.bodies.end() && body->id == id;
    std::optional<BodyState> given;
    if (effects.gives(step, id, given)) {
      std::erase_if(set.contacts, [&](const ContactRecord& c) { return c.a == id; });
      if (there && !given) {
        set.bodies.erase(body);
        continue;
      }
      if (!given) continue;
      if (there)
        *body = *given;
      else
        body = set.bodies.insert(body, *given);
    } else if (!there) {
      continue;
    }
    effects.apply(step, *body);
  }
}

}  // namespace

std::vector<StepDigest> run_single(const Scene& scene, Step steps, const Actions& log) {
  physics::Model model(scene);
  for (const LoggedAction& action : log)
    if (const auto* spawn = std::get_if<Spawn>(&action.action)) model.add(spawn->body);
  timeline::Effects effects(model);
  for (const LoggedAction& action : log) (void)effects.add(action);
  physics::Stepper stepper(model);
  BodySet set = model.initial_state();
  std::vector<StepDigest> digests;
  for (Step t = 0;; ++t) {
    do_actions(effects, t, set);
    digests.push_back({set.bodies.size(), bodies_hash(set.bodies)});
    if (t == steps) return digests;
    stepper.step(set);
  }
}

SessionResult run_session(const Scene& scene, WorldId worlds, Step steps, const NetworkSettings& network,
                          const std::vector<WorldId>& owner, const Actions& log,
                          const std::vector<border::Transfer>& transfers) {
  return Session(scene, worlds, steps, network, owner, log, transfers).run();
}

std::string first_difference(const std::vector<StepDigest>& expected, const std::vector<StepDigest>& got) {
  for (std::size_t t = 0; t < std::max(expected.size(), got.size()); ++t) {
    if (t >= expected.size() || t >= got.size()) return "step " + std::to_string(t) + ": only one of the runs has it";
    if (expected[t] == got[t]) continue;
    char text[160];
    std::snprintf(text, sizeof text, "step %zu: %zu bodies %016lx, expected %zu bodies %016lx", t, got[t].bodies,
                  static_cast<unsigned long>(got[t].hash), expected[t].bodies,
                  static_cast<unsigned long>(expected[t].hash));
    return text;
  }
  return {};
}

}  // namespace soda::test
