// What is wrong with a scene is refused at the door, by a message that names file, line, body and field.
#include <gtest/gtest.h>

#include "common/scene/scene_file.h"
#include "scene.pb.h"
#include "tests/unit/scene_support.h"

namespace soda {
namespace {

struct BadInput {
  const char* name;    // of the test
  const char* text;    // of the scene; the culprit is in line 2
  const char* body;    // as the message has it
  const char* field;   // likewise
  const char* reason;  // a part of it
};

void PrintTo(const BadInput& input, std::ostream* out) { *out << input.name; }

class SceneBadInput : public ::testing::TestWithParam<BadInput> {};

TEST_P(SceneBadInput, IsRefusedByName) {
  const BadInput& bad = GetParam();
  try {
    scene_from_text(bad.text, "bad.txtpb");
    FAIL() << "accepted";
  } catch (const SceneError& e) {
    EXPECT_EQ(e.source, "bad.txtpb");
    EXPECT_EQ(e.body, bad.body);
    EXPECT_EQ(e.field, bad.field);
    EXPECT_NE(e.reason.find(bad.reason), std::string::npos) << e.reason;
    EXPECT_EQ(e.line, 2) << e.what();
    for (const std::string& part : {std::string("bad.txtpb:2: "), e.body, e.field, e.reason})
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
  }
}

#define BODY(fields) "body { name: \"b\" " fields " }"
#define BOX "shape { box { size { x: 1 y: 1 z: 1 } } } "
#define B7 "body 1 \"b\""

const BadInput kBad[] = {
    {"NanPosition", "body { name: \"b\" " BOX "pose { position {\n x: nan } } }", B7, "pose.position.x", "finite"},
    {"InfinitePosition", "body { name: \"b\" " BOX "pose { position {\n z: -inf } } }", B7, "pose.position.z",
     "finite"},
    {"FarAway", "body { name: \"b\" " BOX "pose { position {\n y: 1e12 } } }", B7, "pose.position.y", "1e+07"},
    {"ZeroQuaternion", "body { name: \"b\" " BOX "pose {\n orientation {} } }", B7, "pose.orientation",
     "zero quaternion"},
    {"NanQuaternion", "body { name: \"b\" " BOX "pose {\n orientation { x: nan } } }", B7, "pose.orientation",
     "finite"},
    {"HugeQuaternion", "body { name: \"b\" " BOX "pose {\n orientation { x: 1e200 } } }", B7, "pose.orientation",
     "unit"},
    {"NanVelocity", "body { name: \"b\" " BOX "linear_velocity {\n x: nan } }", B7, "linear_velocity.x", "finite"},
    {"TooFast", "body { name: \"b\" " BOX "\n linear_velocity { x: 1e8 } }", B7, "linear_velocity", "max_speed"},
    {"SpinsTooFast", "body { name: \"b\" " BOX "\n angular_velocity { x: 1e8 } }", B7, "angular_velocity", "rad/s"},
    {"MotionOfAStatic", "body { name: \"b\" static: true " BOX "\n motion {} }", B7, "motion", "does not move"},
    {"MotionWithVelocity", "body { name: \"b\" " BOX "motion {}\n linear_velocity { x: 1 } }", B7, "linear_velocity",
     "motion says it"},
    {"MotionWithoutFrequency", "body { name: \"b\" " BOX "\n motion { amplitude { x: 1 } } }", B7, "motion.frequency",
     "where there is an amplitude"},
    {"MotionTooFast", "body { name: \"b\" " BOX "\n motion { amplitude { x: 100 } frequency: 1 } }", B7, "motion",
     "reaches 628.319 m/s"},
    {"NanMotion", "body { name: \"b\" " BOX "motion {\n phase: nan } }", B7, "motion.phase", "finite"},
    {"FixedRotationOfAStatic", "body { name: \"b\" static: true " BOX "\n fixed_rotation: true }", B7, "fixed_rotation",
     "does not move"},
    {"FixedRotationOfAMotion", "body { name: \"b\" motion {} " BOX "\n fixed_rotation: true }", B7, "fixed_rotation",
     "motion"},
    {"FixedRotationThatSpins", "body { name: \"b\" fixed_rotation: true " BOX "\n angular_velocity { x: 1 } }", B7,
     "angular_velocity", "fixed_rotation"},
    {"ZeroRadius", "body { name: \"b\" shape {\n sphere {} } }", B7, "shape[0].sphere.radius", "is 0"},
    {"NegativeRadius", "body { name: \"b\" shape { sphere {\n radius: -1 } } }", B7, "shape[0].sphere.radius", "is -1"},
    {"NanRadius", "body { name: \"b\" shape { sphere {\n radius: nan } } }", B7, "shape[0].sphere.radius", "finite"},
    {"ZeroBoxEdge", "body { name: \"b\" shape { box { size { x: 1\n z: 1 y: 0 } } } }", B7, "shape[0].box.size.y",
     "is 0"},
    {"SecondShape", "body { name: \"b\" " BOX "shape { cylinder { radius: 1\n length: -2 } } }", B7,
     "shape[1].cylinder.length", "is -2"},
    {"WithinCompound",
     "body { name: \"b\" shape { compound { " BOX "shape { capsule {\n radius: inf length: 1 } } } } }", B7,
     "shape[0].compound.shape[1].capsule.radius", "finite"},
    {"EmptyCompound", "body { name: \"b\" shape {\n compound {} } }", B7, "shape[0].compound", "at least one"},
    {"NoShape", "\nbody { name: \"b\" }", B7, "shape", "at least one"},
    {"UnknownShape", "body { name: \"b\"\n shape {} }", B7, "shape[0]", "no shape"},
    {"FlatHull", "body { name: \"b\" shape { convex_hull {\n points: [0,0,0, 1,0,0, 0,1,0, 1,1,0] } } }", B7,
     "shape[0].convex_hull.points", "one plane"},
    {"FewHullPoints", "body { name: \"b\" shape { convex_hull {\n points: [0,0,0, 1,0,0, 0,1,0] } } }", B7,
     "shape[0].convex_hull.points", "at least 4"},
    {"HullNumbersNotByThree", "body { name: \"b\" shape { convex_hull {\n points: [0,0,0, 1] } } }", B7,
     "shape[0].convex_hull.points", "3"},
    {"DynamicPlane", "body { name: \"b\" shape {\n plane {} } }", B7, "shape[0].plane", "static"},
    {"ZeroPlaneNormal", "body { name: \"b\" static: true shape { plane {\n normal {} } } }", B7,
     "shape[0].plane.normal", "direction"},
    {"DynamicMesh",
     "body { name: \"b\" shape {\n triangle_mesh { vertices: [0,0,0,1,0,0,0,1,0] triangles: [0,1,2] } } }", B7,
     "shape[0].triangle_mesh", "static"},
    {"MeshIndex",
     "body { name: \"b\" static: true shape { triangle_mesh { vertices: [0,0,0,1,0,0,0,1,0]\n triangles: [0,1,3] } } }",
     B7, "shape[0].triangle_mesh.triangles[0]", "names vertex 3"},
    {"HeightFieldCount",
     "body { name: \"b\" static: true shape { height_field { columns: 2 rows: 2 spacing_x: 1 spacing_y: 1\n heights: "
     "[1,2,3] } } }",
     B7, "shape[0].height_field.heights", "4 values"},
    {"UnknownSharedGeometry", "body { name: \"b\" shape {\n shared: 3 } }", B7, "shape[0].shared", "geometry 3 of 0"},
    {"BadSharedGeometry", "geometry { box {\n size { x: 1 } } }", "", "geometry[0].box.size.y", "is 0"},
    {"MeshFileWithoutLoader", "body { name: \"b\" shape {\n mesh_file { path: \"x.obj\" } } }", B7,
     "shape[0].mesh_file", "convert"},
    {"NegativeMass", "body { name: \"b\" " BOX "inertial {\n mass: -1 } }", B7, "inertial.mass", "is -1"},
    {"ZeroMass", "body { name: \"b\" " BOX "inertial {\n mass: 0 } }", B7, "inertial.mass", "is 0"},
    {"TinyMass", "body { name: \"b\" " BOX "inertial {\n mass: 1e-12 } }", B7, "inertial.mass", "1e-09"},
    {"HugeMass", "body { name: \"b\" " BOX "inertial {\n mass: 1e15 } }", B7, "inertial.mass", "1e+12"},
    {"NanMass", "body { name: \"b\" " BOX "inertial {\n mass: nan } }", B7, "inertial.mass", "nan"},
    {"ZeroInertia", "body { name: \"b\" " BOX "inertial { mass: 1\n inertia {} } }", B7, "inertial.inertia",
     "positive definite"},
    {"NegativeInertia", "body { name: \"b\" " BOX "inertial { mass: 1\n inertia { xx: 1 yy: -1 zz: 1 } } }", B7,
     "inertial.inertia", "positive definite"},
    {"TinyInertia", "body { name: \"b\" " BOX "inertial { mass: 1\n inertia { xx: 1e-20 yy: 1 zz: 1 } } }", B7,
     "inertial.inertia", "gyration"},
    {"InertiaWithoutMass", "body { name: \"b\" " BOX "\n inertial { inertia { xx: 1 yy: 1 zz: 1 } } }", B7,
     "inertial.mass", "given"},
    {"CentreWithoutInertia", "body { name: \"b\" " BOX "\n inertial { mass: 1 centre { x: 1 } } }", B7,
     "inertial.inertia", "given"},
    {"NegativeDensity", "body { name: \"b\" " BOX "\n density: -5 }", B7, "density", "kg/m^3"},
    {"NegativeFriction", "body { name: \"b\" " BOX "\n friction: -0.1 }", B7, "friction", "is -0.1"},
    {"RestitutionAboveOne", "body { name: \"b\" " BOX "\n restitution: 1.5 }", B7, "restitution", "is 1.5"},
    {"NanDamping", "body { name: \"b\" " BOX "\n linear_damping: nan }", B7, "linear_damping", "finite"},
    {"DriveWithoutStrength", "body { name: \"b\" " BOX "\n drive { velocity { x: 1 } } }", B7, "drive.max_acceleration",
     "is 0"},
    {"DriveBoundsEmpty",
     "body { name: \"b\" " BOX "drive { max_acceleration: 1\n bounds { min { x: 1 } max { x: 1 y: 1 z: 1 } } } }", B7,
     "drive.bounds.max.x", "above min"},
    {"StaticVelocity", "body { name: \"b\" static: true " BOX "\n linear_velocity { x: 1 } }", B7, "linear_velocity",
     "static"},
    {"StaticDrive", "body { name: \"b\" static: true " BOX "\n drive { max_acceleration: 1 } }", B7, "drive", "static"},
    {"UnknownMaterial", "body { name: \"b\" " BOX "\n material: \"ice\" }", B7, "material", "\"ice\""},
    {"TwoMaterialsOfOneName", "material { name: \"ice\" } material {\n name: \"ice\" }", "", "material[1].name",
     "twice"},
    {"BadMaterial", "material { name: \"ice\"\n friction: nan }", "", "material[0].friction", "nan"},
    {"DuplicateIds", "body { id: 4 name: \"a\" " BOX "} body {\n id: 4 name: \"b\" " BOX "}", "body 4 \"b\"", "id",
     "\"a\""},
    {"IdZero", "body {\n id: 0 name: \"b\" " BOX "}", "body 0 \"b\"", "id", "between 1"},
    {"IdTooLarge", "body {\n id: 9223372036854775808 name: \"b\" " BOX "}", "body 9223372036854775808 \"b\"", "id",
     "2^63"},
    {"NoBodiesButCount", "\nbody_count: 3", "", "body_count", "cut short"},
    {"NanGravity", "gravity {\n x: nan }", "", "gravity.x", "finite"},
    {"ZeroStep", "\ndt: 0 " BODY(BOX), "", "dt", "is 0"},
    {"NegativeStep", "\ndt: -0.1 " BODY(BOX), "", "dt", "is -0.1"},
    {"NoSubsteps", "\nmodel { substeps: 0 } " BODY(BOX), "", "model.substeps", "is 0"},
    {"TooManySubsteps", "\nmodel { substeps: 65 } " BODY(BOX), "", "model.substeps", "is 65"},
    {"TerritoryWithoutCorner", "\nterritory { world: 1 min {} } " BODY(BOX), "", "territory[0]", "must be given"},
    {"TerritoryInsideOut", "territory {\n min { x: 1 } max {} } " BODY(BOX), "", "territory[0].max", "below min"},
    {"TerritoryOfNobody", "territory {\n world: 5000 min {} max {} } " BODY(BOX), "", "territory[0].world", "5000"},
    {"NoSuchJointMethod", "model {\n joints: GUESSED }", "", "", "GUESSED"},
    {"NegativeCell", "\nterritory_cell: -1 " BODY(BOX), "", "territory_cell", "is -1"},
    {"ZeroMaxSpeed", "\nmax_speed: 0 " BODY(BOX), "", "max_speed", "is 0"},
    {"UnknownField", "body { name: \"b\"\n wings: 2 }", "", "", "wings"},
    {"NotANumber", "body { name: \"b\" shape { sphere { radius:\n wide } } }", "", "", "wide"},
    {"ControlCharacterInName", "body {\n name: \"a\\nb\" " BOX "}", "body 1 \"a\nb\"", "name", "control"},
    {"NotUtf8", "body {\n name: \"\\xff\" " BOX "}", "body 1 \"\xff\"", "name", "UTF-8"},
};

INSTANTIATE_TEST_SUITE_P(Scene, SceneBadInput, ::testing::ValuesIn(kBad),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(SceneBadInputMore, NoBodiesAtAll) {
  EXPECT_THROW(scene_from_text("# nothing\n", "empty.txtpb"), SceneError);
  EXPECT_THROW(scene_from_text("", "empty.txtpb"), SceneError);
}

TEST(SceneBadInputMore, EndlessNestingIsRefused) {
  std::string text = "body { ", end = "}";
  for (int i = 0; i < 10000; ++i) text += "shape { compound { ", end += "} }";
  EXPECT_THROW(scene_from_text(text + "shape { sphere { radius: 1 } }" + end, "deep.txtpb"), SceneError);
}

TEST(SceneBadInputMore, PartsOfANewerFormatAreRefused) {
  pb::Scene message;
  pb::Body* body = message.add_body();
  body->add_shape()->mutable_sphere()->set_radius(1);
  EXPECT_NO_THROW(from_proto(message, "now"));
  body->mutable_shape(0)->GetReflection()->MutableUnknownFields(body->mutable_shape(0))->AddVarint(99, 1);
  try {
    from_proto(message, "newer");
    FAIL() << "accepted";
  } catch (const SceneError& e) {
    EXPECT_EQ(e.body, "body 1");
    EXPECT_EQ(e.field, "shape[0]");
    EXPECT_NE(e.reason.find("99"), std::string::npos);
  }
}

// Scenes that never were in a file are checked by the same rules.
TEST(SceneBadInputMore, ValidateChecksScenesMadeInMemory) {
  Scene scene = test::every_kind();
  scene.bodies[3].inertial.inertia(0, 1) = 1e-3;  // not symmetric
  try {
    validate(scene, "memory");
    FAIL() << "accepted";
  } catch (const SceneError& e) {
    EXPECT_EQ(e.body_index, 3u);
    EXPECT_EQ(e.field, "inertial.inertia");
  }
  scene = test::every_kind();
  std::swap(scene.bodies[0], scene.bodies[1]);
  EXPECT_THROW(validate(scene, "memory"), SceneError);
  scene = test::every_kind();
  scene.bodies[0].shapes[0].geometry = 1000;
  EXPECT_THROW(validate(scene, "memory"), SceneError);
  scene = test::every_kind();
  scene.bodies[0].pose.orientation.coeffs() *= 2;
  EXPECT_THROW(validate(scene, "memory"), SceneError);
}

}  // namespace
}  // namespace soda
