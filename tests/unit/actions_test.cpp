// Actions: the door, the log, and what they do to a body.
#include "server/physics/actions.h"

#include <gtest/gtest.h>

#include <cstring>

#include "common/actions/action_log.h"
#include "common/actions/action_proto.h"
#include "common/scene/scene_builder.h"
#include "server/physics/stepper.h"
#include "tests/support/random_actions.h"

namespace soda::test {
namespace {

// Bodies 1 to 4 are dynamic, 5 is the ground.
Scene small_scene() {
  SceneBuilder builder("small");
  for (int i = 0; i < 4; ++i) builder.add(Box{Vec3(0.5, 0.6, 0.7)}, Vec3(30.0 * i, 0, 2));
  builder.add_ground(200);
  return builder.finish();
}

constexpr const char* kAllKinds = R"(
  action { step: 3 push { body: 1 impulse { z: 5 } point { x: 0.1 } } }
  action { time: 0.5 velocity { body: 2 linear { x: 1 } angular { y: 2 } } }
  action { step: 9 pose { body: 3 pose { position { x: 1 y: 2 z: 3 } orientation { z: 2 w: 2 } } } }
  action { step: 9 grab { body: 4 target { z: 4 } frequency: 2 } }
  action { step: 12 move { grab: 4 target { z: 5 } } }
  action { step: 20 release { grab: 4 } }
  action { step: 21 spawn { body { name: "new" shape { sphere { radius: 0.2 } } pose { position { z: 6 } } } } }
  action { step: 30 remove { body: 1 } }
)";

TEST(ActionFile, HasAllKinds) {
  const Scene scene = small_scene();
  const auto actions = actions_from_text(kAllKinds, "a.txtpb", scene);
  ASSERT_EQ(actions.size(), std::variant_size_v<Action>);
  for (std::size_t i = 0; i < actions.size(); ++i)
    EXPECT_EQ(actions[i].action.index(), i) << name_of(actions[i].action);
  EXPECT_EQ(actions[1].step, 30);  // 0.5 s at 60 Hz
  EXPECT_NEAR(std::get<SetPose>(actions[2].action).orientation.norm(), 1, 1e-15);
  EXPECT_EQ(std::get<Grab>(actions[3].action).damping_ratio, kDefaultGrabDamping);
  EXPECT_GT(std::get<Spawn>(actions[6].action).body->bodies.front().inertial.mass, 0);
}

TEST(ActionFile, WhatIsWrongIsNamed) {
  const Scene scene = small_scene();
  const std::pair<const char*, const char*> cases[] = {
      {"action { step: 1 push { impulse { z: 5 } } }", "a.txtpb: action 1: push.body: must name a body"},
      {"action { push { body: 1 } }", "action 1: must say when"},
      {"action { step: 0 push { body: 1 } }", "action 1: step: must be between 1"},
      {"action { time: -1 push { body: 1 } }", "action 1: time: must be from 0"},
      {"action { step: 1 push { body: 1 impulse { z: nan } } }", "push.impulse: must be finite"},
      {"action { step: 1 push { body: 1 impulse { z: 1e30 } } }", "push.impulse: must not be longer than"},
      {"action { step: 1 velocity { body: 1 linear { z: 101 } } }", "velocity.linear: must not be longer than 100 m/s"},
      {"action { step: 1 pose { body: 1 } }", "pose.pose: must be given"},
      {"action { step: 1 pose { body: 1 pose { position { x: 1e9 } } } }", "pose.pose.position: must not be longer"},
      {"action { step: 1 grab { body: 1 frequency: -2 } }", "grab.frequency: must be between"},
      {"action { step: 1 spawn { body { shape { sphere { radius: -1 } } } } }", "spawn.body.shape[0].sphere.radius"},
      {"action { step: 1 spawn { body { static: true shape { sphere { radius: 1 } } } } }", "only dynamic bodies"},
      {"action { step: 1 }\n", "action 1: says nothing that is to be done"},
      {"action { step: 1 push { body: 1 } }\naction { step: 1 shove { body: 1 } }", "a.txtpb:2: "},
  };
  for (const auto& [text, message] : cases) {
    try {
      actions_from_text(text, "a.txtpb", scene);
      ADD_FAILURE() << "accepted: " << text;
    } catch (const ActionError& e) {
      EXPECT_NE(std::string(e.what()).find(message), std::string::npos) << e.what() << "\nexpected: " << message;
    }
  }
}

TEST(ActionFile, EndlessNestingIsRefused) {
  std::string text = "action { step: 1 spawn { body { ", end = "} } }";
  for (int i = 0; i < 10000; ++i) text += "shape { compound { ", end += "} }";
  EXPECT_THROW(actions_from_text(text + "shape { sphere { radius: 1 } }" + end, "deep.txtpb", small_scene()),
               ActionError);
}

TEST(ActionBytes, KeepEveryBit) {
  const Scene scene = small_scene();
  const auto log = random_actions(scene, 100, 200, false, 8);
  ASSERT_GT(log.size(), 60u);
  for (const LoggedAction& entry : log) {
    const std::string bytes = encode_action(entry);
    WantedAction back = decode_action(bytes, scene);
    EXPECT_EQ(back.step, entry.step);
    EXPECT_EQ(encode_action({entry.number, *back.step, back.action}), bytes) << name_of(entry.action);
    for (std::size_t n = 0; n < bytes.size(); n += 3) {
      try {
        (void)decode_action(std::string_view(bytes).substr(0, n), scene);  // may still be an action; must not crash
      } catch (const ActionError&) {
      }
    }
  }
}

class Log : public testing::Test {
 protected:
  LoggedAction accepted(Action action, Step wanted, Step first_open = 1) {
    const auto result = log.add({std::move(action), wanted, {}}, first_open);
    if (const auto* refused = std::get_if<ActionLog::Refused>(&result)) {
      ADD_FAILURE() << refused->reason;
      return {};
    }
    return std::get<LoggedAction>(result);
  }
  std::string refused(Action action, Step wanted) {
    const auto result = log.add({std::move(action), wanted, {}}, 1);
    const auto* no = std::get_if<ActionLog::Refused>(&result);
    return no ? no->reason : "accepted";
  }
  static Spawn ball(double radius) {
    SceneBuilder builder("ball");
    builder.add(Sphere{radius}, Vec3(0, 0, 9));
    return {std::make_shared<const Scene>(builder.finish())};
  }
  const Scene scene = small_scene();
  ActionLog log{scene};
};

TEST_F(Log, GivesNumbersStepsAndIds) {
  EXPECT_EQ(accepted(Push{1}, 7).step, 7);
  EXPECT_EQ(accepted(Push{1}, 7, 50).step, 50);  // too late for 7
  const LoggedAction spawned = accepted(ball(0.2), 60);
  EXPECT_EQ(spawned.number, 3u);
  EXPECT_EQ(std::get<Spawn>(spawned.action).body->bodies.front().id, 6u);  // the ground is 5
  EXPECT_EQ(std::get<Spawn>(accepted(ball(0.2), 10).action).body->bodies.front().id, 7u);
  EXPECT_EQ(accepted(Push{6}, 20).step, 60);  // not before it is there
  EXPECT_EQ(accepted(SetPose{1, Vec3(0, 0, 5)}, 1000).step, 1000);
  EXPECT_EQ(accepted(Push{1}, 70).step, 70);  // what is planned for later binds nobody
  EXPECT_EQ(accepted(Push{1}, 1000).step, 1001);
  EXPECT_EQ(log.entries().size(), 8u);
}

TEST_F(Log, WhatFollowsANewPlaceComesAfterIt) {
  EXPECT_EQ(accepted(SetPose{2, Vec3(1, 2, 3)}, 10).step, 10);
  EXPECT_EQ(accepted(Push{2}, 10).step, 11);
  EXPECT_EQ(accepted(Remove{2}, 10).step, 11);
  EXPECT_EQ(refused(Push{2}, 200), "body 2 is removed at step 12");
}

TEST_F(Log, RefusesWhatCannotBe) {
  EXPECT_EQ(refused(Push{77}, 1), "there is no body 77");
  EXPECT_EQ(refused(Push{5}, 1), "body 5 is static");
  EXPECT_NE(refused(ball(30), 1).find("bounding radius"), std::string::npos);
  EXPECT_EQ(refused(Release{1}, 1), "number 1 is not a grab that lasts");
  const ActionNumber grab = accepted(Grab{1}, 5).number;
  EXPECT_EQ(refused(MoveGrab{grab}, 4), "step 4 is before what was said of grab 1 last");
  accepted(MoveGrab{grab}, 9);
  accepted(Release{grab}, 9);
  EXPECT_EQ(refused(Release{grab}, 10), "number 1 is not a grab that lasts");
  EXPECT_EQ(log.entries().size(), 3u) << "something refused is in the log";
  EXPECT_EQ(refused(Push{1}, kMaxActionStep + 1).find("step"), 0u);
  auto wrong_id = log.add({ball(0.1), 5, 99}, 1);
  EXPECT_TRUE(std::holds_alternative<ActionLog::Refused>(wrong_id));
}

class OnABody : public testing::Test {
 protected:
  OnABody() : model(small_scene()), body(model.initial_state().bodies.front()) {
    body.set_q(normalized(Quat(0.3, 0.5, -0.2, 0.7)));
    body.flags = kAsleep;
  }
  Vec3 angular_momentum() const {
    const Mat3 r = body.q().toRotationMatrix();
    return r * model.find(body.id)->inertia * r.transpose() * body.w();
  }
  physics::Model model;
  BodyState body;
};

TEST_F(OnABody, APushChangesItsMomentaByItself) {
  const Vec3 impulse(10, -20, 30), point(0.1, 0.2, -0.1);
  physics::push(body, model, impulse, point);
  EXPECT_FALSE(body.asleep());
  EXPECT_LT((body.v() * model.find(1)->mass - impulse).norm(), 1e-12);
  EXPECT_LT((angular_momentum() - (body.q() * point).cross(impulse)).norm(), 1e-12);
}

TEST_F(OnABody, NothingGetsFasterThanTheSceneAllows) {
  physics::push(body, model, Vec3(0, 0, 1e12), Vec3(0.2, 0, 0));
  EXPECT_LE(body.v().norm(), model.scene().max_speed * (1 + 1e-12));
  EXPECT_TRUE(std::isfinite(body.w().norm()));
}

TEST_F(OnABody, ASpringPullsAPointToItsTarget) {
  physics::Stepper stepper(model);
  BodySet set{{body}, {}};
  const physics::Spring spring{Vec3(0.2, 0.3, 0.1), Vec3(3, 4, 12), 2, 1, 200};
  for (int t = 0; t < 600; ++t) {
    physics::pull(set.bodies[0], model, spring);
    stepper.step(set);
    ASSERT_LT((set.bodies[0].x() - body.x()).norm(), 25) << "unstable at step " << t;
  }
  const BodyState& b = set.bodies[0];
  // It hangs g / omega^2 below.
  const double sag = 9.81 / std::pow(2 * M_PI * 2, 2);
  EXPECT_LT((b.x() + b.q() * spring.point - (spring.target - Vec3(0, 0, sag))).norm(), 0.05);
  EXPECT_FALSE(b.asleep());
}

}  // namespace
}  // namespace soda::test
