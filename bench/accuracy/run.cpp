// One run of one side with one setting.
#include <algorithm>
#include <cmath>

#include "bench/accuracy/accuracy.h"
#include "bench/bullet_world.h"
#include "common/cpu_clock.h"
#include "server/physics/stepper.h"

namespace soda::bench {
namespace {

class SodaSide {
 public:
  explicit SodaSide(const Scene& scene) : model_(scene), stepper_(model_), set_(model_.initial_state()) {}
  void step() { stepper_.step(set_); }
  Bodies bodies() { return set_.bodies; }

 private:
  physics::Model model_;
  physics::Stepper stepper_;
  BodySet set_;
};

class BulletSide {
 public:
  explicit BulletSide(const Scene& scene) : world_(scene) {}
  void step() { world_.step(); }
  Bodies bodies() {
    world_.read(states_);
    return states_;
  }

 private:
  BulletWorld world_;
  std::vector<BodyState> states_;
};

bool all_finite(Bodies bodies) {
  double sum = 0;
  for (const BodyState& body : bodies) sum += body.x().sum() + body.v().sum() + body.w().sum();
  return std::isfinite(sum);
}

// Short runs are done again without a probe, until there is something to measure; both sides are deterministic.
constexpr double kMeasurable = 0.05;  // s of CPU time
constexpr double kOnceIsEnough = 0.5;

template <typename Side>
double seconds_without_probe(const Scene& scene, long steps) {
  double seconds = 0;
  int runs = 0;
  do {
    Side side(scene);
    const double start = cpu_seconds();
    for (long i = 0; i < steps; ++i) side.step();
    seconds += cpu_seconds() - start;
  } while (++runs < 200 && seconds < kMeasurable);
  return seconds / runs;
}

template <typename Side>
Outcome run_side(const Variant& variant, const Scene& scene) {
  Outcome outcome;
  const auto probe = variant.probe(scene);
  Side side(scene);
  const long most = std::lround(variant.seconds / scene.dt);
  long steps = 0;
  double seconds = 0;
  bool more = probe->look(0, side.bodies());
  while (more && steps < most) {
    const double start = cpu_seconds();
    side.step();
    seconds += cpu_seconds() - start;
    ++steps;
    const Bodies bodies = side.bodies();
    outcome.finite = all_finite(bodies);
    more = outcome.finite && probe->look(static_cast<double>(steps) * scene.dt, bodies);
  }
  if (seconds < kOnceIsEnough) seconds = seconds_without_probe<Side>(scene, steps);
  outcome.cost_ms = 1e3 * seconds / (static_cast<double>(steps) * scene.dt);
  outcome.errors = probe->errors();
  return outcome;
}

}  // namespace

std::size_t Case::main_measure() const {
  std::size_t m = 0;
  while (std::isnan(measures.at(m).limit)) ++m;
  return m;
}

double Outcome::score(const Case& c) const {
  if (!finite) return std::numeric_limits<double>::infinity();
  double worst = 0;
  for (std::size_t m = 0; m < c.measures.size(); ++m) {
    const double limit = c.measures[m].limit, error = errors[m];
    if (std::isnan(limit) || std::isnan(error) || error <= 0) continue;
    worst = std::max(worst, limit > 0 ? error / limit : 1000 * (1 + error));  // nothing is allowed where it is 0
  }
  return worst;
}

Outcome run(const Variant& variant, const Setting& setting) {
  Scene scene = variant.scene(setting.dt);
  scene.dt = setting.dt;
  scene.substeps = setting.substeps;
  scene.sleeping = false;
  return setting.bullet ? run_side<BulletSide>(variant, scene) : run_side<SodaSide>(variant, scene);
}

Result run(const Case& c, const Setting& setting) {
  Result result{setting, {}, {}};
  result.all.errors.assign(c.measures.size(), kNotMeasured);
  for (const Variant& variant : c.variants) {
    const Outcome& one = result.variants.emplace_back(run(variant, setting));
    result.all.finite = result.all.finite && one.finite;
    result.all.cost_ms = std::max(result.all.cost_ms, one.cost_ms);
    for (std::size_t m = 0; m < c.measures.size(); ++m)
      result.all.errors[m] = std::fmax(result.all.errors[m], one.errors[m]);  // of a number and NaN: the number
  }
  return result;
}

}  // namespace soda::bench
