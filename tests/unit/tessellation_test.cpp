// Triangles for display: closed where the shape is solid, as large as the shape, facing outwards, made once for each
// shape.
#include "common/scene/tessellation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <tuple>
#include <vector>

#include "common/scene/convex_hull.h"
#include "common/scene/random.h"
#include "tests/unit/scene_support.h"

namespace soda::test {
namespace {

using Corner = std::array<float, 3>;

Corner corner(const std::vector<float>& values, std::uint32_t index) {
  return {values[3 * index], values[3 * index + 1], values[3 * index + 2]};
}
Vec3 vec(const Corner& c) { return Vec3(c[0], c[1], c[2]); }

struct Triangle {
  std::array<Corner, 3> at;
  std::array<Vec3, 3> normal;  // of the vertices
  Vec3 across() const { return (vec(at[1]) - vec(at[0])).cross(vec(at[2]) - vec(at[0])); }
};

std::vector<Triangle> triangles(const DisplayMesh& mesh) {
  EXPECT_EQ(mesh.positions.size(), mesh.normals.size());
  EXPECT_EQ(mesh.indices.size() % 3, 0u);
  std::vector<Triangle> result;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    Triangle t;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh.indices[i + k];
      if (v >= mesh.vertices()) throw std::out_of_range("index of a vertex");
      t.at[k] = corner(mesh.positions, v);
      t.normal[k] = vec(corner(mesh.normals, v));
    }
    result.push_back(t);
  }
  return result;
}

// Every edge is passed once in each direction, by two triangles; vertices that are at one place count as one.
void expect_closed(const DisplayMesh& mesh) {
  std::map<std::pair<Corner, Corner>, int> edges;
  for (const Triangle& t : triangles(mesh))
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t.at[k], t.at[(k + 1) % 3]}];
  ASSERT_FALSE(edges.empty());
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1);
    ASSERT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
}

// Of the solid within, by the divergence theorem.
struct Solid {
  double volume = 0;           // m^3
  Vec3 centre = Vec3::Zero();  // m
};
Solid solid(const DisplayMesh& mesh) {
  Solid s;
  for (const Triangle& t : triangles(mesh)) {
    const Vec3 a = vec(t.at[0]), b = vec(t.at[1]), c = vec(t.at[2]);
    const double v = a.dot(b.cross(c)) / 6;
    s.volume += v;
    s.centre += v / 4 * (a + b + c);
  }
  s.centre /= s.volume;
  return s;
}

// Unit, and on the side that the triangle is counter-clockwise seen from.
void expect_normals(const DisplayMesh& mesh, double least_cosine) {
  for (const Triangle& t : triangles(mesh)) {
    const Vec3 across = t.across();
    ASSERT_GT(across.norm(), 0);
    for (const Vec3& n : t.normal) {
      ASSERT_NEAR(n.norm(), 1, 1e-6);
      ASSERT_GT(n.dot(across.normalized()), least_cosine);
    }
  }
}

ConvexHull random_hull(std::uint64_t seed) {
  Random random(seed);
  std::vector<Vec3> points;
  for (int i = 0; i < 60; ++i) points.push_back(random.between(Vec3(-1, -0.5, -2), Vec3(1, 0.7, 0.3)));
  return {hull_corners(points)};
}

std::vector<Geometry> solids() {
  return {Sphere{0.4},
          Box{Vec3(0.1, 2, 0.7)},
          Capsule{0.2, 1.5},
          Cylinder{0.7, 0.05},
          random_hull(1),
          random_hull(2),
          ConvexHull{{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}}};
}

bool curved(const Geometry& g) { return !std::holds_alternative<Box>(g) && !std::holds_alternative<ConvexHull>(g); }

TEST(Tessellation, SolidsAreClosedAndFaceOutwards) {
  for (const Geometry& geometry : solids()) {
    SCOPED_TRACE(geometry.index());
    const DisplayMesh mesh = tessellate(geometry, {});
    EXPECT_FALSE(mesh.two_sided);
    expect_closed(mesh);
    // A flat face's normals are its own; half a segment of 15 degrees, in two directions, where the surface is smooth.
    expect_normals(mesh, curved(geometry) ? 0.97 : 1 - 1e-5);
    const Vec3 inside = solid(mesh).centre;
    for (const Triangle& t : triangles(mesh)) ASSERT_GT(t.across().dot(vec(t.at[0]) - inside), 0);
  }
}

TEST(Tessellation, VolumesAreThoseOfTheShapes) {
  for (const Geometry& geometry : solids()) {
    SCOPED_TRACE(geometry.index());
    const double exact = mass_of(geometry, 1).mass;
    const auto missing = [&](std::uint32_t segments) {
      return 1 - solid(tessellate(geometry, {.segments = segments})).volume / exact;
    };
    if (!curved(geometry)) {
      EXPECT_NEAR(missing(24), 0, 1e-5);
      continue;
    }
    // Corners are on the true surface, so that the solid is within it; the rest shrinks with the square of segments.
    EXPECT_GT(missing(24), 0);
    EXPECT_LT(missing(24), 0.03);
    EXPECT_GT(missing(96), 0);
    EXPECT_LT(missing(96), missing(24) / 15);
  }
}

TEST(Tessellation, SegmentsAreMadeAMultipleOfFour) {
  for (const std::uint32_t segments : {0u, 1u, 9u, 10u, 11u, 13u})
    expect_closed(tessellate(Capsule{1, 1}, {.segments = segments}));
  EXPECT_EQ(tessellate(Sphere{1}, {.segments = 9}).vertices(), tessellate(Sphere{1}, {.segments = 12}).vertices());
}

TEST(Tessellation, SharpEdgesAreSharpAndCurvesAreSmooth) {
  EXPECT_EQ(tessellate(Box{Vec3(1, 1, 1)}, {}).vertices(), 24u);                     // four for each face
  EXPECT_EQ(tessellate(Sphere{1}, {.segments = 24}).vertices(), 2u + 11u * 24u);     // none twice
  EXPECT_EQ(tessellate(Cylinder{1, 1}, {.segments = 24}).vertices(), 2u + 4 * 24u);  // rims twice
  for (const Triangle& t : triangles(tessellate(Sphere{2}, {})))
    for (std::size_t k = 0; k < 3; ++k) EXPECT_LT((vec(t.at[k]) / 2 - t.normal[k]).norm(), 1e-6);
}

TEST(Tessellation, ACompoundIsAboutItsCentreOfMass) {
  SceneBuilder builder("compound");
  Body& hammer = builder.add(Cylinder{0.05, 0.8}, Vec3(5, 6, 7), Quat(0.5, 0.5, 0.5, 0.5));
  const double turned = std::sqrt(0.5);
  hammer.shapes.push_back(
      {builder.geometry(Box{Vec3(0.4, 0.15, 0.1)}), Pose{Vec3(0.2, 0, 0.475), Quat(turned, 0, turned, 0)}});
  const Scene scene = builder.finish();
  const Body& body = scene.bodies[0];
  ASSERT_GT(body.inertial.centre.norm(), 0.1);
  const DisplayMesh mesh = tessellate(scene, body, {.segments = 96});
  expect_normals(mesh, 0.97);
  EXPECT_NEAR(solid(mesh).volume, body.inertial.mass / kDefaultDensity, 1e-4 * solid(mesh).volume + 1e-5);
  EXPECT_LT(solid(mesh).centre.norm(), 2e-4);
  // The box is turned about y: its x is along the body's -z, .4 m of it from .275 to .675.
  double top = -1;
  for (const Triangle& t : triangles(mesh))
    for (const Corner& c : t.at) top = std::max<double>(top, c[2]);
  EXPECT_NEAR(top, 0.675 - body.inertial.centre.z(), 1e-6);
  EXPECT_LT((display_pose(body).position - (body.pose * Pose{body.inertial.centre, Quat::Identity()}).position).norm(),
            1e-12);
}

TEST(Tessellation, APlaneIsASquareOfTheEdgeAskedFor) {
  const Vec3 normal(0, 0.6, 0.8);
  const DisplayMesh mesh = tessellate(Plane{normal}, {.plane_edge = 7});
  EXPECT_TRUE(mesh.two_sided);
  double area = 0;
  Vec3 middle = Vec3::Zero();
  for (const Triangle& t : triangles(mesh)) {
    area += t.across().norm() / 2;
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(vec(t.at[k]).dot(normal), 0, 1e-6);
      EXPECT_LT((t.normal[k] - normal).norm(), 1e-6);
      middle += vec(t.at[k]);
    }
  }
  EXPECT_NEAR(area, 49, 1e-4);
  EXPECT_LT(middle.norm(), 1e-5);
  expect_normals(mesh, 1 - 1e-5);
}

TEST(Tessellation, SheetsAreThereWithAllTheirTriangles) {
  // The second triangle has no area.
  const TriangleMesh sheet{{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0.1), Vec3(2, 0, 0)},
                           {{0, 1, 2}, {0, 1, 3}, {2, 1, 3}}};
  const DisplayMesh mesh = tessellate(sheet, {});
  EXPECT_TRUE(mesh.two_sided);
  EXPECT_EQ(mesh.indices.size(), 6u);
  expect_normals(mesh, 1 - 1e-5);

  const HeightField field{3, 2, 0.5, 0.25, {0, 0.1, 0.2, 0.3, -0.4, 0.5}};
  const DisplayMesh ground = tessellate(field, {});
  EXPECT_TRUE(ground.two_sided);
  EXPECT_EQ(ground.vertices(), 6u);
  EXPECT_EQ(ground.indices.size(), 3u * 2 * 2 * 1);
  double shadow = 0;  // area seen from above
  for (const Triangle& t : triangles(ground)) {
    EXPECT_GT(t.across().z(), 0);
    shadow += t.across().z() / 2;
    for (std::size_t k = 0; k < 3; ++k) EXPECT_GT(t.normal[k].z(), 0);
  }
  EXPECT_NEAR(shadow, 1.0 * 0.25, 1e-6);
  EXPECT_EQ(corner(ground.positions, 5), (Corner{0.5f, 0.125f, 0.5f}));
}

TEST(Tessellation, EqualShapesShareOneMesh) {
  SceneBuilder builder("many");
  for (int i = 0; i < 1000; ++i)
    builder.add(Box{Vec3(1, 2, 3)}, Vec3(4.0 * i, 0, 0), Quat(0.6, 0, 0.8, 0)).colour = static_cast<std::uint32_t>(i);
  builder.add(Box{Vec3(1, 2, 3.5)}, Vec3(0, 9, 0));
  // Other shapes: the same ones at another place, in the other order, one of them alone.
  for (const double offset : {0.5, 0.5, 0.7})
    builder.add(Box{Vec3(1, 2, 3)}, Vec3(0, 20 * offset, 9))
        .shapes.push_back({builder.geometry(Sphere{0.2}), Pose{Vec3(0, 0, offset), Quat::Identity()}});
  const Scene scene = builder.finish();
  DisplayMeshTable table({});
  for (std::size_t i = 0; i < 1000; ++i) ASSERT_EQ(table.index_of(scene, scene.bodies[i]), 0u);
  EXPECT_EQ(table.index_of(scene, scene.bodies[1000]), 1u);
  EXPECT_EQ(table.index_of(scene, scene.bodies[1001]), 2u);
  EXPECT_EQ(table.index_of(scene, scene.bodies[1002]), 2u);
  EXPECT_EQ(table.index_of(scene, scene.bodies[1003]), 3u);
  EXPECT_EQ(table.meshes().size(), 4u);
  // As a body that is spawned later has it: in a scene of its own, its geometry has another number there.
  SceneBuilder other("other");
  other.add(Sphere{9}, Vec3::Zero());
  other.add(Box{Vec3(1, 2, 3)}, Vec3(30, 0, 0));
  const Scene spawned = other.finish();
  EXPECT_EQ(table.index_of(spawned, spawned.bodies[1]), 0u);
  EXPECT_EQ(table.meshes().size(), 4u);
}

TEST(Tessellation, EveryKindOfShapeIsShown) {
  const Scene scene = every_kind();
  for (const Body& body : scene.bodies) EXPECT_FALSE(tessellate(scene, body, {}).indices.empty()) << label_of(body);
}

TEST(Tessellation, ColoursAreTheScenesWhereItSaysSo) {
  Body body;
  body.id = 3;
  body.is_static = true;
  EXPECT_EQ(display_colour(body), body.colour);
  body.is_static = false;
  EXPECT_NE(display_colour(body), body.colour);
  Body next = body;
  next.id = 4;
  EXPECT_NE(display_colour(body), display_colour(next));
  body.colour = 0x12345678;
  EXPECT_EQ(display_colour(body), 0x12345678u);
}

}  // namespace
}  // namespace soda::test
