// Every kind of shape comes to rest on every kind of ground, and stays there: on its surface, not in it.
#include <gtest/gtest.h>

#include <cmath>

#include "physics_scenes.h"

namespace soda::physics::test {
namespace {

enum class Ground { kPlane, kBox, kMesh, kHeightField, kTiltedPlane };
constexpr const char* kGroundNames[] = {"plane", "box", "mesh", "height_field", "tilted_plane"};

constexpr double kSeam = 0.37;  // m, between the triangles' vertices: bodies lie across several

// All have their surface at z = 0 about the origin.
void add_ground(SceneBuilder& builder, Ground ground) {
  constexpr int kSide = 9;
  switch (ground) {
    case Ground::kPlane:
      builder.add_static(Plane{}, Vec3::Zero());
      break;
    case Ground::kTiltedPlane:  // the body frame is tilted one way, the plane in it back again
      builder.add_static(Plane{Vec3(-0.6, 0, 0.8)}, Vec3::Zero(),
                         Quat::FromTwoVectors(Vec3(-0.6, 0, 0.8), Vec3(0, 0, 1)));
      break;
    case Ground::kBox:
      builder.add_ground(20);
      break;
    case Ground::kMesh: {
      TriangleMesh mesh;
      for (int j = 0; j < kSide; ++j)
        for (int i = 0; i < kSide; ++i) mesh.vertices.push_back(Vec3((i - 4) * kSeam, (j - 4) * kSeam, 0));
      for (std::uint32_t j = 0; j + 1 < kSide; ++j)
        for (std::uint32_t i = 0; i + 1 < kSide; ++i) {
          const std::uint32_t a = j * kSide + i;
          mesh.triangles.push_back({a, a + 1, a + kSide + 1});
          mesh.triangles.push_back({a, a + kSide + 1, a + kSide});
        }
      builder.add_static(mesh, Vec3::Zero());
      break;
    }
    case Ground::kHeightField: {
      HeightField field;
      field.columns = field.rows = kSide;
      field.spacing_x = field.spacing_y = kSeam;
      field.heights.assign(kSide * kSide, 0.25);
      builder.add_static(field, Vec3(0, 0, -0.25));
      break;
    }
  }
}

class Rest : public testing::TestWithParam<std::tuple<Kind, Ground>> {};

TEST_P(Rest, SettlesOnTheSurfaceAndStays) {
  const auto [kind, ground] = GetParam();
  SceneBuilder builder("rest");
  builder.scene.sleeping = false;  // it must lie still by itself
  const bool long_one = kind == Kind::kCapsule || kind == Kind::kDumbbell;
  const Quat turn = long_one ? rotation_of(Vec3(1.57, 0, 0.3)) : rotation_of(Vec3(0.1, 0.05, 0.2));
  add_shape(builder, kind, Vec3(0.03, 0.02, 0.6), turn).friction = 0.6;
  add_ground(builder, ground);
  const Scene scene = builder.finish();
  const Model model(scene);
  Stepper stepper(model);
  BodySet set = model.initial_state();
  run(stepper, set, scene, 8);
  const BodyState settled = set.bodies[0];
  EXPECT_GT(set.contacts.size(), 0u);
  EXPECT_LT(settled.x().head<2>().norm(), 0.5) << "thrown aside";

  double fastest = 0, lowest_low = HUGE_VAL, highest_low = -HUGE_VAL;
  for (int t = 0; t < 120; ++t) {
    stepper.step(set);
    const BodyState& b = set.bodies[0];
    fastest = std::max({fastest, b.v().norm(), b.w().norm() * 0.3});
    // The lowest point that is in contact.
    double low = HUGE_VAL;
    for (const ContactRecord& c : set.contacts)
      for (std::uint32_t k = 0; k < c.count; ++k) {
        const double *arm = c.points[k].arm_a, *q = c.orientation_a;
        const Quat turned = b.q() * Quat(q[3], q[0], q[1], q[2]).conjugate();  // since it was found
        const Vec3 point = b.x() + turned * Vec3(arm[0], arm[1], arm[2]);
        low = std::min(low, point.z());
      }
    lowest_low = std::min(lowest_low, low);
    highest_low = std::max(highest_low, low);
  }
  EXPECT_LT(fastest, 0.03);
  EXPECT_GT(lowest_low, -0.003) << "sunk in";
  EXPECT_LT(highest_low, 0.003) << "hovers";
  EXPECT_LT((set.bodies[0].x() - settled.x()).norm(), 0.003) << "creeps";
  EXPECT_LT(set.bodies[0].q().angularDistance(settled.q()), 0.01) << "turns";
  EXPECT_EQ(stepper.counters.non_finite, 0u);
}

TEST_P(Rest, FallsAsleep) {
  const auto [kind, ground] = GetParam();
  SceneBuilder builder("sleep");
  add_shape(builder, kind, Vec3(0.03, 0.02, 0.5), rotation_of(Vec3(1.5, 0, 0.3))).angular_damping = 0.5;
  add_ground(builder, ground);
  const Scene scene = builder.finish();
  const Model model(scene);
  Stepper stepper(model);
  BodySet set = model.initial_state();
  for (int t = 0; t < 900 && !set.bodies[0].asleep(); ++t) stepper.step(set);
  ASSERT_TRUE(set.bodies[0].asleep());
  const BodySet before = set;
  run(stepper, set, scene, 2);
  EXPECT_EQ(first_difference(before, set), "");
}

INSTANTIATE_TEST_SUITE_P(Shapes, Rest,
                         testing::Combine(testing::Values(Kind::kSphere, Kind::kBox, Kind::kCapsule, Kind::kCylinder,
                                                          Kind::kHull, Kind::kTetrahedron, Kind::kTable,
                                                          Kind::kDumbbell),
                                          testing::Values(Ground::kPlane, Ground::kBox, Ground::kMesh,
                                                          Ground::kHeightField, Ground::kTiltedPlane)),
                         [](const auto& test) {
                           return std::string(name_of(std::get<0>(test.param))) + "_on_" +
                                  kGroundNames[static_cast<int>(std::get<1>(test.param))];
                         });

// Slides `kind` over a flat surface of many triangles: its way must be that on a box, without bumps at the seams.
double way_over(Ground ground, Kind kind, double* highest) {
  SceneBuilder builder("slide");
  builder.scene.sleeping = false;
  Body& body = add_shape(builder, kind, Vec3(-1.2, 0.07, 0.1499), Quat::Identity());
  body.linear_velocity = Vec3(3, 0.3, 0);
  body.friction = 0.2;
  add_ground(builder, ground);
  const Scene scene = builder.finish();
  const Model model(scene);
  Stepper stepper(model);
  BodySet set = model.initial_state();
  *highest = 0;
  for (int t = 0; t < 45; ++t) {
    stepper.step(set);
    *highest = std::max(*highest, set.bodies[0].position[2]);
  }
  return set.bodies[0].position[0];
}

TEST(Surfaces, BoxesAndCylindersSlideOverSeamsWithoutCatching) {
  for (const Kind kind : {Kind::kBox, Kind::kCylinder}) {
    double high_box, high;
    const double on_box = way_over(Ground::kBox, kind, &high_box);
    EXPECT_GT(on_box, 0.1);
    for (const Ground ground : {Ground::kMesh, Ground::kHeightField}) {
      EXPECT_NEAR(way_over(ground, kind, &high), on_box, 0.02)
          << name_of(kind) << " on " << kGroundNames[static_cast<int>(ground)];
      EXPECT_LT(high, 0.155);
    }
  }
}

TEST(Surfaces, BallsRollOverSeamsStraightOn) {
  for (const Ground ground : {Ground::kMesh, Ground::kHeightField}) {
    SceneBuilder builder("roll");
    builder.scene.sleeping = false;
    Body& ball = builder.add(Sphere{0.25}, Vec3(-1.2, 0.07, 0.2499));
    ball.linear_velocity = Vec3(2, 0, 0);
    ball.angular_velocity = Vec3(0, 8, 0);
    add_ground(builder, ground);
    const Scene scene = builder.finish();
    const Model model(scene);
    Stepper stepper(model);
    BodySet set = model.initial_state();
    run(stepper, set, scene, 1);
    EXPECT_NEAR(set.bodies[0].position[0], 0.8, 0.01);
    EXPECT_NEAR(set.bodies[0].position[1], 0.07, 1e-3);
    EXPECT_NEAR(set.bodies[0].position[2], 0.25, 1e-3);
  }
}

TEST(Surfaces, RidgesAndRimsHoldBodiesUp) {
  // A roof of two triangles' pairs, ridge along y: a long box lies across it, a ball balanced on it falls to one side.
  SceneBuilder builder("roof");
  builder.scene.sleeping = false;
  TriangleMesh roof;
  roof.vertices = {Vec3(-1, -2, -0.5), Vec3(0, -2, 0), Vec3(1, -2, -0.5),
                   Vec3(-1, 2, -0.5),  Vec3(0, 2, 0),  Vec3(1, 2, -0.5)};
  roof.triangles = {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}};
  builder.add(Box{Vec3(2, 0.2, 0.2)}, Vec3(0.001, -1, 0.11));
  builder.add(Sphere{0.2}, Vec3(0.02, 1, 0.21));
  // The rim of the roof, where there is no neighbour: a box that hangs over it by less than half stays.
  builder.add(Box{Vec3(0.2, 1.0, 0.2)}, Vec3(0, 1.9, 0.11));
  builder.add_static(roof, Vec3::Zero());
  const Scene scene = builder.finish();
  const Model model(scene);
  Stepper stepper(model);
  BodySet set = model.initial_state();
  run(stepper, set, scene, 0.8);
  EXPECT_NEAR(set.bodies[0].position[2], 0.1, 0.01);
  EXPECT_GT(set.bodies[1].position[0], 0.1);
  EXPECT_LT(set.bodies[1].position[2], 0.2);
  EXPECT_GT(set.bodies[1].position[2], -0.3);
  EXPECT_NEAR(set.bodies[2].position[2], 0.1, 0.02);
}

}  // namespace
}  // namespace soda::physics::test
