// The narrow phase against plain geometry: points lie on both surfaces, the normal is (nearly) the axis along which the
// two are furthest apart or overlap least, the deepest point is as deep as the shapes are along it, and nothing that
// overlaps is missed. Random poses of all pairs of shapes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/scene/convex_hull.h"
#include "common/scene/random.h"
#include "physics_scenes.h"
#include "server/physics/detector.h"

namespace soda::physics::test {
namespace {

constexpr Kind kConvex[] = {Kind::kSphere,   Kind::kBox,  Kind::kCapsule,
                            Kind::kCylinder, Kind::kHull, Kind::kTetrahedron};

// A scene of one body of each convex kind, for its shapes.
class Shapes {
 public:
  Shapes() : model_(make()) {}
  const Child& child(Kind kind) const {
    const BodyModel& body =
        model_.bodies()[static_cast<std::size_t>(std::find(std::begin(kConvex), std::end(kConvex), kind) - kConvex)];
    return model_.shapes().children()[body.first_child];
  }
  // m, how far the shape reaches along `direction` in its own frame.
  double reach(Kind kind, const Vec3& direction) const {
    const Child& c = child(kind);
    switch (kind) {
      case Kind::kSphere:
        return c.radius;
      case Kind::kBox:
        return direction.cwiseAbs().dot(c.box_half);
      case Kind::kCapsule:
        return c.radius + c.half_length * std::abs(direction.z());
      case Kind::kCylinder:
        return c.radius * direction.head<2>().norm() + c.half_length * std::abs(direction.z());
      default: {
        double most = -HUGE_VAL;
        for (const Vec3& p : points(kind)) most = std::max(most, direction.dot(p));
        return most;
      }
    }
  }
  // m, above the surface (negative: inside); exact near the surface of everything but edges.
  double height(Kind kind, const Vec3& p) const {
    const Child& c = child(kind);
    switch (kind) {
      case Kind::kSphere:
        return p.norm() - c.radius;
      case Kind::kBox:
        return (p.cwiseAbs() - c.box_half).maxCoeff();
      case Kind::kCapsule:
        return (p - Vec3(0, 0, std::clamp(p.z(), -c.half_length, c.half_length))).norm() - c.radius;
      case Kind::kCylinder:
        return std::max(p.head<2>().norm() - c.radius, std::abs(p.z()) - c.half_length);
      default: {
        const auto& all = points(kind);
        double most = -HUGE_VAL;
        for (const auto& t : convex_hull(all).triangles) {
          const Vec3 n = (all[t[1]] - all[t[0]]).cross(all[t[2]] - all[t[0]]).normalized();
          most = std::max(most, n.dot(p - all[t[0]]));
        }
        return most;
      }
    }
  }

 private:
  static Scene make() {
    SceneBuilder builder("shapes");
    for (const Kind kind : kConvex) add_shape(builder, kind, Vec3::Zero());
    return builder.finish();
  }
  // Relative to the centre of mass, as children are.
  std::vector<Vec3> points(Kind kind) const {
    const auto at = static_cast<std::size_t>(std::find(std::begin(kConvex), std::end(kConvex), kind) - kConvex);
    const Body& body = model_.scene().bodies[at];
    return std::get<ConvexHull>(model_.scene().geometries[body.shapes[0].geometry]).points;
  }
  Model model_;
};

struct Pose2 {
  Placement a, b;
};

class Contacts : public testing::TestWithParam<std::tuple<Kind, Kind>> {
 protected:
  // m, between the two along a unit direction from a to b.
  double separation(const Pose2& at, const Vec3& d) const {
    return d.dot(at.b.position - at.a.position) - shapes.reach(kind_a, at.a.rotation.transpose() * d) -
           shapes.reach(kind_b, at.b.rotation.transpose() * -d);
  }
  // The largest over all directions, by search.
  double best_separation(const Pose2& at, Random& random) const {
    Vec3 best = (at.b.position - at.a.position).normalized();
    double most = separation(at, best);
    const auto consider = [&](const Vec3& d) {
      if (const double s = separation(at, d); s > most) most = s, best = d;
    };
    for (int axis = 0; axis < 3; ++axis)
      for (const double sign : {-1.0, 1.0})
        consider(sign * at.a.rotation.col(axis)), consider(sign * at.b.rotation.col(axis));
    for (int i = 0; i < 300; ++i) consider(random.direction());
    for (double width = 0.3; width > 1e-6; width *= 0.9)
      for (int i = 0; i < 8; ++i) consider((best + width * random.direction()).normalized());
    return most;
  }

  Shapes shapes;
  Kind kind_a = std::get<0>(GetParam()), kind_b = std::get<1>(GetParam());
};

TEST_P(Contacts, AgreeWithGeometry) {
  Random random(static_cast<std::uint64_t>(kind_a) * 100 + static_cast<std::uint64_t>(kind_b));
  Detector detector;
  std::vector<DetectedPoint> points;
  const Child &a = shapes.child(kind_a), &b = shapes.child(kind_b);
  int touching = 0, several = 0, apart = 0;
  for (int trial = 0; trial < 400; ++trial) {
    Pose2 at;
    at.a = {random.between(Vec3::Constant(-10), Vec3::Constant(10)), random.orientation().toRotationMatrix()};
    at.b = {at.a.position, random.orientation().toRotationMatrix()};
    if (trial % 4 == 0) at.b.rotation = at.a.rotation;  // ties
    // Along a random direction until they are `gap` apart along it.
    const Vec3 d = trial % 8 == 0 ? Vec3(at.a.rotation.col(trial / 8 % 3)) : random.direction();
    at.b.position += (random.between(-0.08, 0.05) - separation(at, d)) * d;
    const double max_distance = trial % 3 == 0 ? 0.05 : 0.02, truth = best_separation(at, random);

    detector.detect(a, at.a, b, at.b, max_distance, points);
    // (Corners that look at each other are further apart than along any axis tried: they may count as nearer.)
    if (truth > max_distance && truth < max_distance + 0.02) continue;
    if (truth > max_distance) {
      EXPECT_TRUE(points.empty()) << "trial " << trial << ": " << truth << " m apart";
      ++apart;
      continue;
    }
    if (truth < -1e-3) {
      ASSERT_FALSE(points.empty()) << "trial " << trial << ": they overlap by " << -truth;
    }
    if (points.empty()) continue;
    ++touching;
    several += points.size() > 1;
    // m; tolerances of clipping and of rims that are octagons; any amount where fast bodies get slack. (Deep points may
    // lie inside.)
    const double slack = slack_beside(max_distance) > 0 ? 1 : 0.015;
    double least = HUGE_VAL;
    for (const DetectedPoint& p : points) {
      const double off = slack + std::max(0.0, -p.distance);
      EXPECT_NEAR(p.normal.norm(), 1, 1e-9);
      EXPECT_LE(p.distance, max_distance);
      EXPECT_NEAR(p.normal.dot(p.on_b - p.on_a), p.distance, 1e-9);
      EXPECT_LT(p.normal.cross(p.on_b - p.on_a).norm(), 0.05) << "trial " << trial;  // m, edges that end
      // Points are relative to a's place; on the surfaces but for tolerances of clipping and rounded rims.
      EXPECT_LT(std::abs(shapes.height(kind_a, at.a.rotation.transpose() * p.on_a)), off) << trial;
      EXPECT_LT(std::abs(shapes.height(kind_b, at.b.rotation.transpose() * (p.on_b - (at.b.position - at.a.position)))),
                off)
          << trial;
      least = std::min(least, p.distance);
    }
    const double along = separation(at, points[0].normal);
    EXPECT_GT(least, truth - 0.03) << "trial " << trial << ": there is a better normal";
    EXPECT_GT(least, along - 1e-6) << "trial " << trial << ": deeper than the shapes";
    EXPECT_LT(least, truth + 0.025) << "trial " << trial << ": the deepest place was missed";

    std::vector<DetectedPoint> turned;
    detector.detect(b, at.b, a, at.a, max_distance, turned);
    EXPECT_FALSE(turned.empty() && least < max_distance - 0.01);
  }
  EXPECT_GT(touching, 100);
  EXPECT_GT(apart, 1);
  const bool has_sphere = kind_a == Kind::kSphere || kind_b == Kind::kSphere;
  EXPECT_EQ(several > 0, !has_sphere);
}

INSTANTIATE_TEST_SUITE_P(Pairs, Contacts, testing::Combine(testing::ValuesIn(kConvex), testing::ValuesIn(kConvex)),
                         [](const auto& test) {
                           return std::string(name_of(std::get<0>(test.param))) + "_" +
                                  name_of(std::get<1>(test.param));
                         });

TEST(BoxContacts, FacesGiveFourCornersOfTheirOverlap) {
  const Shapes shapes;
  const Child& box = shapes.child(Kind::kBox);  // .5 x .4 x .3
  Detector detector;
  std::vector<DetectedPoint> points;
  const Placement low{Vec3(3, 4, 5), Mat3::Identity()}, high{Vec3(3.1, 4.1, 5.299), Mat3::Identity()};
  detector.detect(box, low, box, high, 0.02, points);
  ASSERT_EQ(points.size(), 4u);
  Vec3 least = Vec3::Constant(9), most = Vec3::Constant(-9);
  for (const DetectedPoint& p : points) {
    EXPECT_NEAR(p.distance, -0.001, 1e-12);
    EXPECT_EQ(p.normal, Vec3::UnitZ());
    least = least.cwiseMin(p.on_a);
    most = most.cwiseMax(p.on_a);
  }
  EXPECT_LT((least - Vec3(-0.15, -0.1, 0.15)).norm(), 0.003);
  EXPECT_LT((most - Vec3(0.25, 0.2, 0.15)).norm(), 0.003);
}

TEST(BoxContacts, TurnedFacesGiveEightAndCrossedEdgesOne) {
  SceneBuilder builder("cube");
  builder.add(Box{Vec3(1, 1, 1)}, Vec3::Zero());
  const Model model(builder.finish());
  const Child& cube = model.shapes().children()[0];
  Detector detector;
  std::vector<DetectedPoint> points;
  const double quarter = 0.785398163397448;
  detector.detect(cube, {Vec3::Zero(), Mat3::Identity()}, cube,
                  {Vec3(0, 0, 1), rotation_of(Vec3(0, 0, quarter)).toRotationMatrix()}, 0.02, points);
  EXPECT_EQ(points.size(), 8u);
  // One lies on its edge along x, the other on its edge along y.
  detector.detect(cube, {Vec3::Zero(), rotation_of(Vec3(quarter, 0, 0)).toRotationMatrix()}, cube,
                  {Vec3(0, 0, std::sqrt(2.0) - 0.002), rotation_of(Vec3(0, quarter, 0)).toRotationMatrix()}, 0.02,
                  points);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_LT((points[0].normal - Vec3::UnitZ()).norm(), 1e-9);
  EXPECT_NEAR(points[0].distance, -0.002, 1e-9);
  EXPECT_LT((points[0].on_a - Vec3(0, 0, std::sqrt(0.5))).norm(), 1e-9);
}

}  // namespace
}  // namespace soda::physics::test
