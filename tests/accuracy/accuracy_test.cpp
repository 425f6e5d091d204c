// Every case of the accuracy suite at one setting of the step: within its limits, and with the same bits where borders
// cut through it. soda-bench accuracy measures all settings, and what they cost.
#include "bench/accuracy/accuracy.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/grid.h"
#include "tests/simulation/scenario.h"
#include "tests/simulation/simulated_session.h"

namespace soda::bench {
namespace {

// A setting that is known to be within the limits.
struct Chosen {
  const char* id;
  double rate;  // Hz
  std::uint32_t substeps;
  bool meets;  // in it bodies of several worlds touch, or are joined
};
constexpr Chosen kChosen[] = {
    {"A1", 60, 4, false},  {"A2", 60, 4, false},  {"A3", 60, 4, false},  {"A4", 60, 4, false},   {"A5", 60, 4, false},
    {"A6", 60, 8, true},   {"A7", 60, 4, false},  {"A8", 60, 4, false},  {"A9", 60, 16, false},  {"A10", 240, 8, true},
    {"A11", 60, 32, true}, {"A12", 60, 16, true}, {"A13", 60, 8, true},  {"A14", 120, 4, true},  {"A15", 60, 4, false},
    {"A16", 60, 2, false}, {"A18", 60, 8, true},  {"A19", 60, 16, true}, {"A20", 60, 16, false},
};
void PrintTo(const Chosen& c, std::ostream* out) { *out << c.id; }

const Case& case_of(const std::string& id) {
  static const std::vector<Case> all = all_cases();
  const auto at = std::find_if(all.begin(), all.end(), [&](const Case& c) { return id == c.id; });
  if (at == all.end()) throw std::invalid_argument("no case " + id);
  return *at;
}

class Accuracy : public testing::TestWithParam<Chosen> {};

TEST_P(Accuracy, IsWithinTheLimits) {
  const Case& c = case_of(GetParam().id);
  for (const Variant& variant : c.variants) {
    const Outcome outcome = run(variant, {false, 1 / GetParam().rate, GetParam().substeps});
    EXPECT_TRUE(outcome.finite);
    ASSERT_EQ(outcome.errors.size(), c.measures.size());
    for (std::size_t m = 0; m < c.measures.size(); ++m)
      if (outcome.errors[m] > c.measures[m].limit)  // neither where there is none
        ADD_FAILURE() << variant.name << ": " << c.measures[m].name << " " << outcome.errors[m] << " > "
                      << c.measures[m].limit;
  }
}

// The first two seconds; longer would find no other border. Islands choose their sub-steps, and remember how stiff they
// were.
TEST_P(Accuracy, HasTheSameBitsWhereBordersCutThroughIt) {
  const Case& c = case_of(GetParam().id);
  std::uint64_t mixed = 0, sessions = 0;
  for (const Variant& variant : c.variants) {
    const double dt = 1 / GetParam().rate;
    Scene scene = variant.scene(dt);
    scene.dt = dt;
    scene.sleeping = false;
    if (GetParam().meets) scene.max_speed = std::min(scene.max_speed, 30.0);  // cells are as wide as a step is long
    scene.territory_cell = std::max(scene.max_speed * dt, 0.5);
    const Step steps = std::min<Step>(std::lround(variant.seconds / dt), std::lround(2 / dt));
    const auto expected = test::run_single(scene, steps);
    const auto cells = make_grid(scene).cells();
    for (const WorldId worlds : {2u, 4u, 8u}) {
      if (cells < worlds) continue;
      test::NetworkSettings network;
      network.seed = worlds;
      const auto got = test::run_session(scene, worlds, steps, network, test::confetti(scene, worlds, worlds));
      ASSERT_EQ(got.failure, "") << variant.name << ", " << worlds << " worlds";
      ASSERT_EQ(test::first_difference(expected, got.steps), "") << variant.name << ", " << worlds << " worlds";
      mixed += got.total.mixed_islands;
      ++sessions;
    }
  }
  if (GetParam().meets) {
    EXPECT_GT(sessions, 0u);
    EXPECT_GT(mixed, 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Suite, Accuracy, testing::ValuesIn(kChosen),
                         [](const auto& one) { return std::string(one.param.id); });

TEST(Suite, TestsEveryCaseThereIs) {
  EXPECT_EQ(all_cases().size(), std::size(kChosen));
  for (const Case& c : all_cases())
    EXPECT_TRUE(std::any_of(std::begin(kChosen), std::end(kChosen), [&](const Chosen& k) {
      return std::string(k.id) == c.id;
    })) << c.id;
}

}  // namespace
}  // namespace soda::bench
