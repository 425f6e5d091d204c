// Scenes in files: every bit kept, every cut noticed.
#include <gtest/gtest.h>

#include <fstream>

#include "common/scene/generators.h"
#include "common/scene/scene_file.h"
#include "tests/unit/scene_support.h"

namespace soda {
namespace {

using test::every_kind;
using test::expect_same_bits;

TEST(SceneStorage, BinaryKeepsEveryBit) {
  const Scene scene = every_kind();
  const std::string bytes = encode_scene(scene);
  const Scene again = decode_scene(bytes, "memory");
  expect_same_bits(scene, again);
  EXPECT_EQ(bytes, encode_scene(again));
}

TEST(SceneStorage, TextKeepsEveryBit) {
  const Scene scene = every_kind();
  const std::string text = scene_to_text(scene);
  const Scene again = scene_from_text(text, "memory");
  expect_same_bits(scene, again);
  EXPECT_EQ(encode_scene(scene), encode_scene(again));
  EXPECT_EQ(text, scene_to_text(again));
}

TEST(SceneStorage, FilesOfBothKindsHoldTheSameScene) {
  const test::TemporaryFolder folder;
  const Scene scene = every_kind();
  for (const char* name : {"a.scene", "b.txtpb"}) {
    save_scene(scene, folder.path / name);
    save_scene(scene, folder.path / name);  // over the old one
    EXPECT_EQ(encode_scene(scene), encode_scene(load_scene(folder.path / name)));
  }
  // No temporary file is left behind.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path), {}), 2);
}

TEST(SceneStorage, BinaryCutAnywhereIsRefused) {
  const std::string bytes = encode_scene(every_kind());
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    try {
      decode_scene(std::string_view(bytes).substr(0, length), "cut.scene");
      FAIL() << "accepted after " << length << " bytes";
    } catch (const SceneError& e) {
      EXPECT_TRUE(e.reason.find("cut short") != std::string::npos || length == 0) << e.what();
      EXPECT_EQ(e.source, "cut.scene");
    }
  }
  EXPECT_THROW(decode_scene(bytes + "x", "long.scene"), SceneError);
}

TEST(SceneStorage, TextCutAnywhereIsRefused) {
  const std::string text = scene_to_text(every_kind());
  const std::size_t last = text.find_last_not_of(" \n") + 1;  // the last brace: nothing is missing without what follows
  for (std::size_t length = 0; length < last; ++length)
    EXPECT_THROW(scene_from_text(std::string_view(text).substr(0, length), "cut.txtpb"), SceneError) << length;
}

TEST(SceneStorage, DamagedByteIsRefused) {
  const std::string bytes = encode_scene(every_kind());
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    EXPECT_THROW(decode_scene(damaged, "damaged.scene"), SceneError) << "byte " << at;
  }
}

TEST(SceneStorage, UnknownFileOrFormatIsRefused) {
  EXPECT_THROW(load_scene("does_not_exist.scene"), SceneError);
  EXPECT_THROW(load_scene("scene.json"), SceneError);
  EXPECT_THROW(load_scene(std::filesystem::temp_directory_path()), SceneError);
  EXPECT_THROW(save_scene(every_kind(), "scene.json"), SceneError);
  EXPECT_THROW(save_scene(every_kind(), "no_such_folder/a.scene"), SceneError);
}

TEST(SceneStorage, DefaultsAndDerivedValuesAreFilledIn) {
  const Scene scene = scene_from_text(R"(
      material { name: "steel" density: 7800 friction: 0.3 restitution: 0.2 colour: 0x112233ff }
      body { id: 2 material: "steel" shape { box { size { x: 1 y: 1 z: 1 } } } pose { orientation { w: 2 } } }
      body { material: "steel" friction: 0.4 shape { sphere { radius: 1 } } inertial { mass: 3 } }
      body { static: true shape { plane {} } }
      body { shape { box { size { x: 1 y: 1 z: 1 } } } })",
                                      "text");
  ASSERT_EQ(scene.bodies.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(scene.bodies[i].id, i + 1);  // 2 is given, the others are free
  EXPECT_EQ(scene.bodies[1].inertial.mass, 7800);
  EXPECT_EQ(scene.bodies[1].pose.orientation.w(), 1);
  EXPECT_EQ(scene.bodies[1].friction, 0.3);
  EXPECT_EQ(scene.bodies[1].restitution, 0.2);
  EXPECT_EQ(scene.bodies[1].colour, 0x112233ffu);
  EXPECT_EQ(scene.bodies[0].inertial.mass, 3);
  EXPECT_DOUBLE_EQ(scene.bodies[0].inertial.inertia(0, 0), 0.4 * 3);
  EXPECT_EQ(scene.bodies[0].friction, 0.4);
  EXPECT_EQ(scene.bodies[3].inertial.mass, 1000);
  EXPECT_EQ(scene.bodies[3].friction, 0.5);
  EXPECT_EQ(scene.dt, 1.0 / 60);
  EXPECT_EQ(scene.gravity, Vec3(0, 0, -9.81));
  // The two boxes share their geometry.
  EXPECT_EQ(scene.geometries.size(), 3u);
  EXPECT_EQ(scene.bodies[1].shapes[0].geometry, scene.bodies[3].shapes[0].geometry);
}

TEST(SceneStorage, CompoundsAreFlattened) {
  const Scene scene = scene_from_text(R"(
      body { shape {
        pose { position { x: 1 } orientation { z: 1 w: 1 } }  # a right angle about z
        compound {
          shape { sphere { radius: 1 } pose { position { x: 2 } } density: 10 }
          shape { compound { shape { box { size { x: 1 y: 1 z: 1 } } pose { position { z: 5 } } } } density: 20 }
        } } })",
                                      "text");
  const Body& body = scene.bodies.at(0);
  ASSERT_EQ(body.shapes.size(), 2u);
  EXPECT_TRUE(body.shapes[0].pose.position.isApprox(Vec3(1, 2, 0), 1e-15));
  EXPECT_TRUE(body.shapes[1].pose.position.isApprox(Vec3(1, 0, 5), 1e-15));
  EXPECT_NEAR(body.inertial.mass, 10 * 4.0 / 3 * 3.14159265358979 + 20, 1e-12);
}

TEST(SceneStorage, HullsAreReducedToTheirCorners) {
  std::string points = "0,0,0";
  for (int i = 1; i < 8; ++i)
    points += "," + std::to_string(i & 1) + "," + std::to_string(i >> 1 & 1) + "," + std::to_string(i >> 2);
  const Scene scene = scene_from_text(
      "body { shape { convex_hull { points: [" + points + ", 0.5,0.5,0.5, 0.5,0.5,1, 0,0,0.5, 1,1,1] } } }", "text");
  const auto& hull = std::get<ConvexHull>(scene.geometries.at(0));
  EXPECT_EQ(hull.points.size(), 8u);
  EXPECT_NEAR(scene.bodies[0].inertial.mass, 1000, 1e-9);
}

TEST(SceneStorage, GeneratedScenesSurviveBothFormats) {
  for (const Generator& g : generators()) {
    const Scene scene = generate(g.name, 100, 7);
    EXPECT_EQ(encode_scene(scene), encode_scene(decode_scene(encode_scene(scene), g.name))) << g.name;
    EXPECT_EQ(encode_scene(scene), encode_scene(scene_from_text(scene_to_text(scene), g.name))) << g.name;
  }
}

}  // namespace
}  // namespace soda
