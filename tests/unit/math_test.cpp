// Our own sine and cosine against the library's in long double, and rotations made of them.
#include "common/math.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/scene/random.h"

namespace soda {
namespace {

TEST(SinCos, AreRightToTheLastDigitsUpToAThousand) {
  Random random(1);
  double worst = 0;
  for (int i = 0; i < 400000; ++i) {
    const double limit = i % 4 == 0 ? 1 : i % 4 == 1 ? 10 : 1000;
    const double x = random.between(-limit, limit);
    double s, c;
    sin_cos(x, s, c);
    worst = std::max(worst, static_cast<double>(std::abs(s - std::sin(static_cast<long double>(x)))));
    worst = std::max(worst, static_cast<double>(std::abs(c - std::cos(static_cast<long double>(x)))));
  }
  EXPECT_LT(worst, 1e-15);
  EXPECT_GT(worst, 0) << "nothing was compared";
}

TEST(SinCos, AreRightNearMultiplesOfAQuarterTurn) {
  for (int k = -600; k <= 600; ++k)
    for (const double offset : {-1e-3, -1e-9, 0.0, 1e-12, 1e-6}) {
      const double x = k * 1.57079632679489661923 + offset;
      double s, c;
      sin_cos(x, s, c);
      EXPECT_NEAR(s, static_cast<double>(std::sin(static_cast<long double>(x))), 1e-15) << x;
      EXPECT_NEAR(c, static_cast<double>(std::cos(static_cast<long double>(x))), 1e-15) << x;
    }
}

TEST(SinCos, StayOnTheUnitCircleFarOut) {
  for (const double x : {1e4, -1e5, 1e6}) {
    double s, c;
    sin_cos(x, s, c);
    EXPECT_NEAR(s * s + c * c, 1, 1e-14);
    EXPECT_NEAR(s, std::sin(x), 1e-9);
  }
}

TEST(Rotation, TurnsByItsVectorAlsoWhereTheSeriesTakesOver) {
  Random random(2);
  for (const double angle : {0.0, 1e-12, 1e-4, 0.00999, 0.01, 0.010001, 0.5, 3.0, 6.0}) {
    const Vec3 axis = random.direction();
    const Quat q = rotation_of(angle * axis);
    EXPECT_NEAR(q.norm(), 1, 1e-15) << angle;
    EXPECT_NEAR(q.w(), std::cos(0.5 * angle), 1e-15) << angle;
    EXPECT_LT((q.vec() - std::sin(0.5 * angle) * axis).norm(), 1e-15) << angle;
  }
}

TEST(Boxes, OverlapWhereTheyTouchAndNotBeyond) {
  const Aabb box{Vec3(0, 0, 0), Vec3(1, 1, 1)};
  EXPECT_TRUE(box.overlaps({Vec3(1, 1, 1), Vec3(2, 2, 2)}));
  EXPECT_TRUE(box.overlaps({Vec3(0.2, 0.2, 0.2), Vec3(0.3, 0.3, 0.3)}));
  for (int axis = 0; axis < 3; ++axis) {
    Aabb other{Vec3::Zero(), Vec3::Ones()};
    other.min[axis] = std::nextafter(1.0, 2.0);
    other.max[axis] = 2;
    EXPECT_FALSE(box.overlaps(other)) << axis;
    EXPECT_FALSE(other.overlaps(box)) << axis;
  }
}

}  // namespace
}  // namespace soda
