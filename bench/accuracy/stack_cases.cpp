// A11, A12: cubes on top of each other that should stay where they are.
#include <algorithm>
#include <cmath>

#include "bench/accuracy/measures.h"
#include "common/scene/scene_builder.h"

namespace soda::bench {
namespace {

// Cubes of 1 m and 1 kg, the topmost of another mass.
Scene stack(int cubes, double top) {
  SceneBuilder builder("stack");
  const Box cube{Vec3(1, 1, 1)};
  for (int i = 0; i < cubes; ++i)
    builder.add(cube, Vec3(0, 0, i + 0.5)).inertial = with_mass(mass_of(cube, 1), i + 1 < cubes ? 1 : top);
  builder.add_ground(200);
  return builder.finish();
}

// How far the cubes get from where they are put, until the stack has fallen: one of them is half an edge away.
class StackProbe : public Probe {
 public:
  explicit StackProbe(const Scene& scene) : starts_(dynamic_bodies(scene)), energy_(scene) {}
  bool look(double, Bodies bodies) override {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Displacement d = displacement(*starts_[i], bodies[i]);
      aside_ = std::max(aside_, d.aside);
      down_ = std::max(down_, d.down);
      total_ = std::max(total_, d.total);
    }
    energy_.look(bodies);
    return total_ < kFallen;
  }
  std::vector<double> errors() const override { return {aside_, down_, total_, energy_.rise()}; }

  static constexpr double kFallen = 0.5;  // m

 private:
  std::vector<const Body*> starts_;
  EnergyWatch energy_;
  double aside_ = 0, down_ = 0, total_ = 0;
};

Variant stack_variant(const std::string& name, double seconds, int cubes, double top) {
  return {name, seconds, [cubes, top](double) { return stack(cubes, top); },
          [](const Scene& scene) { return std::make_unique<StackProbe>(scene); }};
}

}  // namespace

std::vector<Case> stack_cases() {
  Case stacks{.id = "A11",
              .name = "stacks",
              .measures = {{"drift_m", "largest way aside of a cube", 0.01},
                           {"sink_m", "largest way down of a cube, against 1 % of its edge", 0.01},
                           {"moved_m", "largest way of a cube; half an edge has fallen", StackProbe::kFallen},
                           {"energy_rise", "largest rise of energy, relative", 0.01}},
              .variants = {}};
  for (const int cubes : {10, 20, 40}) stacks.variants.push_back(stack_variant(std::to_string(cubes), 60, cubes, 1));
  Case ratios{.id = "A12",
              .name = "mass ratios",
              .measures = {{"drift_m", "largest way aside of a cube"},
                           {"sink_m", "largest way down of a cube"},
                           {"moved_m", "largest way of a cube; half an edge has fallen", StackProbe::kFallen},
                           {"energy_rise", "largest rise of energy, relative", 0.01}},
              .variants = {}};
  for (const int light : {1, 4})
    for (const int ratio : {10, 100, 1000})
      ratios.variants.push_back(
          stack_variant(std::to_string(ratio) + "_on_" + std::to_string(light), 10, light + 1, ratio));
  stacks.goal_ms = 20;
  stacks.most_substeps = 2000;
  ratios.goal_ms = 5;
  return {stacks, ratios};
}

}  // namespace soda::bench
