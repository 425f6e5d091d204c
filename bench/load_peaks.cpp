#include "bench/load_peaks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "bench/cluster.h"
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

// What a world's work costs on its machine: so much for each body computed.
class PeakCosts final : public Costs {
 public:
  explicit PeakCosts(double per_body) : per_body_(per_body) {}
  void begin(const border::WorldCore& core) override {
    bodies_ = bodies_computed(core);
    clock_ = core.clock();
  }
  double spent(WorldId world, const border::WorldCore& core, Activity activity, double now) override {
    if (activity != Activity::kWorking) return 0;
    // A new step's first half: in between, messages come and go. (Repairs are small enough to be one piece.)
    const double half = core.clock() > clock_ ? kFindingShare * static_cast<double>(core.own_bodies()) : 0;
    const double bodies = static_cast<double>(bodies_computed(core) - bodies_);
    const double due = half > 0 ? half : bodies - std::min(bodies, paid_[world]);
    if (half > 0)
      paid_[world] = half;
    else if (bodies > 0)
      paid_[world] = 0;
    return due * per_body_ * slowness(world, now);
  }

 private:
  const double per_body_;
  std::uint64_t bodies_ = 0;  // computed before
  Step clock_ = 0;
  std::array<double, 2> paid_{};  // bodies, of the step that is only begun
};

class VirtualSession {
 public:
  VirtualSession(const Scene& scene, border::Sync sync, const Pacing& pacing, double cost)
      : pacing_(pacing),
        costs_(cost),
        cluster_(scene, bisect(scene, make_grid(scene), 2),
                 {.last_step = pacing.paced ? kFar : pacing.steps, .sync = sync, .window = kWindow, .actions = true},
                 {.latency = kMessage}, costs_) {
    for (WorldId w = 0; w < 2; ++w)
      cluster_.order(w, pacing.paced ? Cluster::Order{kWindow, pacing.lead} : Cluster::Order{kFar, kFar});
    cluster_.worked = [this](WorldId w) { told(w); };
    if (pacing.paced) cluster_.at(kStart, [this] { frame(); });
  }

  // Until the last frame, or step. Returns the virtual time that it took, s.
  double run() {
    cluster_.run();
    return cluster_.now();
  }

  const std::vector<Frame>& frames() const { return frames_; }
  double redone_share() const {
    return static_cast<double>(bodies_redone(cluster_.core(0)) + bodies_redone(cluster_.core(1))) /
           static_cast<double>(bodies_computed(cluster_.core(0)) + bodies_computed(cluster_.core(1)));
  }
  double mixed_per_step() const {
    const border::WorldCore& core = cluster_.core(0);
    return static_cast<double>(core.stats().mixed_islands) / static_cast<double>(core.final_step());
  }

 private:
  void told(WorldId w) {
    const Step final_step = cluster_.core(w).final_step();
    if (pacing_.paced)
      cluster_.at(cluster_.now() + kMessage, [this, w, final_step] { told_final_[w] = final_step; });
    else if (std::min(cluster_.core(0).final_step(), cluster_.core(1).final_step()) == pacing_.steps)
      cluster_.stop();
  }

  // A frame is due: the next step is displayed if it is final, else the last one once more, and all is that much later
  // from then on, as the Pacer of a session does it.
  void frame() {
    const double now = cluster_.now();
    const Step final_step = std::min(told_final_[0], told_final_[1]);
    if (final_step > displayed_)
      ++displayed_;
    else
      ++missed_;
    frames_.push_back(
        {now - kStart, displayed_, final_step, {cluster_.core(0).clock(), cluster_.core(1).clock()}, missed_});
    for (WorldId w = 0; w < 2; ++w)
      cluster_.at(now + kMessage, [this, w, next = Cluster::Order{displayed_ + kWindow, displayed_ + pacing_.lead}] {
        cluster_.order(w, next);
      });
    if (static_cast<Step>(frames_.size()) == pacing_.steps)
      cluster_.stop();
    else
      cluster_.at(kStart + static_cast<double>(frames_.size()) / kRate, [this] { frame(); });
  }

  const Pacing pacing_;
  PeakCosts costs_;
  Cluster cluster_;
  std::array<Step, 2> told_final_{};  // that the display knows of
  Step displayed_ = 0;
  int missed_ = 0;
  std::vector<Frame> frames_;
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
