// The step does what mechanics says: flight, rolling, friction, stacks, collisions, sleeping, drives, limits.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "physics_scenes.h"
#include "server/physics/tuning.h"

namespace soda::physics::test {
namespace {

constexpr double kG = 9.81;

struct World {
  explicit World(SceneBuilder& builder) : model(builder.finish()), stepper(model), set(model.initial_state()) {}
  explicit World(Scene scene) : model(std::move(scene)), stepper(model), set(model.initial_state()) {}
  void run_for(double seconds) { run(stepper, set, model.scene(), seconds); }
  Model model;
  Stepper stepper;
  BodySet set;
};

TEST(Flight, FollowsTheParabolaExactly) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    SceneBuilder builder("flight");
    builder.scene.dt = dt;
    Body& ball = builder.add(Sphere{0.1}, Vec3(1, 2, 3));
    ball.linear_velocity = Vec3(10, -1, 10);
    Body& box = builder.add(Box{Vec3(0.1, 0.2, 0.3)}, Vec3(-5, 2, 3));  // tumbles, which must not matter
    box.linear_velocity = Vec3(10, -1, 10);
    box.angular_velocity = Vec3(3, 5, -7);
    World world(builder);
    world.run_for(2);
    const double t = 2;
    const Vec3 way = Vec3(10, -1, 10) * t - Vec3(0, 0, 0.5 * kG * t * t);
    EXPECT_LT((world.set.bodies[0].x() - Vec3(1, 2, 3) - way).norm(), 1e-9) << dt;
    EXPECT_LT((world.set.bodies[1].x() - Vec3(-5, 2, 3) - way).norm(), 1e-9) << dt;
    EXPECT_LT((world.set.bodies[0].v() - Vec3(10, -1, 10 - kG * t)).norm(), 1e-9) << dt;
  }
}

TEST(Flight, TumblingKeepsAngularMomentum) {
  SceneBuilder builder("tumble");
  builder.scene.gravity = Vec3::Zero();
  builder.add(Box{Vec3(1, 2, 3)}, Vec3::Zero()).angular_velocity = Vec3(0.01, 5, 0.01);
  World world(builder);
  const Vec3 before = angular_momentum(world.model, world.set);
  const double e0 = energy(world.model, world.set);
  double flipped = 1;
  for (int t = 0; t < 600; ++t) {
    world.stepper.step(world.set);
    flipped = std::min(flipped, (world.set.bodies[0].q() * Vec3(0, 1, 0)).y());
    ASSERT_LT((angular_momentum(world.model, world.set) - before).norm(), 1e-9 * before.norm());
  }
  EXPECT_LT(flipped, -0.9) << "about the middle axis it turns over";
  EXPECT_NEAR(energy(world.model, world.set) / e0, 1, 0.05);
}

TEST(Rolling, ABallRollsWithoutSlowingDown) {
  SceneBuilder builder("roll");
  builder.scene.sleeping = false;
  Body& ball = builder.add(Sphere{0.5}, Vec3(0, 0, 0.5));
  ball.linear_velocity = Vec3(2, 0, 0);
  ball.angular_velocity = Vec3(0, 4, 0);
  builder.add_ground(200);
  World world(builder);
  world.run_for(5);
  EXPECT_NEAR(world.set.bodies[0].position[0], 10, 0.02);
  EXPECT_NEAR(world.set.bodies[0].angular_velocity[1], 4, 0.01);
  EXPECT_GT(world.set.contacts.size(), 0u);
}

TEST(Rolling, ASlidingBallEndsAtFiveSeventhsOfItsSpeed) {
  SceneBuilder builder("slide");
  builder.scene.sleeping = false;
  builder.add(Sphere{0.5}, Vec3(0, 0, 0.5)).linear_velocity = Vec3(3.5, 0, 0);
  builder.add_ground(200);
  World world(builder);
  world.run_for(3);
  EXPECT_NEAR(world.set.bodies[0].linear_velocity[0], 2.5, 0.03);
  EXPECT_NEAR(world.set.bodies[0].angular_velocity[1], 5, 0.06);
}

TEST(Rolling, ACylinderRollsDownAnInclineAtTwoThirdsOfG) {
  SceneBuilder builder("incline");
  builder.scene.sleeping = false;
  builder.scene.gravity = kG * Vec3(std::sin(0.2), 0, -std::cos(0.2));  // a level ground in tilted gravity
  builder.scene.substeps = 4;
  builder.add(Cylinder{0.3, 0.8}, Vec3(0, 0, 0.3), rotation_of(Vec3(0.5 * 3.14159265358979, 0, 0)));
  builder.add_ground(200);
  World world(builder);
  world.run_for(2);
  EXPECT_NEAR(world.set.bodies[0].position[0], 0.5 * (2.0 / 3) * kG * std::sin(0.2) * 4, 0.06);
  EXPECT_NEAR(world.set.bodies[0].position[1], 0, 0.01);
}

// How far a box moves along x in `seconds` on an incline of that angle, friction .5.
double way_on_incline(double angle, double seconds) {
  SceneBuilder builder("incline");
  builder.scene.sleeping = false;
  builder.scene.gravity = kG * Vec3(std::sin(angle), 0, -std::cos(angle));
  builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, 0.5));
  builder.add_ground(200);
  World world(builder);
  world.run_for(seconds);
  return world.set.bodies[0].position[0];
}

TEST(Friction, HoldsBelowTheAngleOfFrictionAndSlidesAboveIt) {
  const double limit = std::atan(0.5);
  EXPECT_LT(std::abs(way_on_incline(0.98 * limit, 5)), 2e-3);
  const double steep = 30 * 3.14159265358979 / 180;
  const double expected = 0.5 * kG * (std::sin(steep) - 0.5 * std::cos(steep)) * 4;
  EXPECT_NEAR(way_on_incline(steep, 2), expected, 0.03 * expected);
}

TEST(Friction, StopsASlidingBoxAfterTheSameWayInAllDirections) {
  const double expected = 25 / (2 * 0.5 * kG);
  for (const double angle : {0.0, 0.3, 0.785398163397448, 1.2}) {
    SceneBuilder builder("slide");
    builder.scene.sleeping = false;
    builder.add(Box{Vec3(1, 1, 0.5)}, Vec3(0, 0, 0.25)).linear_velocity = 5 * Vec3(std::cos(angle), std::sin(angle), 0);
    builder.add_ground(200);
    World world(builder);
    world.run_for(2);
    EXPECT_NEAR(world.set.bodies[0].x().head<2>().norm(), expected, 0.03 * expected) << angle;
    EXPECT_LT(world.set.bodies[0].v().norm(), 0.01);
  }
}

TEST(Stack, TenOfAKindStand) {
  const std::vector<std::pair<const char*, Geometry>> kinds = {
      {"boxes", Box{Vec3(0.5, 0.5, 0.5)}},
      {"cylinders", Cylinder{0.25, 0.5}},
      {"hulls", ConvexHull{{Vec3(.3, .3, .2), Vec3(-.3, .3, .2), Vec3(-.3, -.3, .2), Vec3(.3, -.3, .2),
                            Vec3(.2, .2, -.2), Vec3(-.2, .2, -.2), Vec3(-.2, -.2, -.2), Vec3(.2, -.2, -.2)}}}};
  for (const auto& [name, geometry] : kinds) {
    SceneBuilder builder(name);
    builder.scene.sleeping = false;
    double top = 0;
    for (int i = 0; i < 10; ++i) {
      const double height = std::holds_alternative<ConvexHull>(geometry) ? 0.4 : 0.5;
      builder.add(geometry, Vec3(0, 0, top + 0.5 * height));
      top += height;
    }
    builder.add_ground(200);
    World world(builder);
    const BodySet start = world.set;
    world.run_for(10);
    for (std::size_t i = 0; i < 10; ++i) {
      const Vec3 moved = world.set.bodies[i].x() - start.bodies[i].x();
      EXPECT_LT(moved.head<2>().norm(), 0.03) << name << " " << i;
      EXPECT_GT(moved.z(), -0.06) << name << " " << i;
    }
  }
}

TEST(Stack, AnArchOfHullsStands) {
  // Fifteen wedges over half a circle, thick enough to stand by masonry theory (t/R > .1075).
  constexpr int kWedges = 15;
  constexpr double kRadius = 5, kThickness = 0.2 * kRadius, kDepth = 1, kPi = 3.14159265358979323846;
  SceneBuilder builder("arch");
  builder.scene.sleeping = false;
  for (int i = 0; i < kWedges; ++i) {
    ConvexHull wedge;
    Vec3 centre = Vec3::Zero();
    for (const int side : {0, 1})
      for (const double r : {kRadius - 0.5 * kThickness, kRadius + 0.5 * kThickness})
        for (const double y : {-0.5 * kDepth, 0.5 * kDepth}) {
          const double angle = kPi * (i + side) / kWedges;
          wedge.points.push_back(Vec3(-r * std::cos(angle), y, r * std::sin(angle)));
          centre += wedge.points.back() / 8;
        }
    for (Vec3& p : wedge.points) p -= centre;
    builder.add(wedge, centre).friction = 0.8;
  }
  builder.add_ground(200, 0.8);
  World world(builder);
  const BodySet start = world.set;
  world.run_for(10);
  for (std::size_t i = 0; i < start.bodies.size(); ++i)
    EXPECT_LT((world.set.bodies[i].x() - start.bodies[i].x()).norm(), 0.1) << "wedge " << i;
}

TEST(Collision, KeepsMomentumWithoutGravity) {
  SceneBuilder builder("bunches");
  builder.scene.gravity = Vec3::Zero();
  for (const double side : {-1.0, 1.0})
    for (int i = 0; i < 27; ++i) {
      const Vec3 at(side * 3 + 0.55 * (i % 3), 0.55 * (i / 3 % 3) + 0.1 * side, 0.55 * (i / 9));
      Body& body = i % 4 == 0 ? builder.add(Sphere{0.25}, at) : builder.add(Box{Vec3(.5, .5, .5)}, at);
      body.linear_velocity = Vec3(-4 * side, 0.2, 0);
      body.restitution = i % 2 ? 0.3 : 0;
    }
  World world(builder);
  const Vec3 p = momentum(world.model, world.set), l = angular_momentum(world.model, world.set);
  const double e0 = energy(world.model, world.set);
  std::size_t contacts = 0;
  double scale = 0;
  for (const BodyState& b : world.set.bodies) scale += world.model.find(b.id)->mass * b.v().norm();
  for (int t = 0; t < 180; ++t) {
    world.stepper.step(world.set);
    contacts = std::max(contacts, world.set.contacts.size());
  }
  EXPECT_GT(contacts, 20u);
  EXPECT_LT((momentum(world.model, world.set) - p).norm(), 1e-12 * scale);
  // Inertia in world axes is that of the start of the step: bodies of uneven inertia turn away from it.
  EXPECT_LT((angular_momentum(world.model, world.set) - l).norm(), 5e-5 * scale);
  EXPECT_LT(energy(world.model, world.set), e0);
}

TEST(Collision, ABallBouncesToTheHeightThatRestitutionSays) {
  SceneBuilder builder("bounce");
  builder.scene.sleeping = false;
  Body& ball = builder.add(Sphere{0.1}, Vec3(0, 0, 5.1));
  ball.restitution = 0.8;
  builder.add_ground(200);
  World world(builder);
  double highest = 0;
  bool hit = false;
  for (int t = 0; t < 150; ++t) {
    world.stepper.step(world.set);
    hit = hit || world.set.bodies[0].linear_velocity[2] > 0;
    if (hit) highest = std::max(highest, world.set.bodies[0].position[2] - 0.1);
  }
  EXPECT_NEAR(highest, 0.64 * 5, 0.1);
}

TEST(Collision, FastBallsDoNotTunnelThroughAThinWall) {
  for (const double speed : {20.0, 60.0, 95.0})
    for (int phase = 0; phase < 10; ++phase) {
      SceneBuilder builder("wall");
      builder.scene.gravity = Vec3::Zero();
      Body& ball = builder.add(Sphere{0.05}, Vec3(-5 - 0.1 * phase, 0.1, 0.2));
      ball.linear_velocity = Vec3(speed, 0, 0);
      Body& box = builder.add(Box{Vec3(0.1, 0.1, 0.1)}, Vec3(-5 - 0.1 * phase, 1, 0.2), rotation_of(Vec3(1, 2, 3)));
      box.linear_velocity = Vec3(speed, 0, 0);
      builder.add_static(Box{Vec3(0.02, 4, 4)}, Vec3::Zero());
      World world(builder);
      world.run_for(1);
      EXPECT_LT(world.set.bodies[0].position[0], 0) << speed << " m/s, phase " << phase;
      EXPECT_LT(world.set.bodies[1].position[0], 0) << speed << " m/s, phase " << phase;
    }
}

TEST(Stack, GivesByPartOfWhatItsSpringsWould) {
  // The same four sub-steps, once chosen and once fixed, where springs carry everything.
  const auto sink = [](std::uint32_t substeps) {
    SceneBuilder builder("tower");
    builder.scene.sleeping = false;
    builder.scene.substeps = substeps;
    for (int i = 0; i < 10; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, 0.5 + i));
    builder.add_ground(200);
    World world(builder);
    world.run_for(10);
    EXPECT_GT(world.stepper.shares.solved[2].islands, 590u) << "solved in four";
    return 9.5 - world.set.bodies[9].x().z();
  };
  const double springs = sink(4);
  EXPECT_GT(springs, 0.02);
  EXPECT_NEAR(sink(0), (1 - kCarriedShare) * springs, 0.02 * springs);
}

TEST(Contact, WhatDiesAwayStaysANumber) {
  // Guards a fixed bug: a ball that has stopped at a wall presses it less and less, by parts of a bit, until the
  // reciprocal of that is no number.
  for (const double faint : {1e-200, 1e-307, 1e-309, 5e-324}) {
    SceneBuilder builder("wall");
    builder.scene.sleeping = false;
    builder.add_ground(50, 0.5);
    builder.add_static(Box{Vec3(1, 10, 10)}, Vec3(-1, 0, 0));
    builder.add(Sphere{0.5}, Vec3(0, 0, 0.5));
    World world(builder);
    world.run_for(0.1);
    ASSERT_EQ(world.set.contacts.size(), 2u);
    for (ContactRecord& record : world.set.contacts)
      if (std::abs(record.normal[0]) > 0.5) record.points[0].impulse = faint;
    world.run_for(0.1);
    EXPECT_EQ(world.stepper.counters.non_finite, 0u) << faint;
    EXPECT_NEAR(world.set.bodies[0].x().z(), 0.5, 1e-3) << faint;
  }
}

TEST(Contact, BodiesThatTipOverDoNotSinkIn) {
  // Guards a fixed bug: a contact of one edge was kept while the body turned flat, and its other edge sank 5 cm.
  for (const double degrees : {1.0, 2.0, 4.0, 6.0, 8.0, 9.5, 15.0, 30.0}) {
    SceneBuilder builder("tilt");
    builder.scene.sleeping = false;
    builder.scene.substeps = 4;
    const double angle = degrees * 3.14159265358979 / 180;
    builder.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, 0.5 * (std::cos(angle) + std::sin(angle))),
                rotation_of(Vec3(0, angle, 0)));
    builder.add_ground(200);
    World world(builder);
    double lowest = 0;
    for (int t = 0; t < 120; ++t) {
      world.stepper.step(world.set);
      const BodyState& b = world.set.bodies[0];
      const Mat3 turn = b.q().toRotationMatrix();
      lowest = std::min(lowest, b.position[2] - 0.5 * turn.row(2).cwiseAbs().sum());
    }
    EXPECT_GT(lowest, -0.002) << degrees << " degrees";
  }
}

TEST(Sleep, APileSleepsAndWakesWhereItIsHit) {
  SceneBuilder builder("sleep");
  for (int i = 0; i < 5; ++i) builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(0, 0, 0.25 + 0.5 * i));
  builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(10, 0, 0.25));  // nothing happens to it
  builder.add(Sphere{0.2}, Vec3(0.1, 0, 60));                // comes down after 3.4 s
  builder.add_ground(200);
  World world(builder);
  world.run_for(3);
  for (int i = 0; i < 6; ++i) EXPECT_TRUE(world.set.bodies[i].asleep()) << i;
  EXPECT_FALSE(world.set.bodies[6].asleep());
  const BodyState asleep = world.set.bodies[5];
  world.run_for(0.6);
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(world.set.bodies[i].asleep()) << i;
  EXPECT_TRUE(world.set.bodies[5].asleep());
  EXPECT_EQ(std::memcmp(&asleep, &world.set.bodies[5], sizeof asleep), 0);
  world.run_for(10);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(world.set.bodies[i].asleep()) << i;
}

TEST(Sleep, NothingSleepsInTheAirOrWhereSleepingIsOff) {
  SceneBuilder builder("thrown up");
  builder.add(Sphere{0.2}, Vec3(0, 0, 1)).linear_velocity = Vec3(0, 0, 5);
  builder.add_ground(200);
  World world(builder);
  for (int t = 0; t < 55; ++t) {
    world.stepper.step(world.set);
    ASSERT_FALSE(world.set.bodies[0].asleep());
  }
  SceneBuilder off("off");
  off.scene.sleeping = false;
  off.add(Box{Vec3(1, 1, 1)}, Vec3(0, 0, 0.5));
  off.add_ground(200);
  World awake(off);
  awake.run_for(3);
  EXPECT_FALSE(awake.set.bodies[0].asleep());
}

TEST(Drive, ReachesItsSpeedAndTurnsRoundAtTheBounds) {
  SceneBuilder builder("drive");
  Body& walker = builder.add(Box{Vec3(0.6, 0.6, 0.8)}, Vec3(0, 0, 0.4));
  walker.friction = 0.1;
  Drive drive;
  drive.velocity = Vec3(1.5, 0, 0);
  drive.max_acceleration = 5;
  drive.bounds = Aabb{Vec3(-2, -10, -10), Vec3(2, 10, 10)};
  walker.drive = drive;
  builder.add_ground(200);
  World world(builder);
  double least = 0, most = 0, fastest = 0;
  int turns = 0;
  double before = 0;
  for (int t = 0; t < 900; ++t) {
    world.stepper.step(world.set);
    const BodyState& b = world.set.bodies[0];
    least = std::min(least, b.position[0]);
    most = std::max(most, b.position[0]);
    fastest = std::max(fastest, b.linear_velocity[0]);
    turns += before * b.linear_velocity[0] < 0;
    before = b.linear_velocity[0];
  }
  EXPECT_NEAR(fastest, 1.5, 0.05);
  EXPECT_GE(turns, 4);
  EXPECT_GT(most, 2);
  EXPECT_LT(most, 3);
  EXPECT_LT(least, -2);
  EXPECT_GT(least, -3);
}

TEST(Limits, FasterThanTheLimitIsClampedAndCounted) {
  SceneBuilder builder("fast");
  builder.scene.max_speed = 50;
  builder.scene.gravity = Vec3(0, 0, -1000);
  builder.add(Sphere{0.1}, Vec3::Zero());
  World world(builder);
  world.run_for(0.5);
  EXPECT_NEAR(world.set.bodies[0].v().norm(), 50, 1e-9);
  EXPECT_GT(world.stepper.counters.clamped, 10u);
  // No body travels further in a step than the limit allows.
  const Vec3 x = world.set.bodies[0].x();
  world.stepper.step(world.set);
  EXPECT_LE((world.set.bodies[0].x() - x).norm(), 50 * world.model.scene().dt * (1 + 1e-12));
}

TEST(Limits, NonFiniteResultsAreHeldAndCounted) {
  SceneBuilder builder("nan");
  builder.add(Sphere{0.1}, Vec3(0, 0, 5));
  builder.add(Box{Vec3(1, 1, 1)}, Vec3(10, 0, 0.5));
  builder.add_ground(200);
  World world(builder);
  world.set.bodies[0].angular_velocity[1] = NAN;
  const Vec3 x = world.set.bodies[0].x();
  world.stepper.step(world.set);
  EXPECT_EQ(world.stepper.counters.non_finite, 1u);
  EXPECT_EQ(world.set.bodies[0].x(), x);
  EXPECT_EQ(world.set.bodies[0].v().norm(), 0);
  EXPECT_EQ(world.set.bodies[0].w().norm(), 0);
  world.run_for(1);
  EXPECT_NEAR(world.set.bodies[1].position[2], 0.5, 1e-3);  // a bystander
  EXPECT_LT(world.set.bodies[0].position[2], 5);            // goes on from where it was held
  EXPECT_EQ(world.stepper.counters.non_finite, 1u);
}

TEST(Limits, CoincidentBodiesComeApart) {
  SceneBuilder builder("coincident");
  for (int i = 0; i < 10; ++i) builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(0, 0, 0.3));
  for (int i = 0; i < 5; ++i) builder.add(Sphere{0.2}, Vec3(5, 0, 0.3));
  for (int i = 0; i < 5; ++i) builder.add(Capsule{0.2, 0.4}, Vec3(10, 0, 0.5));
  builder.add_ground(200);
  World world(builder);
  world.run_for(5);
  EXPECT_EQ(world.stepper.counters.non_finite, 0u);
  for (const BodyState& b : world.set.bodies) {
    EXPECT_TRUE(std::isfinite(b.x().sum()));
    EXPECT_LT(b.x().norm(), 60);
    EXPECT_GT(b.position[2], 0.05);
  }
}

TEST(Place, TheSameFarFromTheOrigin) {
  const auto final_state = [](double away) {
    SceneBuilder builder("far");
    builder.scene.sleeping = false;
    for (int i = 0; i < 3; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(away + 0.1 * i, away, 0.5 + i));
    builder.add_static(Box{Vec3(20, 20, 2)}, Vec3(away, away, -1));
    World world(builder);
    world.run_for(3);
    return world.set;
  };
  const BodySet near = final_state(0), far = final_state(1 << 20);  // a power of two: the same numbers but for rounding
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT((far.bodies[i].x() - Vec3(1 << 20, 1 << 20, 0) - near.bodies[i].x()).norm(), 1e-6) << i;
}

}  // namespace
}  // namespace soda::physics::test
