// Joints of SDF models: frames against hand computation, limits, what is refused.
#include <gtest/gtest.h>

#include <fstream>

#include "common/import/sdf.h"
#include "common/scene/scene_file.h"
#include "tests/unit/scene_support.h"

namespace soda::sdf_joints {
namespace {

constexpr double kPi = 3.14159265358979323846;

std::string link(const std::string& name, const std::string& pose) {
  return "<link name='" + name + "'><pose>" + pose +
         "</pose><collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision></link>\n";
}

std::string joint(const std::string& type, const std::string& content, const std::string& parent = "a",
                  const std::string& child = "b") {
  return "<joint name='j' type='" + type + "'><parent>" + parent + "</parent><child>" + child + "</child>" + content +
         "</joint>";
}

// Links a and b, 1 m apart along x, in a model m; `more` is in the model, too.
std::string model(const std::string& more) {
  return "<model name='m'>" + link("a", "0 0 0 0 0 0") + link("b", "1 0 0 0 0 0") + more + "</model>";
}

std::string axis(const std::string& xyz, const std::string& more = "") {
  return "<axis><xyz>" + xyz + "</xyz>" + more + "</axis>";
}

std::string limit(const std::string& lower, const std::string& upper) {
  return "<limit><lower>" + lower + "</lower><upper>" + upper + "</upper></limit>";
}

struct Import {
  test::TemporaryFolder folder;
  std::vector<std::string> warnings;
  Scene operator()(const std::string& content) {
    warnings.clear();
    std::ofstream(folder.path / "test.sdf") << "<?xml version='1.0'?>\n<sdf version='1.9'>\n<world name='w'>\n"
                                            << content << "\n</world></sdf>\n";
    SdfOptions options;
    options.use_cache = false;
    return load_sdf(folder.path / "test.sdf", options, warnings);
  }
  Joint one(const std::string& content) { return (*this)(model(content)).joints.at(0); }
  std::size_t mentions(const std::string& what) const {
    std::size_t n = 0;
    for (const std::string& w : warnings) n += w.find(what) != std::string::npos;
    return n;
  }
};

Pose end_in_world(const Scene& scene, BodyId body, const Pose& frame) {
  return body == kWorldBody ? frame : scene.bodies.at(body - 1).pose * frame;
}

// Both ends of a joint are at a place, their axes along a direction.
void expect_at(const Scene& scene, const Joint& joint, const Vec3& at, const Vec3& own_axis, const Vec3& direction) {
  SCOPED_TRACE(joint.name);
  for (const Pose& end : {end_in_world(scene, joint.a, joint.frame_a), end_in_world(scene, joint.b, joint.frame_b)}) {
    EXPECT_LT((end.position - at).norm(), 1e-12) << end.position.transpose();
    EXPECT_LT((end.orientation * own_axis - direction).norm(), 1e-12) << (end.orientation * own_axis).transpose();
  }
}

TEST(SceneSdfJoints, DoublePendulumThatHangsFromTheWorld) {
  Import import;
  // The model is turned by a right angle about z: its x is the world's y.
  const Scene scene = import("<model name='p'><pose>10 0 5 0 0 1.5707963267948966</pose>" +
                             link("upper", "0 0 -1 0 0 0") + link("lower", "0 0 -3 0 0 0") +
                             R"(<joint name='elbow' type='revolute'><pose>0 0 1 0 0 0</pose>
                               <parent>upper</parent><child>lower</child><axis><xyz>1 0 0</xyz>
                               <limit><lower>-0.5</lower><upper>2</upper></limit></axis></joint>
                             <joint name='shoulder' type='continuous'><pose>0 0 1 0 0 0</pose>
                               <parent>world</parent><child>upper</child><axis><xyz>1 0 0</xyz></axis></joint>
                             </model>)");
  ASSERT_EQ(scene.joints.size(), 2u);
  const Joint &shoulder = scene.joints[0], &elbow = scene.joints[1];
  EXPECT_EQ(shoulder.name, "p::shoulder");
  EXPECT_EQ(shoulder.a, 1u);
  EXPECT_EQ(shoulder.b, kWorldBody);
  EXPECT_FALSE(shoulder.limits);
  expect_at(scene, shoulder, Vec3(10, 0, 5), Vec3::UnitZ(), Vec3::UnitY());
  EXPECT_EQ(elbow.kind, JointKind::kHinge);
  EXPECT_EQ(elbow.a, 1u);
  EXPECT_EQ(elbow.b, 2u);
  EXPECT_FALSE(elbow.bodies_collide);
  EXPECT_EQ(elbow.limits->lower, -0.5);
  EXPECT_EQ(elbow.limits->upper, 2);
  expect_at(scene, elbow, Vec3(10, 0, 3), Vec3::UnitZ(), Vec3::UnitY());
  EXPECT_GT(scene.bodies[0].joint_reach, 1);
  EXPECT_TRUE(import.mentions("joint") == 0);
  test::expect_same_bits(scene, decode_scene(encode_scene(scene), "memory"));
}

TEST(SceneSdfJoints, EachKind) {
  Import import;
  Scene scene = import(model(joint("prismatic", axis("0 1 0", limit("-0.2", "0.4")))));
  EXPECT_EQ(scene.joints[0].kind, JointKind::kSlider);
  EXPECT_EQ(scene.joints[0].limits->lower, -0.2);
  EXPECT_EQ(scene.joints[0].limits->upper, 0.4);
  expect_at(scene, scene.joints[0], Vec3(1, 0, 0), Vec3::UnitX(), Vec3::UnitY());
  EXPECT_EQ(import.one(joint("ball", "")).kind, JointKind::kBall);
  EXPECT_EQ(import.one(joint("fixed", "")).kind, JointKind::kFixed);
  EXPECT_FALSE(import.one(joint("continuous", axis("0 0 1"))).limits);
}

TEST(SceneSdfJoints, ChildFirstIsTurnedRound) {
  Import import;
  const Joint turned = import.one(joint("revolute", axis("0 0 1", limit("-0.5", "1")), "b", "a"));
  EXPECT_EQ(turned.a, 1u);
  EXPECT_EQ(turned.b, 2u);
  EXPECT_EQ(turned.limits->lower, -1);
  EXPECT_EQ(turned.limits->upper, 0.5);
}

TEST(SceneSdfJoints, PosesAndAxesInOtherFrames) {
  Import import;
  const Scene scene = import(model(R"(<frame name='f'><pose>0.5 0 0.5 0 0 1.5707963267948966</pose></frame>
      <joint name='j' type='revolute'><pose relative_to='f'/><parent>a</parent><child>b</child>
        <axis><xyz expressed_in='__model__'>1 0 0</xyz></axis></joint>
      <joint name='k' type='revolute'><pose relative_to='f'/><parent>a</parent><child>b</child>
        <axis><xyz>1 0 0</xyz></axis></joint>)"));
  expect_at(scene, scene.joints.at(0), Vec3(0.5, 0, 0.5), Vec3::UnitZ(), Vec3::UnitX());
  expect_at(scene, scene.joints.at(1), Vec3(0.5, 0, 0.5), Vec3::UnitZ(), Vec3::UnitY());
}

TEST(SceneSdfJoints, NestedAndStaticModels) {
  Import import;
  const Scene scene =
      import("<model name='outer'><model name='inner'><pose>0 2 0 0 0 0</pose>" + link("a", "0 0 0 0 0 0") +
             link("b", "1 0 0 0 0 0") + joint("ball", "") + "</model><model name='base'><static>1</static>" +
             link("l", "0 1 0 0 0 0") + "</model>" + joint("fixed", "", "base::l", "inner::a") + "</model>");
  ASSERT_EQ(scene.joints.size(), 2u);
  EXPECT_EQ(scene.joints[0].name, "outer::inner::j");
  EXPECT_EQ(scene.joints[0].b, 2u);
  expect_at(scene, scene.joints[0], Vec3(1, 2, 0), Vec3::UnitZ(), Vec3::UnitZ());
  EXPECT_EQ(scene.joints[1].name, "outer::j");
  EXPECT_EQ(scene.joints[1].a, 1u);
  EXPECT_EQ(scene.joints[1].b, 3u);
  EXPECT_TRUE(scene.bodies[2].is_static);
  expect_at(scene, scene.joints[1], Vec3(0, 2, 0), Vec3::UnitZ(), Vec3::UnitZ());
}

TEST(SceneSdfJoints, EachCopyOfAModelHasItsOwn) {
  Import import;
  std::string models;
  for (int i = 0; i < 3; ++i)
    models += "<model name='m" + std::to_string(i) + "'><pose>0 " + std::to_string(3 * i) + " 0 0 0 0</pose>" +
              link("a", "0 0 0 0 0 0") + link("b", "1 0 0 0 0 0") + joint("ball", "") +
              "<joint name='hook' type='fixed'><parent>world</parent><child>a</child></joint></model>";
  const Scene scene = import(models);
  ASSERT_EQ(scene.joints.size(), 6u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(scene.joints[2 * i].name, "m" + std::to_string(i) + "::hook");
    EXPECT_EQ(scene.joints[2 * i].a, 2u * i + 1);
    expect_at(scene, scene.joints[2 * i], Vec3(0, 3 * i, 0), Vec3::UnitZ(), Vec3::UnitZ());
    EXPECT_EQ(scene.joints[2 * i + 1].b, 2u * i + 2);
  }
}

// What SDF's angle, which counts turns, makes of ours.
TEST(SceneSdfJoints, LimitsOfARevolute) {
  Import import;
  EXPECT_FALSE(import.one(joint("revolute", axis("0 0 1"))).limits);
  EXPECT_FALSE(import.one(joint("revolute", axis("0 0 1", limit("-1e16", "1e16")))).limits);
  EXPECT_EQ(import.mentions("limits"), 0u);
  EXPECT_FALSE(import.one(joint("revolute", axis("0 0 1", limit("-6.3", "6.3")))).limits);
  EXPECT_EQ(import.mentions("span a turn"), 1u);
  EXPECT_FALSE(import.one(joint("revolute", axis("0 0 1", limit("0", "1e16")))).limits);
  EXPECT_EQ(import.mentions("are only one"), 1u);
  // From 1 to 5: the middle, 3, becomes 0, so the joint stands at -3.
  const Joint moved = import.one(joint("revolute", axis("0 0 1", limit("1", "5"))));
  EXPECT_EQ(moved.limits->lower, -2);
  EXPECT_EQ(moved.limits->upper, 2);
  const Quat turn = moved.frame_a.orientation.conjugate() * moved.frame_b.orientation;
  EXPECT_NEAR(2 * std::atan2(turn.z(), turn.w()), -3, 1e-12);
}

TEST(SceneSdfJoints, WhatIsNotModelledIsListed) {
  Import import;
  import(model(joint("revolute", axis("0 0 1",
                                      "<limit><lower>0</lower><upper>1</upper><effort>5</effort>"
                                      "<velocity>-1</velocity></limit><dynamics><damping>0.1</damping>"
                                      "<friction>0</friction><spring_reference>0</spring_reference>"
                                      "<spring_stiffness>3</spring_stiffness></dynamics>"))));
  EXPECT_EQ(import.mentions("<effort> in <limit>"), 1u);
  EXPECT_EQ(import.mentions("<damping> in <dynamics>"), 1u);
  EXPECT_EQ(import.mentions("<spring_stiffness> in <dynamics>"), 1u);
  EXPECT_EQ(import.mentions("<velocity>") + import.mentions("<friction>") + import.mentions("<spring_reference>"), 0u);
  import("<model name='s'><static>1</static>" + link("a", "0 0 0 0 0 0") + link("b", "1 0 0 0 0 0") +
         joint("fixed", "") + "</model>" + model(""));
  EXPECT_EQ(import.mentions("<joint> between what does not move"), 1u);
}

TEST(SceneSdfJoints, UniversalTurnsAboutBothItsAxes) {
  Import import;
  const Joint one = import.one(joint("universal", axis("0 0 -2") + "<axis2><xyz>0.6 -0.8 0</xyz></axis2>"));
  EXPECT_EQ(one.kind, JointKind::kUniversal);
  // x of the parent's frame along the first axis, y of the child's along the second.
  EXPECT_LT((one.frame_a.orientation * Vec3::UnitX() - Vec3(0, 0, -1)).norm(), 1e-12);
  EXPECT_LT((one.frame_b.orientation * Vec3::UnitY() - Vec3(0.6, -0.8, 0)).norm(), 1e-12);
  import.one(joint("universal", axis("1 0 0", limit("-1", "1")) + "<axis2><xyz>0 1 0</xyz></axis2>"));
  EXPECT_EQ(import.mentions("limits of a universal <joint>"), 1u);
}

struct BadSdfJoint {
  const char* name;
  std::string text;
  const char* part;  // of the message
};
void PrintTo(const BadSdfJoint& bad, std::ostream* out) { *out << bad.name; }

class SceneBadSdfJoint : public ::testing::TestWithParam<BadSdfJoint> {};

TEST_P(SceneBadSdfJoint, IsRefused) {
  Import import;
  try {
    import(GetParam().text);
    FAIL() << "accepted";
  } catch (const SceneError& e) {
    EXPECT_NE(std::string(e.what()).find(GetParam().part), std::string::npos) << e.what();
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scene, SceneBadSdfJoint,
    ::testing::Values(
        BadSdfJoint{"UniversalWithOneAxis", model(joint("universal", axis("1 0 0"))), "joint \"m::j\": axis2"},
        BadSdfJoint{"UniversalWithParallelAxes",
                    model(joint("universal", axis("1 0 0") + "<axis2><xyz>1 0.1 0</xyz></axis2>")), "across"},
        BadSdfJoint{"Screw", model(joint("screw", axis("1 0 0"))), "\"screw\" is not simulated"},
        BadSdfJoint{"Gearbox", model(joint("gearbox", axis("1 0 0") + "<axis2><xyz>0 1 0</xyz></axis2>")),
                    "\"gearbox\" is not simulated"},
        BadSdfJoint{"Revolute2", model(joint("revolute2", axis("1 0 0") + "<axis2><xyz>0 1 0</xyz></axis2>")),
                    "\"revolute2\" is not simulated"},
        BadSdfJoint{"PrismaticWithoutLimits", model(joint("prismatic", axis("1 0 0"))), "both limits"},
        BadSdfJoint{"PrismaticWithOneLimit",
                    model(joint("prismatic", axis("1 0 0", "<limit><lower>0</lower></limit>"))), "both limits"},
        BadSdfJoint{"LimitsCrossed", model(joint("revolute", axis("0 0 1", limit("1", "-1")))), "axis.limit.upper"},
        BadSdfJoint{"RevoluteWithoutAxis", model(joint("revolute", "")), "axis"},
        BadSdfJoint{"ZeroAxis", model(joint("revolute", axis("0 0 0"))), "xyz"},
        BadSdfJoint{"NoSuchLink", model(joint("ball", "", "a", "z")), "z"},
        BadSdfJoint{"LinkThatIsLeftOut", model("<link name='ghost'/>" + joint("ball", "", "a", "ghost")),
                    "\"m::ghost\" has nothing that collides"},
        BadSdfJoint{"JointOfTheWorld", model("") + joint("fixed", "", "world", "m::a"), "joints of a <world>"}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace soda::sdf_joints
