// Pacing: what the displayed step and the limit are, for times and worlds that the test makes up.
#include "server/world/pacer.h"

#include <gtest/gtest.h>

namespace soda::world {
namespace {

constexpr Step kWindow = 48, kLast = 1000;

TEST(Pacer, FollowsTheClockWhereWorldsKeepUp) {
  Pacer pacer(60, kWindow, kLast);
  EXPECT_EQ(pacer.at(100.0, 0), (Pacer::Order{0, kWindow}));
  EXPECT_EQ(pacer.at(100.5, 40), (Pacer::Order{30, 30 + kWindow}));
  EXPECT_EQ(pacer.at(101.0, 90), (Pacer::Order{60, 60 + kWindow}));
}

TEST(Pacer, IsSlowMotionWhereTheyDoNot) {
  Pacer pacer(60, kWindow, kLast);
  pacer.at(0, 0);
  EXPECT_EQ(pacer.at(1.0, 10), (Pacer::Order{10, 10 + kWindow}));
  // The time lost is not caught up with: from step 10 on in real time.
  EXPECT_EQ(pacer.at(1.5, 500), (Pacer::Order{40, 40 + kWindow}));
}

TEST(Pacer, DoesNotPassTheLastStep) {
  Pacer pacer(60, kWindow, 20);
  pacer.at(0, 0);
  EXPECT_EQ(pacer.at(10.0, 20).displayed, 20);
}

TEST(Pacer, KeepsFractionsOfSteps) {
  Pacer pacer(60, kWindow, kLast);
  Step displayed = 0;
  for (int i = 0; i <= 1000; ++i) displayed = pacer.at(0.001 * i, kLast).displayed;
  EXPECT_NEAR(static_cast<double>(displayed), 60, 1);
}

TEST(Pacer, MaxHasNoLimitAndLooksAtNobody) {
  Pacer pacer(0, kWindow, kLast);
  EXPECT_EQ(pacer.at(0, 0), (Pacer::Order{0, kNoLimit}));
  EXPECT_EQ(pacer.at(1, 17), (Pacer::Order{17, kNoLimit}));
}

}  // namespace
}  // namespace soda::world
