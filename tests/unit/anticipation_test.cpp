// How long a world with steps in hand stays on time.
#include "common/anticipation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace soda::anticipation_test {
namespace {

TEST(Anticipation, StepsInHandLastAsLongAsTheFormulaSays) {
  EXPECT_TRUE(std::isinf(steps_on_time(48, 1, 1)));
  EXPECT_TRUE(std::isinf(steps_on_time(0, 1, 0.5)));
  EXPECT_DOUBLE_EQ(steps_on_time(48, 1, 2.5), 80);  // the paper's example: 150 % more
  EXPECT_DOUBLE_EQ(steps_on_time(48, 1, 2), 96);
  EXPECT_DOUBLE_EQ(steps_on_time(0, 1, 2), 0);
  // By counting: shown while there is one, each frame pays for cost^-1 of a step.
  for (const double cost : {1.25, 1.5, 3.0, 4.0}) {
    double computed = 48;
    int shown = 0;
    while (shown + 1 <= computed) ++shown, computed += 1 / cost;
    EXPECT_NEAR(shown, steps_on_time(48, 1, cost), 1 + 1 / (1 - 1 / cost)) << cost;
  }
}

}  // namespace
}  // namespace soda::anticipation_test
