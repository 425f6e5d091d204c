// Pacing: what the displayed step and the limit are, for times and worlds that the test makes up.
#include "server/world/pacer.h"

#include <gtest/gtest.h>

namespace soda::world {
namespace {

constexpr Step kWindow = 48, kLead = 4, kLast = 1000;

Pacer::Order order(Step displayed) { return {displayed, displayed + kWindow, displayed + kLead}; }

TEST(Pacer, FollowsTheClockWhereWorldsKeepUp) {
  Pacer pacer(60, kWindow, kLead, kLast);
  EXPECT_EQ(pacer.at(100.0, 0), order(0));
  EXPECT_EQ(pacer.at(100.5, 40), order(30));
  EXPECT_EQ(pacer.at(101.0, 90), order(60));
}

TEST(Pacer, IsSlowMotionWhereTheyDoNot) {
  Pacer pacer(60, kWindow, kLead, kLast);
  pacer.at(0, 0);
  EXPECT_EQ(pacer.at(1.0, 10), order(10));
  // The time lost is not caught up with: from step 10 on in real time.
  EXPECT_EQ(pacer.at(1.5, 500), order(40));
}

TEST(Pacer, DoesNotPassTheLastStep) {
  Pacer pacer(60, kWindow, kLead, 20);
  pacer.at(0, 0);
  EXPECT_EQ(pacer.at(10.0, 20).displayed, 20);
}

TEST(Pacer, KeepsFractionsOfSteps) {
  Pacer pacer(60, kWindow, kLead, kLast);
  Step displayed = 0;
  for (int i = 0; i <= 1000; ++i) displayed = pacer.at(0.001 * i, kLast).displayed;
  EXPECT_NEAR(static_cast<double>(displayed), 60, 1);
}

TEST(Pacer, MaxHasNoLimitAndNobodyWaitsForIt) {
  Pacer pacer(0, kWindow, kLead, kLast);
  EXPECT_EQ(pacer.at(0, 0), (Pacer::Order{0, kNoLimit, 4 * kWindow}));
  EXPECT_EQ(pacer.at(1, 17), (Pacer::Order{17, kNoLimit, 17 + 4 * kWindow}));
}

TEST(Pacer, PausesAndGoesOnStepByStep) {
  Pacer pacer(60, kWindow, kLead, kLast);
  pacer.at(0, 0);
  EXPECT_EQ(pacer.at(0.5, 100), order(30));
  pacer.pause();
  EXPECT_EQ(pacer.at(7, 100), order(30));
  pacer.step(3);
  EXPECT_EQ(pacer.at(7.1, 32), order(32));  // the worlds are not further
  EXPECT_EQ(pacer.at(7.2, 100), order(33));
  EXPECT_EQ(pacer.at(9, 100), order(33));
  pacer.resume();
  EXPECT_EQ(pacer.at(9.5, 100), order(63));  // the pause is not caught up with
}

TEST(Pacer, ChangesItsRate) {
  Pacer pacer(60, kWindow, kLead, kLast);
  pacer.at(0, 0);
  EXPECT_EQ(pacer.at(0.5, 100), order(30));
  pacer.set_rate(120);
  EXPECT_EQ(pacer.at(1, 100), order(90));
  pacer.set_rate(0);
  EXPECT_EQ(pacer.at(1.1, 150), (Pacer::Order{150, kNoLimit, 150 + 4 * kWindow}));
  pacer.set_rate(60);
  // What is closed stays closed.
  EXPECT_EQ(pacer.at(2.1, 400), (Pacer::Order{210, 210 + kWindow, 150 + 4 * kWindow}));
}

}  // namespace
}  // namespace soda::world
