// SDF worlds become scenes: places against hand computation, what is not modelled is named once, bad input is refused.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "common/import/load.h"
#include "common/import/sdf.h"
#include "common/scene/scene_file.h"
#include "tests/unit/scene_support.h"

namespace soda {
namespace {

using test::TemporaryFolder;

constexpr double kPi = 3.14159265358979323846;
const std::string kBox = "<collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision>";

void write(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

std::string world(const std::string& content) {
  return "<?xml version='1.0'?>\n<sdf version='1.9'>\n<world name='w'>\n" + content + "\n</world></sdf>\n";
}

// Without the user's cache.
struct Import {
  TemporaryFolder folder;
  std::vector<std::string> warnings;
  Scene operator()(const std::string& text) {
    warnings.clear();
    write(folder.path / "test.sdf", text);
    SdfOptions options;
    options.use_cache = false;
    return load_sdf(folder.path / "test.sdf", options, warnings);
  }
  std::size_t mentions(const std::string& what) const {
    std::size_t n = 0;
    for (const std::string& w : warnings) n += w.find(what) != std::string::npos;
    return n;
  }
};

const Body& named(const Scene& scene, const std::string& name) {
  for (const Body& body : scene.bodies)
    if (body.name == name) return body;
  throw std::runtime_error("no body " + name);
}

TEST(SceneSdf, NestedPosesAgainstHandComputation) {
  Import import;
  // A quarter turn about z at each of two levels; the link is relative to a frame of its model.
  const Scene scene = import(world(R"(
    <frame name='yard'><pose>10 0 0 0 0 0</pose></frame>
    <model name='outer'><pose relative_to='yard'>1 2 3 0 0 1.5707963267948966</pose>
      <link name='base'>)" + kBox + R"(</link>
      <model name='inner'><pose>1 0 0 0 0 1.5707963267948966</pose>
        <frame name='shelf'><pose>0 0 2 0 0 0</pose></frame>
        <link name='l'><pose relative_to='shelf'>1 0 0 0 0 0</pose>)" +
                                   kBox + R"(</link>
      </model>
    </model>
    <model name='friend'><pose relative_to='outer::inner'>0 0 1 0 0 0</pose><link name='l'>)" +
                                   kBox + R"(</link></model>
    <model name='alone'><pose degrees='true'>5 6 7 90 0 0</pose><link name='l'><pose>0 1 0 0 0 0</pose>)" +
                                   kBox + R"(</link></model>
    )"));
  ASSERT_EQ(scene.bodies.size(), 4u);
  const Body& base = named(scene, "outer::base");
  EXPECT_TRUE(base.pose.position.isApprox(Vec3(11, 2, 3), 1e-14));
  // inner's origin: (11, 2, 3) + turned (1, 0, 0) = (11, 3, 3), turned by pi in all; shelf 2 up; link 1 along -x.
  const Body& inner = named(scene, "outer::inner::l");
  EXPECT_TRUE(inner.pose.position.isApprox(Vec3(10, 3, 5), 1e-14)) << inner.pose.position.transpose();
  EXPECT_NEAR(std::abs(inner.pose.orientation.z()), 1, 1e-14);
  EXPECT_TRUE(named(scene, "friend::l").pose.position.isApprox(Vec3(11, 3, 4), 1e-14));
  EXPECT_TRUE(named(scene, "alone::l").pose.position.isApprox(Vec3(5, 6, 8), 1e-14));
  // In the order of the file.
  EXPECT_EQ(scene.bodies[0].name, "outer::base");
  EXPECT_EQ(scene.bodies[1].name, "outer::inner::l");
  EXPECT_EQ(scene.bodies[2].name, "friend::l");
  EXPECT_EQ(scene.bodies[3].name, "alone::l");
}

TEST(SceneSdf, SettingsSurfaceInertialAndColour) {
  Import import;
  const Scene scene = import(world(R"(
    <gravity>0 0 -1.62</gravity>
    <physics type='ode'><max_step_size>0.004</max_step_size></physics>
    <model name='m'><link name='l'>
      <inertial><pose>0.1 0 0 0 0 1.5707963267948966</pose><mass>2</mass><inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz></inertia></inertial>
      <collision name='c'><pose>0 0 1 0 0 0</pose><geometry><cylinder><radius>0.5</radius><length>2</length></cylinder></geometry>
        <surface><friction><ode><mu>0.7</mu></ode></friction><bounce><restitution_coefficient>0.3</restitution_coefficient></bounce></surface>
      </collision>
      <visual name='v'><geometry><box/></geometry><material><diffuse>1 0.5 0 1</diffuse></material></visual>
    </link></model>
    <model name='floor'><static>1</static><link name='l'><collision name='c'><geometry><plane><normal>0 0 2</normal></plane></geometry></collision></link></model>)"));
  EXPECT_EQ(scene.gravity, Vec3(0, 0, -1.62));
  EXPECT_EQ(scene.dt, 0.004);
  const Body& body = named(scene, "m::l");
  EXPECT_EQ(body.friction, 0.7);
  EXPECT_EQ(body.restitution, 0.3);
  EXPECT_EQ(body.colour, 0xff8000ffu);
  EXPECT_EQ(body.inertial.mass, 2);
  EXPECT_EQ(body.inertial.centre, Vec3(0.1, 0, 0));
  EXPECT_NEAR(body.inertial.inertia(0, 0), 2, 1e-14);  // turned by a right angle
  EXPECT_NEAR(body.inertial.inertia(1, 1), 1, 1e-14);
  EXPECT_EQ(body.shapes[0].pose.position, Vec3(0, 0, 1));
  const Body& floor = named(scene, "floor::l");
  EXPECT_TRUE(floor.is_static);
  EXPECT_EQ(std::get<Plane>(scene.geometries[floor.shapes[0].geometry]).normal, Vec3::UnitZ());
  EXPECT_EQ(floor.friction, 1);  // SDF's default
}

TEST(SceneSdf, StepIsOursUnlessTheFileSaysSo) {
  Import import;
  EXPECT_EQ(import(world("<model name='m'><link name='l'>" + kBox + "</link></model>")).dt, 1.0 / 60);
}

TEST(SceneSdf, ModelWithoutAWorld) {
  Import import;
  const Scene scene = import("<sdf version='1.7'><model name='m'><pose>1 2 3 0 0 0</pose><link name='l'>" + kBox +
                             "</link></model></sdf>");
  ASSERT_EQ(scene.bodies.size(), 1u);
  EXPECT_EQ(scene.bodies[0].pose.position, Vec3(1, 2, 3));
  EXPECT_EQ(scene.gravity, Vec3(0, 0, -9.8));
}

// Models that differ in name and pose only are read once; they must come out as if each had been read.
TEST(SceneSdf, RepeatedModelsAreAllThere) {
  Import import;
  std::string models;
  for (int i = 0; i < 200; ++i)
    models +=
        "<model name='m" + std::to_string(i) + "'><pose>" + std::to_string(2 * i) +
        " 0 0 0 0 0.5</pose><link name='l'>" +
        (i % 2 ? kBox : "<collision name='c'><geometry><sphere><radius>0.5</radius></sphere></geometry></collision>") +
        "</link></model>";
  const Scene scene = import(world(models));
  ASSERT_EQ(scene.bodies.size(), 200u);
  for (int i = 0; i < 200; ++i) {
    EXPECT_EQ(scene.bodies[i].name, "m" + std::to_string(i) + "::l");
    EXPECT_EQ(scene.bodies[i].id, i + 1u);
    EXPECT_EQ(scene.bodies[i].pose.position, Vec3(2 * i, 0, 0));
    EXPECT_NEAR(scene.bodies[i].pose.orientation.z(), std::sin(0.25), 1e-15);
  }
  EXPECT_EQ(scene.geometries.size(), 2u);
}

TEST(SceneSdf, PopulationsOfAllKinds) {
  Import import;
  const auto population = [](const std::string& name, const std::string& rule, const std::string& region, int count) {
    return "<population name='" + name + "'><pose>0 0 10 0 0 0</pose>" + region + "<model_count>" +
           std::to_string(count) + "</model_count><distribution><type>" + rule +
           "</type><rows>2</rows><cols>3</cols><step>2 4 0</step></distribution><model name='" + name +
           "'><pose>0 0 1 0 0 0</pose><link name='l'>" + kBox + "</link></model></population>";
  };
  const std::string box = "<box><size>30 20 10</size></box>",
                    disc = "<cylinder><radius>20</radius><length>4</length></cylinder>";
  const std::string text = world(population("random", "random", box, 20) + population("disc", "random", disc, 20) +
                                 population("uniform", "uniform", box, 6) + population("grid", "grid", "", 1) +
                                 population("x", "linear-x", box, 3) + population("y", "linear-y", box, 2) +
                                 population("z", "linear-z", box, 2));
  const Scene scene = import(text);
  EXPECT_EQ(scene.bodies.size(), 20u + 20 + 6 + 6 + 3 + 2 + 2);
  EXPECT_EQ(encode_scene(scene), encode_scene(import(text)));  // random places are the same each time
  std::vector<Vec3> random;
  for (const Body& body : scene.bodies) {
    const Vec3 p = body.pose.position - Vec3(0, 0, 11);
    if (body.name.starts_with("random")) {
      EXPECT_TRUE(std::abs(p.x()) <= 15 && std::abs(p.y()) <= 10 && std::abs(p.z()) <= 5);
      for (const Vec3& other : random) EXPECT_GT((other - p).norm(), std::sqrt(3));  // no two touch
      random.push_back(p);
    }
    if (body.name.starts_with("disc")) {
      EXPECT_LE(std::hypot(p.x(), p.y()), 20);
    }
  }
  EXPECT_EQ(named(scene, "grid_clone_0::l").pose.position, Vec3(-2, -2, 11));
  EXPECT_EQ(named(scene, "grid_clone_5::l").pose.position, Vec3(2, 2, 11));
  EXPECT_TRUE(named(scene, "x_clone_0::l").pose.position.isApprox(Vec3(-10, 0, 11), 1e-12));
  EXPECT_TRUE(named(scene, "x_clone_2::l").pose.position.isApprox(Vec3(10, 0, 11), 1e-12));
  EXPECT_TRUE(named(scene, "y_clone_1::l").pose.position.isApprox(Vec3(0, 5, 11), 1e-12));
  EXPECT_TRUE(named(scene, "z_clone_1::l").pose.position.isApprox(Vec3(0, 0, 13.5), 1e-12));
  EXPECT_TRUE(named(scene, "uniform_clone_0::l").pose.position.isApprox(Vec3(-10, -5, 11), 1e-12));
}

TEST(SceneSdf, WhatIsNotModelledIsListedOnce) {
  Import import;
  std::string models;
  for (int i = 0; i < 3; ++i)
    models += "<model name='m" + std::to_string(i) + "'><pose>" + std::to_string(3 * i) +
              " 0 0 0 0 0</pose><link name='l'>" + kBox +
              "<sensor name='s' type='imu'/><velocity_decay><linear>0.1</linear></velocity_decay></link><plugin "
              "name='p' filename='x'/></model>";
  const Scene scene = import(world("<plugin name='wp' filename='y'/><light name='sun' type='directional'/>" + models));
  EXPECT_EQ(scene.bodies.size(), 3u);
  EXPECT_EQ(import.mentions("<sensor> in <link> is not modelled (3 times"), 1u);
  EXPECT_EQ(import.mentions("<sensor>"), 1u);
  EXPECT_EQ(import.mentions("<plugin> in <model> is not modelled (3 times"), 1u);
  EXPECT_EQ(import.mentions("<plugin> in <world>"), 1u);
  EXPECT_EQ(import.mentions("<light>"), 1u);
  EXPECT_EQ(import.mentions("<velocity_decay>"), 1u);
  EXPECT_EQ(import.mentions("<box>") + import.mentions("<pose>") + import.mentions("<collision>"), 0u);
}

TEST(SceneSdf, MeshIsAHullWhereDynamicAndTrianglesWhereStatic) {
  const test::TemporaryFolder unused;
  std::vector<std::string> warnings;
  SdfOptions options;
  options.use_cache = false;
  const Scene scene = load_sdf(test::data_file("nested.sdf"), options, warnings);
  std::size_t dynamic = 0;
  for (const Body& body : scene.bodies) dynamic += !body.is_static;
  EXPECT_EQ(dynamic, 80u);
  const Body& stone = named(scene, "stone_clone_0::body");
  const auto& hull = std::get<ConvexHull>(scene.geometries[stone.shapes[0].geometry]);
  EXPECT_EQ(hull.points.size(), 12u);               // the thirteenth is inside
  EXPECT_DOUBLE_EQ(hull.points[0].x(), 0.3 * 1.2);  // the decimal of the file, not the float's neighbour
  EXPECT_EQ(stone.shapes[0].geometry, named(scene, "stone_clone_13::body").shapes[0].geometry);
  const Body& ramp = named(scene, "ramp::body");
  EXPECT_EQ(std::get<TriangleMesh>(scene.geometries[ramp.shapes[0].geometry]).triangles.size(), 8u);
  // wall: at (1, -2, 0) + (-4, 4, 0), turned by a right angle; brick 2 of row 1 is at (.5 + 2, 0, .75) in it.
  EXPECT_TRUE(named(scene, "wall::row1::brick2").pose.position.isApprox(Vec3(-3, 4.5, 0.75), 1e-12));
  EXPECT_EQ(named(scene, "table::frame").shapes.size(), 5u);
}

TEST(SceneSdf, IncludedModels) {
  Import import;
  const std::filesystem::path model = import.folder.path / "models" / "cart";
  write(model / "model.config",
        "<model><name>cart</name><version>1</version><sdf version='1.9'>model.sdf</sdf></model>");
  write(model / "model.sdf",
        "<sdf version='1.9'><model name='cart'><pose>0 0 1 0 0 0</pose><link name='l'><collision name='c'>"
        "<geometry><mesh><uri>rock.obj</uri></mesh></geometry></collision></link></model></sdf>");
  std::filesystem::copy_file(test::data_file("rock.obj"), model / "rock.obj");
  const Scene scene = import(world(R"(
    <include><uri>model://cart</uri></include>
    <include><uri>models/cart</uri><name>b</name><pose>5 0 2 0 0 0</pose></include>
    <include><uri>models/cart/model.sdf</uri><name>c</name></include>
    <model name='top'><pose relative_to='b'>0 1 0 0 0 0</pose><link name='l'>)" +
                                   kBox + "</link></model>"));
  ASSERT_EQ(scene.bodies.size(), 4u);
  EXPECT_EQ(named(scene, "cart::l").pose.position, Vec3(0, 0, 1));
  EXPECT_EQ(named(scene, "b::l").pose.position, Vec3(5, 0, 2));
  EXPECT_EQ(named(scene, "c::l").pose.position, Vec3(0, 0, 1));
  EXPECT_EQ(named(scene, "top::l").pose.position, Vec3(5, 1, 2));
}

struct BadSdf {
  const char* name;
  std::string text;
  const char* part;  // of the message
};
void PrintTo(const BadSdf& input, std::ostream* out) { *out << input.name; }

class SceneBadSdf : public ::testing::TestWithParam<BadSdf> {};

TEST_P(SceneBadSdf, IsRefused) {
  Import import;
  try {
    import(GetParam().text);
    FAIL() << "accepted";
  } catch (const SceneError& e) {
    EXPECT_NE(std::string(e.what()).find("test.sdf"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find(GetParam().part), std::string::npos) << e.what();
  }
}

std::string one(const std::string& link) { return world("<model name='m'><link name='l'>" + link + "</link></model>"); }
std::string shape(const std::string& geometry) {
  return one("<collision name='c'><geometry>" + geometry + "</geometry></collision>");
}

INSTANTIATE_TEST_SUITE_P(
    Scene, SceneBadSdf,
    ::testing::Values(
        BadSdf{"CutShort", world("<model name='m'><link name='l'>" + kBox + "</link></model>").substr(0, 120), "XML"},
        BadSdf{"NotSdf", "<robot name='r'/>", "<sdf>"}, BadSdf{"Empty", "", "XML"},
        BadSdf{"NoVersion", "<sdf><world name='w'/></sdf>", "version"},
        BadSdf{"NothingToSimulate", world(""), "no model"},
        BadSdf{"NanPose", world("<model name='m'><pose>nan 0 0 0 0 0</pose><link name='l'>" + kBox + "</link></model>"),
               "body 1 \"m::l\": pose.position.x"},
        BadSdf{"FarAway", world("<model name='m'><pose>1e9 0 0 0 0 0</pose><link name='l'>" + kBox + "</link></model>"),
               "pose.position.x"},
        BadSdf{"ZeroSize", shape("<box><size>1 0 1</size></box>"), "box.size.y"},
        BadSdf{"NegativeRadius", shape("<sphere><radius>-1</radius></sphere>"), "sphere.radius"},
        BadSdf{"DynamicPlane", shape("<plane><normal>0 0 1</normal></plane>"), "static"},
        BadSdf{"Heightmap", shape("<heightmap><uri>x.png</uri></heightmap>"), "heightmap"},
        BadSdf{"Polyline", shape("<polyline><point>0 0</point><height>1</height></polyline>"), "polyline"},
        BadSdf{"MissingMesh", shape("<mesh><uri>missing.obj</uri></mesh>"), "missing.obj"},
        BadSdf{"MissingInclude", world("<include><uri>model://missing</uri></include>"), "model://missing"},
        BadSdf{
            "NegativeMass",
            one(kBox + "<inertial><mass>-1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"),
            "m"},
        BadSdf{"ZeroInertia",
               one(kBox + "<inertial><mass>1</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia></inertial>"),
               "inertia"},
        BadSdf{"BadNumber", shape("<sphere><radius>wide</radius></sphere>"), "m"},
        BadSdf{"SameNameTwice",
               world("<model name='m'><link name='l'>" + kBox + "</link></model>\n<model name='m'><link name='l'>" +
                     kBox + "</link></model>"),
               "test.sdf:5: model \"m\": name"},
        BadSdf{"RestitutionAboveOne",
               one("<collision "
                   "name='c'><geometry><sphere><radius>1</radius></sphere></"
                   "geometry><surface><bounce><restitution_coefficient>2"
                   "</restitution_coefficient></bounce></surface></collision>"),
               "restitution"},
        BadSdf{"UnknownDistribution",
               world("<population name='p'><box><size>1 1 "
                     "1</size></box><distribution><type>spiral</type></distribution><model name='m'><link name='l'>" +
                     kBox + "</link></model></population>"),
               "\"spiral\""},
        BadSdf{"PopulationWithoutRegion",
               world("<population name='p'><model_count>3</model_count><model name='m'><link name='l'>" + kBox +
                     "</link></model></population>"),
               "region"}),
    [](const auto& test) { return std::string(test.param.name); });

// ---- other formats through the same door ---------------------------------------------------------------------------

TEST(SceneLoad, TextWithAMeshFile) {
  std::vector<std::string> warnings;
  const Scene scene = load_any_scene(test::data_file("simple.txtpb"), {}, warnings);
  EXPECT_TRUE(warnings.empty());
  const Body& stone = named(scene, "stone");
  EXPECT_EQ(std::get<ConvexHull>(scene.geometries[stone.shapes[0].geometry]).points.size(), 12u);
  EXPECT_EQ(std::get<ConvexHull>(scene.geometries[named(scene, "wedge").shapes[0].geometry]).points.size(), 6u);
  EXPECT_THROW(load_any_scene("scene.json", {}, warnings), SceneError);
  EXPECT_NEAR(named(scene, "hammer").inertial.mass, 600 * kPi * 0.0025 * 0.8 + 7800 * 0.4 * 0.15 * 0.15, 1e-12);
}

// ---- the cache -----------------------------------------------------------------------------------------------------

class SceneCache : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const char* old = std::getenv("XDG_CACHE_HOME")) old_ = old;
    setenv("XDG_CACHE_HOME", (folder_.path / "cache").c_str(), 1);
    write(file_, world("<plugin name='p' filename='x'/><model name='m'><link name='l'><collision "
                       "name='c'><geometry><mesh><uri>rock.obj</uri>"
                       "</mesh></geometry></collision></link></model>"));
    std::filesystem::copy_file(test::data_file("rock.obj"), file_.parent_path() / "rock.obj");
  }
  void TearDown() override { old_ ? setenv("XDG_CACHE_HOME", old_->c_str(), 1) : unsetenv("XDG_CACHE_HOME"); }

  // Whether the file was converted anew is seen by the progress, which the cache does not make.
  Scene load() {
    warnings_.clear();
    converted_ = false;
    return load_any_scene(
        file_, [this](std::size_t, std::size_t) { converted_ = true; }, warnings_);
  }

  test::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path / "in" / "w.sdf";
  std::optional<std::string> old_;
  std::vector<std::string> warnings_;
  bool converted_ = false;
};

TEST_F(SceneCache, HitGivesTheSameBytesAndWarnings) {
  const std::string first = encode_scene(load());
  const std::vector<std::string> warnings = warnings_;
  EXPECT_TRUE(converted_);
  EXPECT_FALSE(warnings.empty());
  EXPECT_EQ(first, encode_scene(load()));
  EXPECT_FALSE(converted_);
  EXPECT_EQ(warnings, warnings_);
}

TEST_F(SceneCache, ChangedMeshIsNoticed) {
  const std::string first = encode_scene(load());
  std::string mesh = read_file(file_.parent_path() / "rock.obj");
  mesh.replace(mesh.find("0.30"), 4, "0.40");
  write(file_.parent_path() / "rock.obj", mesh);
  EXPECT_NE(first, encode_scene(load()));
  EXPECT_TRUE(converted_);
  // and back: what was kept before is still right
  std::filesystem::copy_file(test::data_file("rock.obj"), file_.parent_path() / "rock.obj",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_EQ(first, encode_scene(load()));
  EXPECT_FALSE(converted_);
}

TEST_F(SceneCache, DamagedEntriesAreMadeAnew) {
  const std::string first = encode_scene(load());
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path / "cache" / "soda" / "sdf")) {
    std::string bytes = read_file(entry.path());
    if (!bytes.empty()) bytes.resize(bytes.size() / 2);
    write(entry.path(), bytes);
  }
  EXPECT_EQ(first, encode_scene(load()));
  EXPECT_TRUE(converted_);
  EXPECT_EQ(first, encode_scene(load()));
  EXPECT_FALSE(converted_);
}

TEST_F(SceneCache, UnusableFolderIsNoError) {
  setenv("XDG_CACHE_HOME", "/proc/no/such/folder", 1);
  EXPECT_EQ(load().bodies.size(), 1u);
  EXPECT_EQ(load().bodies.size(), 1u);
  EXPECT_TRUE(converted_);
}

}  // namespace
}  // namespace soda
