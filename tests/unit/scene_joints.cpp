// Joints in scene files and builders: every bit kept, ends put in order, what is wrong refused by name.
#include <gtest/gtest.h>

#include <cmath>

#include "common/grid.h"
#include "common/scene/scene_file.h"
#include "scene.pb.h"
#include "tests/unit/scene_support.h"

namespace soda::scene_joints {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Four boxes of 1 m, 1 m apart along x (1, 2, 3 dynamic, 4 static), and a joint in line 2.
std::string with_joint(const std::string& joint) {
  std::string text;
  for (int i = 0; i < 4; ++i)
    text += "body { pose { position { x: " + std::to_string(i) + " } } shape { box { size { x: 1 y: 1 z: 1 } } } " +
            (i == 3 ? "static: true " : "") + "} ";
  return text + "\n" + joint;
}

Joint read_one(const std::string& joint) { return scene_from_text(with_joint(joint), "text").joints.at(0); }

// A chain with a joint of every kind, and numbers that are easily lost.
Scene every_joint() {
  SceneBuilder builder("every joint");
  for (int i = 0; i < 6; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(i, 1.0 / 3, -0.0), Quat(0.5, -0.5, 0.5, -0.5));
  const auto between = [](int i) { return Vec3(i + 0.5, 1.0 / 3, 0); };
  Joint& soft = builder.add_joint(JointKind::kFixed, 1, 0, between(0));  // ends the wrong way round
  soft.spring = JointSpring{1.0 / 3, 0.7};
  soft.name = "soft \xc3\xa9";
  Joint& ball = builder.add_joint(JointKind::kBall, 1, 2, between(1), Vec3(1, 2, 3));
  ball.limits = JointLimits{-0.1, 0.0};
  ball.cone_limit = 1.0 / 7;
  ball.bodies_collide = true;
  Joint& hinge = builder.add_joint(JointKind::kHinge, 2, 3, between(2), Vec3(0.1, -0.2, -0.3));
  hinge.limits = JointLimits{-0.0, kPi};
  hinge.motor = JointMotor{-1e-300, 5e-324};
  Joint& slider = builder.add_joint(JointKind::kSlider, 4, 3, between(3), Vec3(-1, 1e-9, 0));
  slider.limits = JointLimits{-1.0 / 3, 2};
  slider.motor = JointMotor{0.1, 1e17};
  slider.spring = JointSpring{1e4, 100};
  builder.add_rod(4, 5, between(3), between(5)).name = "rod";
  builder.add_joint(JointKind::kHinge, 5, SceneBuilder::kWorld, between(5), Vec3(0, 1, 0));
  builder.add_joint(JointKind::kFixed, 0, SceneBuilder::kWorld, Vec3(0, 0, 0));
  builder.add_joint(JointKind::kBall, 0, 1, between(0));
  builder.add_joint(JointKind::kUniversal, 5, SceneBuilder::kWorld, between(5), Vec3(0.3, 0.2, -0.1)).name = "cardan";
  builder.scene.joint_method = JointMethod::kDirect;
  builder.scene.territories = {{0, {Vec3(-1, 0, 1.0 / 3), Vec3(0, 1, 2)}}, {1, {Vec3::Zero(), Vec3(1, 1, 1)}}};
  return builder.finish();
}

TEST(SceneJoints, OfBodiesThatNothingTurnsDoNotTurnThem) {
  const auto accepted = [](JointKind kind, bool b_turns, bool cone = false) {
    SceneBuilder builder("upright");
    for (int i = 0; i < 2; ++i) builder.add(Box{Vec3(1, 1, 1)}, Vec3(i, 0, 0)).fixed_rotation = i == 0 || !b_turns;
    Joint& joint = builder.add_joint(kind, 0, 1, Vec3(0.5, 0, 0));
    if (kind == JointKind::kSlider || kind == JointKind::kDistance) joint.limits = JointLimits{0, 1};
    if (cone) joint.cone_limit = 1;
    try {
      builder.finish();
      return true;
    } catch (const SceneError& e) {
      EXPECT_NE(e.reason.find("fixed_rotation"), std::string::npos) << e.what();
      return false;
    }
  };
  for (const JointKind kind : {JointKind::kFixed, JointKind::kHinge, JointKind::kSlider, JointKind::kUniversal}) {
    EXPECT_TRUE(accepted(kind, true)) << name_of(kind);
    EXPECT_FALSE(accepted(kind, false)) << name_of(kind);
  }
  for (const JointKind kind : {JointKind::kBall, JointKind::kDistance}) EXPECT_TRUE(accepted(kind, false));
  EXPECT_FALSE(accepted(JointKind::kBall, false, true));
}

TEST(SceneJoints, BinaryKeepsEveryBit) {
  const Scene scene = every_joint();
  const Scene again = decode_scene(encode_scene(scene), "memory");
  test::expect_same_bits(scene, again);
  EXPECT_EQ(encode_scene(scene), encode_scene(again));
}

TEST(SceneJoints, TextKeepsEveryBit) {
  const Scene scene = every_joint();
  const Scene again = scene_from_text(scene_to_text(scene), "memory");
  test::expect_same_bits(scene, again);
  EXPECT_EQ(scene_to_text(scene), scene_to_text(again));
}

TEST(SceneJoints, TextCutAnywhereIsRefused) {
  const std::string text = scene_to_text(every_joint());
  const std::size_t last = text.find_last_not_of(" \n") + 1;
  for (std::size_t length = 0; length < last; ++length)
    EXPECT_THROW(scene_from_text(std::string_view(text).substr(0, length), "cut.txtpb"), SceneError) << length;
}

TEST(SceneJoints, WhatIsLeftOutIsFilledIn) {
  const Joint hinge = read_one("joint { body_a: 1 hinge {} }");
  EXPECT_EQ(hinge.kind, JointKind::kHinge);
  EXPECT_EQ(hinge.b, kWorldBody);
  EXPECT_FALSE(hinge.limits || hinge.motor || hinge.spring || hinge.bodies_collide);
  EXPECT_TRUE(hinge.frame_a.orientation.coeffs() == Quat::Identity().coeffs());
  EXPECT_EQ(hinge.frame_b.position, Vec3::Zero());
  // A quaternion is normalised.
  EXPECT_EQ(read_one("joint { body_a: 1 fixed {} frame_a { orientation { w: 2 } } }").frame_a.orientation.w(), 1);
}

TEST(SceneJoints, DistanceIsThatOfTheStart) {
  const Joint rod = read_one("joint { body_a: 1 body_b: 3 frame_b { position { y: 1.5 } } distance {} }");
  ASSERT_TRUE(rod.limits);
  EXPECT_EQ(rod.limits->lower, 2.5);
  EXPECT_EQ(rod.limits->upper, 2.5);
  const Joint spring = read_one("joint { body_a: 1 body_b: 3 distance { spring { frequency: 2 } } }");
  EXPECT_EQ(spring.limits->lower, 0);
  EXPECT_EQ(spring.limits->upper, 4);
  const Joint to_the_world = read_one("joint { body_a: 2 frame_b { position { z: 3 } } distance {} }");
  EXPECT_DOUBLE_EQ(to_the_world.limits->upper, std::sqrt(10));
}

TEST(SceneJoints, EndsAreTurnedRound) {
  const char* rest = "frame_a { position { x: -0.5 } } frame_b { position { x: 0.5 } } ";
  for (const char* kind : {"hinge", "slider"}) {
    const Joint joint = read_one(std::string("joint { body_a: 2 body_b: 1 ") + rest + kind +
                                 " { limits { lower: -0.2 upper: 0.7 } motor { target_velocity: 3 max_effort: 5 } } }");
    EXPECT_EQ(joint.a, 1u);
    EXPECT_EQ(joint.b, 2u);
    EXPECT_EQ(joint.frame_a.position.x(), 0.5);
    EXPECT_EQ(joint.frame_b.position.x(), -0.5);
    EXPECT_EQ(joint.limits->lower, -0.7);
    EXPECT_EQ(joint.limits->upper, 0.2);
    EXPECT_EQ(joint.motor->target_velocity, -3);
    EXPECT_EQ(joint.motor->max_effort, 5);
  }
  const Joint ball = read_one(std::string("joint { body_a: 2 body_b: 1 ") + rest +
                              "ball { cone_limit: 0.3 twist_limits { lower: 0 upper: 0.7 } } }");
  EXPECT_EQ(ball.limits->lower, -0.7);
  EXPECT_EQ(ball.limits->upper, 0);
  EXPECT_FALSE(std::signbit(ball.limits->upper));
  EXPECT_EQ(ball.cone_limit, 0.3);
  const Joint distance =
      read_one("joint { body_a: 2 body_b: 1 distance { limits { lower: 1 upper: 2 } motor { target_velocity: 3 } } }");
  EXPECT_EQ(distance.a, 1u);
  EXPECT_EQ(distance.limits->lower, 1);
  EXPECT_EQ(distance.motor->target_velocity, 3);
  // The world, and what is static, is b, whatever its id.
  const Joint world = read_one("joint { body_a: 0 body_b: 2 frame_a { position { x: 1 } } hinge {} }");
  EXPECT_EQ(world.a, 2u);
  EXPECT_EQ(world.b, kWorldBody);
  EXPECT_EQ(world.frame_b.position.x(), 1);
  EXPECT_EQ(read_one("joint { body_a: 4 body_b: 3 frame_a { position { x: -1 } } hinge {} }").a, 3u);
}

TEST(SceneJoints, JointsAreInTheOrderOfTheirBodies) {
  const Scene scene =
      scene_from_text(with_joint("joint { name: \"c\" body_a: 2 fixed {} frame_b { position { x: 1 } } } "
                                 "joint { name: \"b\" body_a: 1 body_b: 2 ball {} frame_b { position { x: -1 } } } "
                                 "joint { name: \"a\" body_a: 1 hinge {} } joint { name: \"a2\" body_a: 1 ball {} }"),
                      "text");
  std::string names;
  for (const Joint& joint : scene.joints) names += joint.name + " ";
  EXPECT_EQ(names, "a a2 b c ");
  EXPECT_EQ(scene.bodies[2].joint_reach, 0);
  EXPECT_GT(scene.bodies[0].joint_reach, 0);
  test::expect_same_bits(scene, decode_scene(encode_scene(scene), "again"));
}

TEST(SceneJoints, ExampleScene) {
  const Scene scene = load_scene(test::data_file("pendulum.txtpb"));
  EXPECT_EQ(scene.joints.size(), 7u);
  for (const Joint& joint : scene.joints) {
    if (joint.kind == JointKind::kDistance) continue;
    const Body& a = scene.bodies.at(joint.a - 1);
    const Pose in_b = joint.b == kWorldBody ? joint.frame_b : scene.bodies.at(joint.b - 1).pose * joint.frame_b;
    const Pose in_a = a.pose * joint.frame_a;
    EXPECT_LT((in_a.position - in_b.position).norm(), 1e-12) << joint.name;
    EXPECT_GT(std::abs(in_a.orientation.dot(in_b.orientation)), 1 - 1e-12) << joint.name;
  }
}

// ---- the builder ---------------------------------------------------------------------------------------------------

// Where a joint's end is in the world.
Pose end_in_world(const Scene& scene, BodyId body, const Pose& frame) {
  return body == kWorldBody ? frame : scene.bodies.at(body - 1).pose * frame;
}

TEST(SceneJointsBuilder, FramesAreWhereTheyWereAskedFor) {
  for (const Vec3& axis : {Vec3(0, 0, 1), Vec3(0, 0, -1), Vec3(-1, 0, 0), Vec3(1, -2, 3), Vec3(-1, 2, -3),
                           Vec3(1e-9, 0, -1), Vec3(-1, 1e-9, 0), Vec3(0, 5, 0)})
    for (const JointKind kind : {JointKind::kHinge, JointKind::kBall, JointKind::kSlider}) {
      SceneBuilder builder("frames");
      builder.add_ground(10);
      builder.add(Sphere{1}, Vec3(1, 2, 3), normalized(Quat(1, 2, 3, 4)));
      builder.add(Sphere{1}, Vec3(2, 3, 4), normalized(Quat(-1, 0.5, 3, 0)));
      const Vec3 at(1.5, 2.5, 3.25);
      builder.add_joint(kind, 0, 1, at, axis).limits = JointLimits{-1, 1};
      builder.add_joint(kind, 1, SceneBuilder::kWorld, at, axis).limits = JointLimits{-1, 1};
      const Scene scene = builder.finish();
      ASSERT_EQ(scene.joints.size(), 2u);
      for (const Joint& joint : scene.joints)
        for (const Pose& end :
             {end_in_world(scene, joint.a, joint.frame_a), end_in_world(scene, joint.b, joint.frame_b)}) {
          EXPECT_LT((end.position - at).norm(), 1e-14);
          const Vec3 along = end.orientation * (kind == JointKind::kSlider ? Vec3::UnitX() : Vec3::UnitZ());
          EXPECT_LT((along - axis.normalized()).norm(), 1e-14) << axis.transpose();
        }
    }
}

TEST(SceneJointsBuilder, OrderAndRods) {
  const Scene scene = every_joint();
  ASSERT_EQ(scene.joints.size(), 9u);
  for (const Joint& joint : scene.joints) EXPECT_TRUE(joint.b == kWorldBody || joint.a < joint.b);
  const Joint& slider = scene.joints[5];
  ASSERT_EQ(slider.kind, JointKind::kSlider);
  EXPECT_EQ(slider.a, 4u);
  EXPECT_EQ(slider.limits->upper, 1.0 / 3);
  EXPECT_EQ(slider.motor->target_velocity, -0.1);
  const Joint& rod = scene.joints[6];
  EXPECT_EQ(rod.name, "rod");
  EXPECT_EQ(rod.limits->lower, 2);
  EXPECT_EQ(rod.limits->upper, 2);
}

TEST(SceneJointsBuilder, AUniversalJointTurnedRoundHoldsTheSame) {
  Joint joint;
  joint.kind = JointKind::kUniversal;
  joint.a = 1, joint.b = 2;
  joint.frame_a = universal_frame(Vec3(1, 2, 3), Vec3(1, 2, -2), Vec3(2, 1, 2));
  joint.frame_b = universal_frame(Vec3(1, 2, 3), Vec3(-1, 0, 0), Vec3(0, 0.6, -0.8));
  EXPECT_LT((joint.frame_a.orientation * Vec3::UnitX() - Vec3(1, 2, -2) / 3).norm(), 1e-14);
  EXPECT_LT((joint.frame_a.orientation * Vec3::UnitY() - Vec3(2, 1, 2) / 3).norm(), 1e-14);
  EXPECT_LT((joint.frame_b.orientation * Vec3::UnitY() - Vec3(0, 0.6, -0.8)).norm(), 1e-14);
  const Joint before = joint;
  turn_round(joint);
  EXPECT_EQ(joint.a, 2u);
  // What was a's x axis is b's y axis now, and the other way round.
  EXPECT_LT((joint.frame_b.orientation * Vec3::UnitY() - before.frame_a.orientation * Vec3::UnitX()).norm(), 1e-14);
  EXPECT_LT((joint.frame_a.orientation * Vec3::UnitX() - before.frame_b.orientation * Vec3::UnitY()).norm(), 1e-14);
}

TEST(SceneJointsBuilder, SliderWithoutLimitsIsRefused) {
  SceneBuilder builder("slider");
  builder.add(Sphere{1}, Vec3::Zero());
  builder.add_joint(JointKind::kSlider, 0, SceneBuilder::kWorld, Vec3::Zero());
  EXPECT_THROW(builder.finish(), SceneError);
}

// ---- what is refused -----------------------------------------------------------------------------------------------

struct BadJoint {
  const char* name;    // of the test
  const char* fields;  // of the joint, which is in line 2
  const char* field;   // as the message has it, after joint[0] "j"
  const char* reason;  // a part of it
};
void PrintTo(const BadJoint& bad, std::ostream* out) { *out << bad.name; }

class SceneBadJoint : public ::testing::TestWithParam<BadJoint> {};

TEST_P(SceneBadJoint, IsRefusedByName) {
  const BadJoint& bad = GetParam();
  try {
    scene_from_text(with_joint(std::string("joint { name: \"j\" ") + bad.fields + " }"), "bad.txtpb");
    FAIL() << "accepted";
  } catch (const SceneError& e) {
    EXPECT_EQ(e.body, "");
    EXPECT_EQ(e.field, std::string("joint[0] \"j\"") + bad.field);
    EXPECT_NE(e.reason.find(bad.reason), std::string::npos) << e.reason;
    EXPECT_EQ(e.line, 2) << e.what();
  }
}

#define JOIN "body_a: 1 body_b: 2 frame_b { position { x: -1 } } "

const BadJoint kBadJoints[] = {
    {"NoKind", "body_a: 1", "", "no kind"},
    {"NoBodyA", "body_b: 1 hinge {}", ".body_a", "must be given"},
    {"UnknownBodyA", "body_a: 9 body_b: 1 hinge {}", ".body_a", "no body of this scene: 9"},
    {"UnknownBodyB", "body_a: 1 body_b: 9 hinge {}", ".body_b", "no body of this scene: 9"},
    {"Itself", "body_a: 1 body_b: 1 hinge {}", ".body_b", "another"},
    {"WorldAndWorld", "body_a: 0 hinge {}", ".body_b", "another"},
    {"StaticAndWorld", "body_a: 4 hinge {}", ".body_a", "dynamic"},
    {"ZeroQuaternion", "body_a: 1 frame_a { orientation {} } hinge {}", ".frame_a.orientation", "zero quaternion"},
    {"NanQuaternion", "body_a: 1 frame_b { orientation { x: nan } } hinge {}", ".frame_b.orientation", "finite"},
    {"NanFrame", "body_a: 1 frame_b { position { x: nan } } hinge {}", ".frame_b.position.x", "finite"},
    {"NanFrameOfARod", "body_a: 1 frame_b { position { x: nan } } distance {}", ".frame_b.position.x", "finite"},
    {"FarFrame", "body_a: 1 frame_a { position { y: 1e9 } } hinge {}", ".frame_a.position.y", "1e+07"},
    {"LimitsCrossed", JOIN "hinge { limits { lower: 1 upper: -1 } }", ".hinge.limits.upper", "-1 below 1"},
    {"LimitsCrossedInTheFilesNumbers", "body_a: 2 body_b: 1 hinge { limits { lower: 2 upper: 1 } }",
     ".hinge.limits.upper", "1 below 2"},
    {"NanLimit", JOIN "hinge { limits { lower: nan upper: 1 } }", ".hinge.limits.lower", "finite"},
    {"HingeBeyondHalfATurn", JOIN "hinge { limits { upper: 3.2 } }", ".hinge.limits.upper", "3.14159 rad"},
    {"HingeBelowHalfATurn", JOIN "hinge { limits { lower: -3.2 } }", ".hinge.limits.lower", "3.14159 rad"},
    {"TwistBeyondHalfATurn", JOIN "ball { twist_limits { upper: 3.2 } }", ".ball.twist_limits.upper", "3.14159 rad"},
    {"ZeroCone", JOIN "ball { cone_limit: 0 }", ".ball.cone_limit", "positive"},
    {"NegativeCone", JOIN "ball { cone_limit: -1 }", ".ball.cone_limit", "is -1"},
    {"WideCone", JOIN "ball { cone_limit: 4 }", ".ball.cone_limit", "is 4"},
    {"SliderWithoutLimits", JOIN "slider {}", ".slider.limits", "must be given"},
    {"HugeTravel", JOIN "slider { limits { upper: 1e9 } }", ".slider.limits.upper", "1e+07 m"},
    {"NegativeDistance", JOIN "distance { limits { lower: -1 upper: 1 } }", ".distance.limits.lower", "is -1"},
    {"NoDistance", JOIN "distance { limits {} }", ".distance.limits.upper", "ball"},
    {"NoDistanceAtTheStart", JOIN "distance {}", ".distance.limits.upper", "ball"},
    {"NanMotor", JOIN "hinge { motor { target_velocity: nan } }", ".hinge.motor.target_velocity", "finite"},
    {"InfiniteMotor", JOIN "slider { limits {} motor { max_effort: inf } }", ".slider.motor.max_effort", "finite"},
    {"NegativeEffort", JOIN "hinge { motor { max_effort: -1 } }", ".hinge.motor.max_effort", "is -1"},
    {"SpringWithoutFrequency", JOIN "fixed { spring {} }", ".fixed.spring.frequency", "positive"},
    {"NegativeFrequency", JOIN "ball { spring { frequency: -1 } }", ".ball.spring.frequency", "is -1"},
    {"StiffSpring", JOIN "hinge { spring { frequency: 1e5 } }", ".hinge.spring.frequency", "10000 Hz"},
    {"NegativeDamping", JOIN "hinge { spring { frequency: 1 damping_ratio: -1 } }", ".hinge.spring.damping_ratio",
     "is -1"},
    {"NanDamping", JOIN "hinge { spring { frequency: 1 damping_ratio: nan } }", ".hinge.spring.damping_ratio",
     "finite"},
    // The boxes' bounding radius is .866 m: .433 m of slack at each end.
    {"TornHinge", "body_a: 1 body_b: 2 hinge {}", "", "the bodies are 1 m apart at this joint; at most 0.866025 m"},
    {"TornFromTheWorld", "body_a: 2 ball {}", "", "the bodies are 1 m apart at this joint; at most 0.866025 m"},
    {"TornSlider", "body_a: 1 body_b: 3 slider { limits { lower: -1 upper: 0.5 } }", "",
     "the bodies are 2 m apart at this joint; at most 1.86603 m"},
    {"TornRod", "body_a: 1 body_b: 3 distance { limits { upper: 1 } }", "",
     "the bodies are 2 m apart at this joint; at most 1.86603 m"},
};

INSTANTIATE_TEST_SUITE_P(Scene, SceneBadJoint, ::testing::ValuesIn(kBadJoints),
                         [](const auto& test) { return std::string(test.param.name); });

std::string message_of(const std::string& text) {
  try {
    scene_from_text(text, "bad.txtpb");
  } catch (const SceneError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(SceneBadJointMore, NumberAndLineAreThoseOfTheFile) {
  EXPECT_EQ(
      message_of(with_joint("joint { body_a: 3 ball {} frame_b { position { x: 2 } } }\njoint { body_a: 2 ball {} }\n"
                            "joint { body_a: 1 ball {} }")),
      "bad.txtpb:3: joint[1]: the bodies are 1 m apart at this joint; at most 0.866025 m");
  EXPECT_EQ(message_of(with_joint("joint_count: 2 joint { body_a: 1 ball {} }")),
            "bad.txtpb:2: joint_count: says 2, but there are 1 joints: is the file cut short?");
  EXPECT_NE(message_of(with_joint("joint { body_a: 1 ball {} name: \"a\\nb\" }")).find("control"), std::string::npos);
}

TEST(SceneBadJointMore, TooManyOfAPair) {
  std::string text;
  for (int i = 0; i < 255; ++i) text += "joint { body_a: 1 ball {} }\n";
  EXPECT_EQ(message_of(with_joint(text)), "accepted");
  EXPECT_EQ(message_of(with_joint(text + "joint { body_a: 1 ball {} }")),
            "bad.txtpb:257: joint[255].body_b: two bodies have at most 255 joints");
}

TEST(SceneBadJointMore, PartsOfANewerFormatAreRefused) {
  const auto refused = [](auto change, const std::string& field) {
    pb::Scene message = to_proto(every_joint());
    google::protobuf::Message* part = change(message);
    part->GetReflection()->MutableUnknownFields(part)->AddVarint(99, 1);
    try {
      from_proto(message, "newer");
      ADD_FAILURE() << "accepted";
    } catch (const SceneError& e) {
      EXPECT_NE(e.field.find(field), std::string::npos) << e.field;
      EXPECT_NE(e.reason.find("99"), std::string::npos);
    }
  };
  refused([](pb::Scene& s) { return s.mutable_joint(0); }, "joint[0]");
  refused([](pb::Scene& s) { return s.mutable_joint(1)->mutable_fixed()->mutable_spring(); }, ".fixed.spring");
  refused([](pb::Scene& s) { return s.mutable_joint(4)->mutable_hinge()->mutable_motor(); }, ".hinge.motor");
  refused([](pb::Scene& s) { return s.mutable_joint(3)->mutable_ball()->mutable_twist_limits(); }, ".twist_limits");
}

// Scenes that never were in a file are checked by the same rules.
TEST(SceneBadJointMore, ValidateChecksScenesMadeInMemory) {
  const auto field_of = [](auto change) {
    Scene scene = every_joint();
    change(scene);
    try {
      validate(scene, "memory");
    } catch (const SceneError& e) {
      return e.field;
    }
    return std::string("accepted");
  };
  EXPECT_EQ(field_of([](Scene&) {}), "accepted");
  EXPECT_EQ(field_of([](Scene& s) { std::swap(s.joints[2], s.joints[3]); }), "joint[3].body_a");
  EXPECT_EQ(field_of([](Scene& s) { turn_round(s.joints[4]); }), "joint[4].body_b");
  EXPECT_EQ(field_of([](Scene& s) { turn_round(s.joints[0]); }), "joint[0].body_a");
  EXPECT_EQ(field_of([](Scene& s) { s.joints[0].b = 99; }), "joint[0].body_b");
  EXPECT_EQ(field_of([](Scene& s) { s.joints[0].limits = JointLimits{}; }), "joint[0].fixed");
  EXPECT_EQ(field_of([](Scene& s) { s.joints[0].motor = JointMotor{}; }), "joint[0].fixed");
  EXPECT_EQ(field_of([](Scene& s) { s.joints[0].cone_limit = 1; }), "joint[0].fixed");
  EXPECT_EQ(field_of([](Scene& s) { s.joints[6].limits.reset(); }), "joint[6] \"rod\".distance.limits");
  EXPECT_EQ(field_of([](Scene& s) { s.joints[0].frame_a.orientation.coeffs() *= 2; }), "joint[0].frame_a.orientation");
  EXPECT_EQ(field_of([](Scene& s) { s.joints[0].kind = static_cast<JointKind>(9); }), "joint[0]");
  EXPECT_EQ(field_of([](Scene& s) { s.joints[8].frame_b.orientation = s.joints[8].frame_a.orientation; }),
            "joint[8] \"cardan\".universal");
}

}  // namespace
}  // namespace soda::scene_joints
