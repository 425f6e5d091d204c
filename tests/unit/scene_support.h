// Scenes for the tests of storage and checks.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <filesystem>
#include <string>

#include "common/scene/scene_builder.h"
#include "common/scene/validate.h"

namespace soda::test {

inline std::filesystem::path data_file(const std::string& name) { return std::filesystem::path(SODA_TEST_DATA) / name; }

// A folder that goes away with the object.
struct TemporaryFolder {
  std::filesystem::path path;
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "soda_test_XXXXXX").string();
    if (!mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
    path = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
};

// A scene with every kind of geometry and numbers that are easily lost: negative zero, thirds, the smallest double.
inline Scene every_kind() {
  SceneBuilder builder("every kind, \"quoted\" \xc3\xa9");
  builder.scene.gravity = Vec3(-0.0, 1.0 / 3, -9.81);
  builder.scene.dt = 1.0 / 240;
  builder.scene.sleeping = false;
  builder.scene.territory_cell = 3.7;
  Body& ball = builder.add(Sphere{0.1}, Vec3(1.0 / 3, -0.0, 5e-324), Quat(0.5, -0.5, 0.5, -0.5));
  ball.name = "ball";
  ball.linear_velocity = Vec3(-0.0, 0.0, 0.1);
  ball.angular_velocity = Vec3(1e-300, -2, 3);
  ball.linear_damping = 0.01;
  Body& walker = builder.add(Box{Vec3(0.1, 0.2, 0.3)}, Vec3(2, 0, 0));
  walker.drive = Drive{Vec3(1.4, -0.0, 0), 5, Aabb{Vec3(-1, -2, -3), Vec3(1, 2, 3)}};
  walker.colour = 0;
  Body& pusher = builder.add(Capsule{0.1, 0.7}, Vec3(4, 0, 0));
  pusher.drive = Drive{Vec3(0, 0.7, 0), 2, {}};
  builder.add(Cylinder{0.3, 0.1}, Vec3(6, 0, 0)).restitution = 1;
  ConvexHull hull;
  for (int i = 0; i < 8; ++i) hull.points.emplace_back(i & 1 ? 0.1 : -0.3, i & 2 ? 0.7 : -1.0 / 7, i & 4 ? 1 : 0);
  builder.add(hull, Vec3(8, 0, 0)).name = "hull";
  Body& compound = builder.add(Box{Vec3(1, 1, 1)}, Vec3(10, 0, 0));
  compound.shapes.push_back({builder.geometry(Sphere{0.1}), Pose{Vec3(0, 0, 1.0 / 3), Quat(0, 1, 0, 0)}});
  Body& lift = builder.add(Box{Vec3(1, 1, 1)}, Vec3(12, 0, 0));
  lift.motion = PrescribedMotion{Vec3(-0.0, 1.0 / 3, 1), Vec3(0, -0.0, 0.7), 1.0 / 7, -0.1, Vec3(5e-324, 0, 1)};
  Body& upright = builder.add(Box{Vec3(1, 1, 1)}, Vec3(14, 0, 0));
  upright.fixed_rotation = true;
  upright.collision_groups = 0x80000001;
  upright.collision_mask = 0;
  builder.add_static(Plane{Vec3(0, 0.6, 0.8)}, Vec3(0, 0, -1)).friction = 0;
  builder.add_static(TriangleMesh{{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0.1)}, {{0, 1, 2}}}, Vec3(0, 5, 0));
  builder.add_static(HeightField{2, 3, 0.5, 0.25, {0, 0.1, 0.2, 0.3, -0.4, 0.5}}, Vec3(0, 9, 0));
  builder.add_ground(50);
  return builder.finish();
}

inline bool same_bits(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }
template <class Vector>
bool same_bits_of(const Vector& a, const Vector& b) {
  for (int i = 0; i < a.size(); ++i)
    if (!same_bits(a.data()[i], b.data()[i])) return false;
  return true;
}

inline void expect_same_bits(const Joint& a, const Joint& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.kind, b.kind);
  EXPECT_TRUE(a.a == b.a && a.b == b.b && a.bodies_collide == b.bodies_collide);
  for (const auto& [l, r] : {std::pair{a.frame_a, b.frame_a}, std::pair{a.frame_b, b.frame_b}}) {
    EXPECT_TRUE(same_bits_of(l.position, r.position));
    EXPECT_TRUE(same_bits_of(l.orientation.coeffs(), r.orientation.coeffs()));
  }
  ASSERT_TRUE(a.limits.has_value() == b.limits.has_value() && a.cone_limit.has_value() == b.cone_limit.has_value() &&
              a.motor.has_value() == b.motor.has_value() && a.spring.has_value() == b.spring.has_value());
  if (a.limits) {
    EXPECT_TRUE(same_bits(a.limits->lower, b.limits->lower) && same_bits(a.limits->upper, b.limits->upper));
  }
  if (a.cone_limit) {
    EXPECT_TRUE(same_bits(*a.cone_limit, *b.cone_limit));
  }
  if (a.motor) {
    EXPECT_TRUE(same_bits(a.motor->target_velocity, b.motor->target_velocity) &&
                same_bits(a.motor->max_effort, b.motor->max_effort));
  }
  if (a.spring) {
    EXPECT_TRUE(same_bits(a.spring->frequency, b.spring->frequency) &&
                same_bits(a.spring->damping_ratio, b.spring->damping_ratio));
  }
}

// Field by field, so that it does not rest on the encoding under test.
inline void expect_same_bits(const Scene& a, const Scene& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_TRUE(same_bits_of(a.gravity, b.gravity));
  EXPECT_TRUE(same_bits(a.dt, b.dt) && same_bits(a.max_speed, b.max_speed) &&
              same_bits(a.territory_cell, b.territory_cell));
  EXPECT_EQ(a.substeps, b.substeps);
  EXPECT_EQ(a.joint_method, b.joint_method);
  ASSERT_EQ(a.territories.size(), b.territories.size());
  for (std::size_t i = 0; i < a.territories.size(); ++i) {
    EXPECT_EQ(a.territories[i].world, b.territories[i].world);
    EXPECT_EQ(a.territories[i].region.min, b.territories[i].region.min);
    EXPECT_EQ(a.territories[i].region.max, b.territories[i].region.max);
  }
  EXPECT_EQ(a.sleeping, b.sleeping);
  ASSERT_EQ(a.geometries.size(), b.geometries.size());
  for (std::size_t g = 0; g < a.geometries.size(); ++g) EXPECT_EQ(a.geometries[g].index(), b.geometries[g].index());
  ASSERT_EQ(a.bodies.size(), b.bodies.size());
  for (std::size_t i = 0; i < a.bodies.size(); ++i) {
    const Body &l = a.bodies[i], &r = b.bodies[i];
    SCOPED_TRACE(label_of(l));
    EXPECT_EQ(l.id, r.id);
    EXPECT_EQ(l.name, r.name);
    EXPECT_EQ(l.is_static, r.is_static);
    EXPECT_EQ(l.colour, r.colour);
    EXPECT_TRUE(same_bits_of(l.pose.position, r.pose.position));
    EXPECT_TRUE(same_bits_of(l.pose.orientation.coeffs(), r.pose.orientation.coeffs()));
    EXPECT_TRUE(same_bits_of(l.linear_velocity, r.linear_velocity));
    EXPECT_TRUE(same_bits_of(l.angular_velocity, r.angular_velocity));
    EXPECT_TRUE(same_bits(l.friction, r.friction) && same_bits(l.restitution, r.restitution));
    EXPECT_TRUE(same_bits(l.linear_damping, r.linear_damping) && same_bits(l.angular_damping, r.angular_damping));
    EXPECT_TRUE(same_bits(l.inertial.mass, r.inertial.mass) && same_bits(l.joint_reach, r.joint_reach));
    EXPECT_TRUE(same_bits_of(l.inertial.centre, r.inertial.centre));
    EXPECT_TRUE(same_bits_of(l.inertial.inertia, r.inertial.inertia));
    ASSERT_EQ(l.shapes.size(), r.shapes.size());
    for (std::size_t s = 0; s < l.shapes.size(); ++s) {
      EXPECT_EQ(l.shapes[s].geometry, r.shapes[s].geometry);
      EXPECT_TRUE(same_bits_of(l.shapes[s].pose.position, r.shapes[s].pose.position));
      EXPECT_TRUE(same_bits_of(l.shapes[s].pose.orientation.coeffs(), r.shapes[s].pose.orientation.coeffs()));
    }
    EXPECT_EQ(l.fixed_rotation, r.fixed_rotation);
    EXPECT_TRUE(l.collision_groups == r.collision_groups && l.collision_mask == r.collision_mask);
    ASSERT_EQ(l.motion.has_value(), r.motion.has_value());
    if (l.motion) {
      EXPECT_TRUE(same_bits_of(l.motion->velocity, r.motion->velocity));
      EXPECT_TRUE(same_bits_of(l.motion->amplitude, r.motion->amplitude));
      EXPECT_TRUE(same_bits(l.motion->frequency, r.motion->frequency) && same_bits(l.motion->phase, r.motion->phase));
      EXPECT_TRUE(same_bits_of(l.motion->angular_velocity, r.motion->angular_velocity));
    }
    ASSERT_EQ(l.drive.has_value(), r.drive.has_value());
    if (!l.drive) continue;
    EXPECT_TRUE(same_bits_of(l.drive->velocity, r.drive->velocity));
    EXPECT_TRUE(same_bits(l.drive->max_acceleration, r.drive->max_acceleration));
    ASSERT_EQ(l.drive->bounds.has_value(), r.drive->bounds.has_value());
    if (l.drive->bounds) {
      EXPECT_TRUE(same_bits_of(l.drive->bounds->min, r.drive->bounds->min));
      EXPECT_TRUE(same_bits_of(l.drive->bounds->max, r.drive->bounds->max));
    }
  }
  ASSERT_EQ(a.joints.size(), b.joints.size());
  for (std::size_t j = 0; j < a.joints.size(); ++j) {
    SCOPED_TRACE("joint " + std::to_string(j));
    expect_same_bits(a.joints[j], b.joints[j]);
  }
}

}  // namespace soda::test
