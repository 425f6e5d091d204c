#include "bench/load_peaks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <optional>
#include <queue>
#include <stdexcept>

#include "bench/lone_core.h"
#include "common/run_settings.h"
#include "common/scene/generators.h"

namespace soda::bench {
namespace {

// ---- the machines: time is virtual, so that a run is the same on every machine and under any load -------------------

constexpr double kRate = 60;                 // frames and steps per second
constexpr double kPeak = 0.3, kEvery = 0.6;  // s: a peak, and from one world's to the other's
constexpr double kPeakFactor = 3;            // as slow as otherwise
constexpr double kMessage = 0.001;           // s
constexpr double kLoad = 0.65;               // of what a world can do, peaks included, at 60 steps/s
constexpr double kStart = 1;                 // s, until the first frame is due
constexpr double kFindingShare = 0.25;       // of a step's time, before its islands are solved: as in a city
constexpr Step kFar = Step{1} << 40;

double slowness(WorldId world, double time) {
  const double since = std::fmod(time + 2 * kEvery - world * kEvery, 2 * kEvery);
  return since < kPeak ? kPeakFactor : 1;
}

// s per body and step, such that the load of a world with half of the bodies is kLoad.
double cost_per_body(std::uint32_t bodies) {
  const double steps_in_period = 2 * kEvery - kPeak + kPeak / kPeakFactor;  // with a step that takes 1 s
  return kLoad * steps_in_period / (2 * kEvery) / kRate / (0.5 * bodies);
}

// ---- the session ----------------------------------------------------------------------------------------------------

struct Frame {
  double time = 0;  // s after kStart
  Step displayed = 0, final_step = 0;
  std::array<Step, 2> clock{};
  int missed = 0;  // so far
};

struct Mode {
  const char* name;
  border::Sync sync;
};

struct Pacing {
  bool paced = true;
  Step lead = kDefaultLead;
  Step steps = 0;  // to be displayed, or to be made final
};

class VirtualSession {
 public:
  VirtualSession(const Scene& scene, border::Sync sync, const Pacing& pacing, double cost)
      : pacing_(pacing), cost_(cost) {
    const TerritoryMap map = bisect(scene, make_grid(scene), 2);
    for (WorldId w = 0; w < 2; ++w) {
      worlds_[w].core.emplace(scene, map,
                              border::CoreSettings{.me = w,
                                                   .last_step = pacing.paced ? kFar : pacing.steps,
                                                   .sync = sync,
                                                   .window = kWindow,
                                                   .actions = true});
      order(w, pacing.paced ? Order{kWindow, pacing.lead} : Order{kFar, kFar});
      at(0, [this, w] { look(w); });
    }
    if (pacing.paced) at(kStart, [this] { frame(); });
  }

  // Until the last frame, or step. Returns the virtual time that it took, s.
  double run() {
    while (!events_.empty() && !ended_) {
      const Event event = events_.top();
      events_.pop();
      now_ = event.time;
      event.happens();
    }
    if (!ended_) throw std::runtime_error("the session stands still");
    return now_;
  }

  const std::vector<Frame>& frames() const { return frames_; }
  double redone_share() {
    return static_cast<double>(bodies_redone(core(0)) + bodies_redone(core(1))) /
           static_cast<double>(bodies_computed(core(0)) + bodies_computed(core(1)));
  }
  double mixed_per_step() {
    return static_cast<double>(core(0).stats().mixed_islands) / static_cast<double>(core(0).final_step());
  }

 private:
  struct Event {
    double time;
    std::uint64_t number;  // what was planned first happens first
    std::function<void()> happens;
    bool operator<(const Event& o) const { return time != o.time ? time > o.time : number > o.number; }
  };
  struct Order {
    Step limit, closed;
  };
  struct World {
    std::optional<LoneCore> core;
    std::vector<std::vector<std::byte>> inbox;  // what came while it was busy
    std::optional<Order> order;                 // likewise
    bool busy = false;
    double paid = 0;      // bodies, of the step that is only begun
    Step told_final = 0;  // that the display knows of
  };

  void at(double time, std::function<void()> happens) { events_.push({time, ++number_, std::move(happens)}); }
  border::WorldCore& core(WorldId w) { return **worlds_[w].core; }
  void order(WorldId w, const Order& order) { worlds_[w].order = order; }

  // A world that is not busy takes what has come, and does what it can.
  void look(WorldId w) {
    World& world = worlds_[w];
    if (world.busy) return;
    if (world.order) {
      core(w).set_limit(world.order->limit);
      core(w).close_actions(world.order->closed, 0);
      world.order.reset();
    }
    for (const auto& bytes : world.inbox)
      if (!core(w).receive(bytes)) throw std::runtime_error(core(w).last_refusal());
    world.inbox.clear();
    for (;;) {
      const std::uint64_t before = bodies_computed(core(w));
      const Step clock = core(w).clock();
      const bool worked = core(w).work() == border::Progress::kWorked;
      // A new step's first half: in between, messages come and go. (Repairs are small enough to be one piece.)
      const double half = core(w).clock() > clock ? kFindingShare * static_cast<double>(core(w).own_bodies()) : 0;
      const double bodies = static_cast<double>(bodies_computed(core(w)) - before);
      const double took = (half > 0 ? half : bodies - std::min(bodies, world.paid)) * cost_ * slowness(w, now_);
      if (half > 0)
        world.paid = half;
      else if (bodies > 0)
        world.paid = 0;
      if (took > 0) {  // what has come of it is known afterwards
        world.busy = true;
        at(now_ + took, [this, w] {
          worlds_[w].busy = false;
          tell(w);
          look(w);
        });
        return;
      }
      tell(w);
      if (!worked) return;
    }
  }

  void tell(WorldId w) {
    for (border::Outgoing& out : core(w).take_outgoing())
      at(now_ + kMessage, [this, to = out.to, bytes = std::move(out.bytes)] {
        worlds_[to].inbox.push_back(bytes);
        look(to);
      });
    const Step final_step = core(w).final_step();
    if (pacing_.paced)
      at(now_ + kMessage, [this, w, final_step] { worlds_[w].told_final = final_step; });
    else if (std::min(core(0).final_step(), core(1).final_step()) == pacing_.steps)
      ended_ = true;
  }

  // A frame is due: the next step is displayed if it is final, else the last one once more, and all is that much later
  // from then on, as the Pacer of a session does it.
  void frame() {
    const Step final_step = std::min(worlds_[0].told_final, worlds_[1].told_final);
    if (final_step > displayed_)
      ++displayed_;
    else
      ++missed_;
    frames_.push_back({now_ - kStart, displayed_, final_step, {core(0).clock(), core(1).clock()}, missed_});
    for (WorldId w = 0; w < 2; ++w)
      at(now_ + kMessage, [this, w, next = Order{displayed_ + kWindow, displayed_ + pacing_.lead}] {
        order(w, next);
        look(w);
      });
    if (static_cast<Step>(frames_.size()) == pacing_.steps)
      ended_ = true;
    else
      at(kStart + static_cast<double>(frames_.size()) / kRate, [this] { frame(); });
  }

  const Pacing pacing_;
  const double cost_;
  std::array<World, 2> worlds_;
  std::priority_queue<Event> events_;
  std::uint64_t number_ = 0;
  double now_ = 0;
  Step displayed_ = 0;
  int missed_ = 0;
  std::vector<Frame> frames_;
  bool ended_ = false;
};

// What a body and step cost here: s, median over steps.
double measured_cost_per_body(const Scene& scene) {
  constexpr Step kSteps = 30;
  LoneCore world(scene, kSteps);
  std::vector<double> costs;
  for (Step step = 1; step <= kSteps; ++step) {
    const std::uint64_t before = bodies_computed(*world);
    world->set_limit(step);
    world->close_actions(step, 0);
    const double seconds = world.work();
    costs.push_back(seconds / static_cast<double>(bodies_computed(*world) - before));
  }
  return median(costs);
}

constexpr const char* kPicture = R"(
set multiplot layout 2,1 title 'Two worlds in turn three times as slow for 0.3 s (grey): a city, input lead 6'
set grid
set xrange [0:4]
set lmargin 10
do for [i=0:4] {
  set object i+1 rectangle from (0.2+1.2*i), graph 0 to (0.5+1.2*i), graph 1 fc rgb '#e8e8e8' fs solid noborder behind
  set object i+11 rectangle from (0.8+1.2*i), graph 0 to (1.1+1.2*i), graph 1 fc rgb '#e8e8e8' fs solid noborder behind
}
of(mode, column_) = stringcolumn(1) eq 'city' && stringcolumn(2) eq mode ? column(column_) : NaN
set ylabel 'step - 60 x time'
set yrange [*:*]
set key bottom left
set format x ''
plot 'latency_peaks.csv' skip 1 using 3:(of('conservative', 4)-60*$3) with steps lw 2 lc rgb '#3d7ea6' title 'displayed, conservative', \
  '' skip 1 using 3:(of('anticipative', 4)-60*$3) with steps lw 2 lc rgb '#d1603d' title 'displayed, anticipative'
set format x '%g'
set xlabel 'virtual time (s)'
set ylabel 'steps beyond the displayed one'
set yrange [0:50]
set key center left
plot 'latency_peaks.csv' skip 1 using 3:(of('anticipative', 6)-$4) with steps lc rgb '#d1603d' title 'computed, world 0, anticipative', \
  '' skip 1 using 3:(of('anticipative', 7)-$4) with steps lc rgb '#e9b44c' title 'world 1', \
  '' skip 1 using 3:(of('anticipative', 5)-$4) with steps lc rgb '#6a994e' title 'final, anticipative', \
  '' skip 1 using 3:(of('conservative', 5)-$4) with steps lc rgb '#3d7ea6' title 'final, conservative'
unset multiplot
)";

struct Case {
  const char *scene, *key;
  std::uint32_t bodies, quick_bodies;
};
// A city has people and islands on the border; between these heaps there is a gap where it runs.
constexpr Case kCases[] = {{"city", "peaks", 8000, 600}, {"piles", "peaks_apart", 972, 324}};

void measure(const Case& c, const Options& options, Csv& table, Headline& headline) {
  constexpr Mode kModes[] = {{"conservative", border::Sync::kConservative},
                             {"anticipative", border::Sync::kAnticipative}};
  constexpr std::array<Step, 2> kLeads = {kDefaultLead, 1};  // the second is what a user would like to have
  const std::uint32_t bodies = options.quick ? c.quick_bodies : c.bodies;
  const Step steps = options.quick ? 120 : 480;
  const std::string key = c.key;
  Scene scene = generate(c.scene, bodies, 1);
  scene.sleeping = false;
  const double cost = cost_per_body(bodies);
  headline.add(key + ".load", kLoad);
  headline.add(key + ".cost_over_measured", cost / measured_cost_per_body(scene));
  for (const Mode& mode : kModes) {
    VirtualSession unpaced(scene, mode.sync, {.paced = false, .steps = steps}, cost);
    const double speed = static_cast<double>(steps) / unpaced.run();
    headline.add(key + ".steps_per_second_" + mode.name, speed);
    std::array<int, kLeads.size()> missed{};
    for (std::size_t i = 0; i < kLeads.size(); ++i) {
      VirtualSession paced(scene, mode.sync, {.lead = kLeads[i], .steps = steps}, cost);
      paced.run();
      missed[i] = paced.frames().back().missed;
      headline.add(key + (i == 0 ? ".missed_" : ".missed_at_lead_1_") + mode.name, missed[i]);
      if (i > 0) continue;
      for (const Frame& f : paced.frames())
        table.row(c.scene, mode.name, f.time, f.displayed, f.final_step, f.clock[0], f.clock[1], f.missed);
      headline.add(key + ".mixed_islands_per_step_" + mode.name, paced.mixed_per_step());
      headline.add(key + ".redone_share_" + mode.name, paced.redone_share());
    }
    std::printf("load peaks, %s of %u, %s: %.1f steps/s unpaced; at 60 Hz %d of %d frames missed (input lead 1: %d)\n",
                c.scene, bodies, mode.name, speed, missed[0], static_cast<int>(steps), missed[1]);
    std::fflush(stdout);
  }
}

}  // namespace

void load_peaks(const Options& options, Headline& headline) {
  Csv table(options, "latency_peaks", "scene,mode,seconds,displayed,final,clock_0,clock_1,missed");
  for (const Case& c : kCases) measure(c, options, table, headline);
  table.close();
  plot(options, "latency_peaks", kPicture, 800, 640);
}

}  // namespace soda::bench
