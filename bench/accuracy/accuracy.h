// The accuracy suite: scenes whose true course is known, run with many step settings on our step and on stock Bullet,
// so that no speed is told without the error that it was bought with.
//
// An error is computed from states of bodies alone: the same code looks at both sides.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/body_state.h"
#include "common/scene/scene.h"

namespace soda::bench {

using Bodies = std::span<const BodyState>;  // all dynamic bodies of the scene, in its order

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();
constexpr double kNoLimit = std::numeric_limits<double>::quiet_NaN();  // told, but does not decide

// One number that a case yields; smaller is better.
struct Measure {
  const char* name;  // of the column, with the unit where it has one: "drift_m"
  const char* what;  // in words
  double limit = kNoLimit;
};

// Watches one run.
class Probe {
 public:
  virtual ~Probe() = default;
  // The states after `time` seconds; first at 0. False: there is nothing more to learn, the run may end.
  virtual bool look(double time, Bodies bodies) = 0;
  // One for each of the case's measures; kNotMeasured where the variant has none.
  virtual std::vector<double> errors() const = 0;
};

// One scene of a case.
struct Variant {
  std::string name;  // for column and key: no blanks, commas or dots
  double seconds;    // simulated
  // The runner sets dt and sub-steps, and switches sleeping off. (dt is told because a scene may be laid out by it.)
  std::function<Scene(double dt)> scene;
  std::function<std::unique_ptr<Probe>(const Scene& scene)> probe;
};

struct Case {
  const char* id;
  const char* name;
  std::vector<Measure> measures;  // the first with a limit is the one that pictures and headlines show
  std::vector<Variant> variants;  // all must be within the limits
  std::vector<std::uint32_t> substeps = {0, 2, 4, 8, 16, 32};  // 0: chosen for each island
  double most_substeps = 4000;       // per simulated second: settings beyond cost more than they tell
  double smallest_dt_bullet = 1e-3;  // s, likewise

  // s: there must be settings within the limits at each of these steps; empty: at any.
  std::vector<double> judged_at = {};
  double goal_ms =
      kNoLimit;  // CPU ms per simulated second that it should cost at most; depends on the machine, so told only

  std::size_t main_measure() const;
};

// What one setting makes of a case, or of a variant.
struct Outcome {
  std::vector<double> errors;  // as the measures: of a case the worst of its variants
  double cost_ms = 0;          // CPU ms per simulated second: of a case that of the dearest variant
  bool finite = true;          // all states were

  // How far beyond the limits: at most 1 passes. Infinite where not finite.
  double score(const Case& c) const;
  bool passes(const Case& c) const { return score(c) <= 1; }
};

struct Setting {
  bool bullet = false;
  double dt = 0;               // s
  std::uint32_t substeps = 0;  // 0: chosen for each island, or Bullet
};

struct Result {
  Setting setting;
  Outcome all;
  std::vector<Outcome> variants;
};

// run.cpp
Outcome run(const Variant& variant, const Setting& setting);
Result run(const Case& c, const Setting& setting);

// The cases, by theme: one file each.
std::vector<Case> free_cases();      // A1, A2
std::vector<Case> bounce_cases();    // A4, A7, A8, A16
std::vector<Case> friction_cases();  // A5, A6
std::vector<Case> stack_cases();     // A11, A12
std::vector<Case> masonry_cases();   // A13, A14
std::vector<Case> heap_cases();      // A18, A19
std::vector<Case> far_cases();       // A20
std::vector<Case> joint_cases();     // A3, A9, A10, A15
std::vector<Case> all_cases();       // by number

}  // namespace soda::bench
