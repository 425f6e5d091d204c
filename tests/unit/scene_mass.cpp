// Convex hulls and mass properties against what is known.
#include <gtest/gtest.h>

#include "common/scene/convex_hull.h"
#include "common/scene/extent.h"
#include "common/scene/mass_properties.h"
#include "common/scene/random.h"

namespace soda {
namespace {

std::vector<Vec3> box_corners(const Vec3& low, const Vec3& high) {
  std::vector<Vec3> points;
  for (int i = 0; i < 8; ++i)
    points.emplace_back(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(), i & 4 ? high.z() : low.z());
  return points;
}

// Closed, turned outwards, and with no point outside by more than `tolerance` m.
void expect_hull(const std::vector<Vec3>& points, const HullMesh& mesh, double tolerance) {
  ASSERT_FALSE(mesh.triangles.empty());
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const auto& t : mesh.triangles) {
    const Vec3 a = points[t[0]], normal = (points[t[1]] - a).cross(points[t[2]] - a).normalized();
    for (const Vec3& p : points) ASSERT_LE(normal.dot(p - a), tolerance);
    for (int e = 0; e < 3; ++e) edges.emplace_back(t[e], t[(e + 1) % 3]);
  }
  std::sort(edges.begin(), edges.end());
  EXPECT_EQ(std::adjacent_find(edges.begin(), edges.end()), edges.end());
  for (const auto& [from, to] : edges) EXPECT_TRUE(std::binary_search(edges.begin(), edges.end(), std::pair(to, from)));
}

TEST(SceneHull, BoxWithPointsOnFacesAndEdges) {
  std::vector<Vec3> points;
  for (int x = 0; x <= 4; ++x)
    for (int y = 0; y <= 4; ++y)
      for (int z = 0; z <= 4; ++z) points.emplace_back(0.25 * x, 0.5 * y, 0.1 * z);
  const HullMesh mesh = convex_hull(points);
  expect_hull(points, mesh, 1e-12);
  EXPECT_EQ(mesh.corners.size(), 8u);
}

TEST(SceneHull, RandomPointsManyTimes) {
  Random random(5);
  for (int round = 0; round < 200; ++round) {
    std::vector<Vec3> points;
    const std::uint32_t n = 4 + random.below(60);
    const bool on_lattice = round % 2 == 0;  // many in one plane, on one line, or in one place
    for (std::uint32_t i = 0; i < n; ++i) {
      Vec3 p = random.between(Vec3::Constant(-1), Vec3::Constant(1));
      if (on_lattice) p = Vec3(std::round(2 * p.x()), std::round(2 * p.y()), std::round(2 * p.z()));
      points.push_back(p);
    }
    const HullMesh mesh = convex_hull(points);
    if (mesh.triangles.empty()) continue;  // flat, which a lattice may be
    expect_hull(points, mesh, 1e-5);
    const std::vector<Vec3> corners = hull_corners(points);
    EXPECT_EQ(corners, hull_corners(corners));
  }
}

TEST(SceneHull, SphereOfManyPoints) {
  Random random(6);
  std::vector<Vec3> points;
  for (int i = 0; i < 3000; ++i) points.push_back(random.direction());
  const HullMesh mesh = convex_hull(points);
  EXPECT_GT(mesh.corners.size(), 2900u);
  EXPECT_EQ(mesh.triangles.size(), 2 * mesh.corners.size() - 4);  // Euler
  const Inertial i = mass_of(ConvexHull{points}, 1);
  EXPECT_NEAR(i.mass, 4.18879, 0.02);
}

TEST(SceneHull, FlatAndFewPointsHaveNone) {
  EXPECT_TRUE(convex_hull({}).triangles.empty());
  EXPECT_TRUE(hull_corners({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}).empty());
  EXPECT_TRUE(hull_corners({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(1, 1, 0), Vec3(0.5, 0.5, 0)}).empty());
  EXPECT_TRUE(hull_corners(std::vector<Vec3>(10, Vec3(1, 2, 3))).empty());
  EXPECT_TRUE(hull_corners({Vec3(0, 0, 0), Vec3(1, 1, 1), Vec3(2, 2, 2), Vec3(3, 3, 3)}).empty());
}

TEST(SceneHull, FarFromTheOrigin) {
  const auto corners = hull_corners(box_corners(Vec3(1e6, 1e6, 1e6), Vec3(1e6 + 1, 1e6 + 1, 1e6 + 1)));
  EXPECT_EQ(corners.size(), 8u);
}

TEST(SceneMass, SimpleShapes) {
  const double pi = 3.14159265358979323846;
  const Inertial sphere = mass_of(Sphere{2}, 3);
  EXPECT_DOUBLE_EQ(sphere.mass, 32 * pi);
  EXPECT_DOUBLE_EQ(sphere.inertia(1, 1), 0.4 * sphere.mass * 4);
  const Inertial box = mass_of(Box{Vec3(1, 2, 3)}, 10);
  EXPECT_DOUBLE_EQ(box.mass, 60);
  EXPECT_DOUBLE_EQ(box.inertia(0, 0), 65);
  EXPECT_DOUBLE_EQ(box.inertia(1, 1), 50);
  EXPECT_DOUBLE_EQ(box.inertia(2, 2), 25);
  const Inertial cylinder = mass_of(Cylinder{2, 3}, 1);
  EXPECT_DOUBLE_EQ(cylinder.mass, 12 * pi);
  EXPECT_DOUBLE_EQ(cylinder.inertia(2, 2), 0.5 * cylinder.mass * 4);
  EXPECT_DOUBLE_EQ(cylinder.inertia(0, 0), cylinder.mass * (3 * 4 + 9) / 12);
}

// A capsule has no closed form that one remembers: integrate discs.
TEST(SceneMass, Capsule) {
  const double r = 0.5, h = 1.5, pi = 3.14159265358979323846;
  double mass = 0, across = 0, along = 0;
  constexpr int kSlices = 200000;
  const double dz = (h + 2 * r) / kSlices;
  for (int i = 0; i < kSlices; ++i) {
    const double z = -0.5 * h - r + (i + 0.5) * dz;
    const double beyond = std::max(0.0, std::abs(z) - 0.5 * h), rr = r * r - beyond * beyond;
    const double m = pi * rr * dz;
    mass += m;
    along += 0.5 * m * rr;
    across += m * (0.25 * rr + z * z);
  }
  const Inertial capsule = mass_of(Capsule{r, h}, 1);
  EXPECT_NEAR(capsule.mass, mass, 1e-8);
  EXPECT_NEAR(capsule.inertia(2, 2), along, 1e-8);
  EXPECT_NEAR(capsule.inertia(0, 0), across, 1e-8);
}

TEST(SceneMass, HullOfABoxIsTheBox) {
  const Vec3 low(3, -1, 0.5), high(4, 1, 3.5);
  const Inertial hull = mass_of(ConvexHull{box_corners(low, high)}, 10), box = mass_of(Box{high - low}, 10);
  EXPECT_NEAR(hull.mass, box.mass, 1e-12 * box.mass);
  EXPECT_TRUE(hull.centre.isApprox(0.5 * (low + high), 1e-14));
  EXPECT_TRUE(hull.inertia.isApprox(box.inertia, 1e-13));
}

TEST(SceneMass, HullOfATetrahedron) {
  // Volume 1/6, centre at a quarter, moments 3/80 m (b^2 + c^2), products -m/80 about the centre (with unit edges).
  const Inertial i = mass_of(ConvexHull{{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}}, 6);
  EXPECT_NEAR(i.mass, 1, 1e-14);
  EXPECT_TRUE(i.centre.isApprox(Vec3(0.25, 0.25, 0.25), 1e-14));
  EXPECT_NEAR(i.inertia(0, 0), 3.0 / 40, 1e-14);
  EXPECT_NEAR(i.inertia(0, 1), 1.0 / 80, 1e-14);
}

TEST(SceneMass, CompoundOfTwoHalvesIsTheWhole) {
  Scene scene;
  scene.geometries = {Box{Vec3(1, 1, 1)}, Box{Vec3(1, 2, 1)}};
  MassTable table(scene);
  const std::vector<Shape> halves{{0, Pose{Vec3(7, 0.5, 0), Quat::Identity()}},
                                  {0, Pose{Vec3(7, -0.5, 0), Quat::Identity()}}};
  const Inertial sum = table.of(halves, 5), whole = mass_of(scene.geometries[1], 5);
  EXPECT_NEAR(sum.mass, whole.mass, 1e-13);
  EXPECT_TRUE(sum.centre.isApprox(Vec3(7, 0, 0), 1e-14));
  EXPECT_TRUE(sum.inertia.isApprox(whole.inertia, 1e-13));
  // A turned part: a right angle about z swaps x and y.
  const std::vector<Shape> turned{{1, Pose{Vec3::Zero(), Quat(std::sqrt(0.5), 0, 0, std::sqrt(0.5))}}};
  EXPECT_NEAR(table.of(turned, 5).inertia(0, 0), whole.inertia(1, 1), 1e-13);
  EXPECT_EQ(table.of(turned, 5).inertia, table.of(turned, 5).inertia.transpose());
}

TEST(SceneMass, PrincipalMoments) {
  const Mat3 turn = Quat(0.5, 0.5, -0.5, 0.5).toRotationMatrix();
  const Vec3 moments = principal_moments(turn * Vec3(3, 1, 2).asDiagonal() * turn.transpose());
  EXPECT_TRUE(moments.isApprox(Vec3(1, 2, 3), 1e-14));
}

TEST(SceneExtent, TurnedShapes) {
  const Pose quarter{Vec3(1, 2, 3), Quat(std::sqrt(0.5), std::sqrt(0.5), 0, 0)};  // a right angle about x: z becomes -y
  const Aabb box = *extent_of(Box{Vec3(2, 4, 6)}, quarter);
  EXPECT_TRUE(box.max.isApprox(Vec3(2, 5, 5), 1e-14));
  const Aabb cylinder = *extent_of(Cylinder{0.5, 4}, quarter);
  EXPECT_TRUE(cylinder.max.isApprox(Vec3(1.5, 4, 3.5), 1e-7));
  const Aabb capsule = *extent_of(Capsule{0.5, 4}, quarter);
  EXPECT_TRUE(capsule.max.isApprox(Vec3(1.5, 4.5, 3.5), 1e-14));
  EXPECT_FALSE(extent_of(Plane{}, quarter));
}

}  // namespace
}  // namespace soda
