// The door of the protocol: whatever arrives, the world lives, nothing changes, and the reason is told.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>

#include "server/border/codec.h"
#include "server/border/frame_book.h"
#include "server/border/link.h"
#include "server/physics/stepper.h"
#include "tests/simulation/scenes.h"
#include "tests/simulation/simulated_session.h"

namespace soda::test {
namespace {

using border::CodecError;
using border::Message;

// A message with everything in it, from a real step.
class Messages : public testing::Test {
 protected:
  Messages() : model_(hard_scene("heap").make()) {
    BodySet set = model_.initial_state();
    physics::Stepper stepper(model_);
    for (int t = 0; t < 120; ++t) stepper.step(set);
    EXPECT_GT(set.contacts.size(), 50u);
    message_.header = {.session = 7,
                       .from = 1,
                       .to = 0,
                       .epoch = 1,
                       .to_epoch = 1,
                       .sequence = 3,
                       .ack = 2,
                       .ask = border::Ask::kAgain,
                       .sent = 9,
                       .upto = 120,
                       .final_step = 119,
                       .durable = 0};
    message_.frames.push_back({120, {1, 0}, set});
    border::Component component{set, {{set.bodies[3].id, 2, 99}, {set.bodies[5].id, 0, 98}}};
    message_.parts.push_back({.origin = 1,
                              .step = 120,
                              .revision = {1, 0},
                              .components = {std::make_shared<const border::Component>(component),
                                             std::make_shared<const border::Component>()}});
    message_.transfers = {{1, 1, 180, 0, {2, 3, 9}}, {2, 4, 200, 1, {7}}};
    message_.offers = {{3, 0.01, {4, 5}}};
    message_.answers = {{8, true}, {9, false}};
    message_.load = {0.01, 0.02, 0.001, std::numeric_limits<double>::infinity()};
  }

  physics::Model model_;
  Message message_;
};

TEST_F(Messages, ComeBackBitForBit) {
  const auto bytes = border::encode(message_);
  const Message back = border::decode(bytes, model_);
  EXPECT_EQ(border::encode(back), bytes);
  EXPECT_EQ(back.header.final_step, 119);
  EXPECT_EQ(back.header.ask, border::Ask::kAgain);
  EXPECT_EQ(back.header.sent, 9u);
  ASSERT_EQ(back.frames.size(), 1u);
  EXPECT_TRUE(same(back.frames[0].set, message_.frames[0].set));
  ASSERT_EQ(back.parts[0].components.size(), 2u);
  EXPECT_EQ(back.parts[0].components[0]->ports[1].record, 98u);
  EXPECT_EQ(back.transfers, message_.transfers);
  ASSERT_EQ(back.offers.size(), 1u);
  EXPECT_EQ(back.offers[0].cells, (std::vector<std::uint32_t>{4, 5}));
  ASSERT_EQ(back.answers.size(), 2u);
  EXPECT_TRUE(back.answers[0].accepted && !back.answers[1].accepted);
  ASSERT_TRUE(back.load);
  EXPECT_EQ(back.load->expected, 0.02);
}

TEST_F(Messages, WithBadCellsOrLoadsAreRefused) {
  const auto refusal = [&](auto&& spoil) {
    Message bad = message_;
    spoil(bad);
    try {
      border::decode(border::encode(bad), model_);
    } catch (const CodecError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(refusal([](Message&) {}), "accepted");
  EXPECT_EQ(refusal([](Message& m) { m.transfers[0].cells = {3, 2}; }), "cells: out of order");
  EXPECT_EQ(refusal([](Message& m) { m.offers[0].cells.clear(); }), "cells: none");
  EXPECT_EQ(refusal([](Message& m) { m.offers[0].cost = -1; }), "offer: its cost cannot be");
  EXPECT_EQ(refusal([](Message& m) { m.load->work = -1; }), "load: cannot be");
  EXPECT_EQ(refusal([](Message& m) { m.load->expected = std::numeric_limits<double>::infinity(); }), "load: cannot be");
  EXPECT_EQ(refusal([](Message& m) { m.load->on_time = std::numeric_limits<double>::quiet_NaN(); }), "load: cannot be");
}

// What another world may say of territories: only what it may give, once, in order, in time.
TEST_F(Messages, OfTransfersThatCannotBeAreRefused) {
  const Scene& scene = model_.scene();
  const TerritoryMap map = bisect(scene, make_grid(scene), 2);
  border::Observer nobody;
  border::WorldCore world(model_, map, {.me = 0, .epoch = 1, .session = 7, .last_step = 1000, .balance = true}, nobody);
  const auto owned_by = [&](WorldId w) {
    return static_cast<std::uint32_t>(std::find(map.owner.begin(), map.owner.end(), w) - map.owner.begin());
  };
  Message message;
  message.header = {.session = 7, .from = 1, .to = 0, .epoch = 1, .sequence = 1};
  const auto refusal = [&](const border::Transfer& transfer) {
    message.transfers = {transfer};
    EXPECT_FALSE(world.receive(border::encode(message)));
    return world.last_refusal();
  };
  const std::uint32_t mine = owned_by(0), its = owned_by(1);
  EXPECT_NE(refusal({1, 1, 60, 0, {mine}}).find("is not its giver's"), std::string::npos);
  EXPECT_NE(refusal({1, 2, 60, 0, {its}}).find("others of its giver"), std::string::npos);
  EXPECT_NE(refusal({1, 1, 0, 0, {its}}).find("past"), std::string::npos);
  EXPECT_NE(refusal({1, 1, 60, 7, {its}}).find("such worlds"), std::string::npos);
  EXPECT_NE(refusal({1, 1, 60, 0, {99999}}).find("no cell 99999"), std::string::npos);
  EXPECT_NE(refusal({0, 1, 60, 1, {mine}}).find("is not of this world"), std::string::npos);
  EXPECT_NE(refusal({1, 1, 5000, 0, {its}}).find("nobody can have named"), std::string::npos);
  message.transfers.clear();
  for (const std::uint32_t cell : {mine, 4000000000u}) {
    message.offers = {{1, 0, {cell}}};
    EXPECT_FALSE(world.receive(border::encode(message)));
    EXPECT_NE(world.last_refusal().find("is not world 1's"), std::string::npos) << world.last_refusal();
  }
  message.offers.clear();
  EXPECT_TRUE(world.take_offers().empty());
  message.transfers = {{1, 1, 60, 0, {its}}};
  EXPECT_TRUE(world.receive(border::encode(message))) << world.last_refusal();
  EXPECT_EQ(world.owners_ahead()[its], 0u);
  EXPECT_EQ(world.take_transfers().size(), 1u);
  EXPECT_FALSE(world.may_give(its)) << "not before it is this world's at the final step";
  message.header.sequence = 2;
  EXPECT_TRUE(world.receive(border::encode(message))) << "said again";
  EXPECT_TRUE(world.take_transfers().empty());

  border::WorldCore fixed(model_, map, {.me = 0, .epoch = 1, .session = 7, .last_step = 1000}, nobody);
  message.header.sequence = 1;
  EXPECT_FALSE(fixed.receive(border::encode(message)));
  EXPECT_NE(fixed.last_refusal().find("do not change hands"), std::string::npos);
  EXPECT_FALSE(fixed.give(1, {mine}));
}

TEST_F(Messages, CutShortAnywhereAreRefused) {
  const auto bytes = border::encode(message_);
  for (std::size_t n = 0; n < bytes.size(); n += n < 400 ? 1 : 97)
    EXPECT_THROW(border::decode(std::span(bytes).first(n), model_), CodecError) << n << " bytes";
  auto longer = bytes;
  longer.push_back(std::byte{0});
  EXPECT_THROW(border::decode(longer, model_), CodecError);
}

TEST_F(Messages, WithFlippedBitsNeverCrash) {
  const auto bytes = border::encode(message_);
  std::mt19937_64 random(5);
  int refused = 0;
  for (int i = 0; i < 3000; ++i) {
    auto broken = bytes;
    // Early bytes hold counts and sizes: half of the flips go there.
    const std::size_t range = i % 2 ? broken.size() : 200;
    broken[random() % range] ^= std::byte{static_cast<unsigned char>(1u << random() % 8)};
    try {
      border::decode(broken, model_);
    } catch (const CodecError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 200);
}

TEST_F(Messages, WithBadBodiesAreRefusedByName) {
  const auto refusal = [&](auto&& spoil) {
    Message bad = message_;
    spoil(bad.frames[0].set);
    try {
      border::decode(border::encode(bad), model_);
    } catch (const CodecError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const std::string third = std::to_string(message_.frames[0].set.bodies[2].id);
  EXPECT_EQ(refusal([](BodySet& s) { s.bodies[2].position[1] = std::numeric_limits<double>::quiet_NaN(); }),
            "body " + third + ": not finite");
  EXPECT_EQ(refusal([](BodySet& s) { s.bodies[2].linear_velocity[0] = std::numeric_limits<double>::infinity(); }),
            "body " + third + ": not finite");
  EXPECT_EQ(refusal([](BodySet& s) { s.bodies[2].orientation[3] += 1; }),
            "body " + third + ": orientation is not a unit quaternion");
  EXPECT_EQ(refusal([](BodySet& s) { s.bodies[2].flags = 1u << 20; }), "body " + third + ": unknown flags");
  EXPECT_EQ(refusal([](BodySet& s) { s.bodies[2].id = 999999; }), "body 999999: not in the scene");
  EXPECT_EQ(refusal([](BodySet& s) { std::swap(s.bodies[2], s.bodies[3]); }), "body " + third + ": out of order");
  EXPECT_NE(refusal([](BodySet& s) { s.contacts[0].normal[0] = std::numeric_limits<double>::quiet_NaN(); }),
            "accepted");
  EXPECT_NE(refusal([](BodySet& s) { s.contacts[0].b = kStaticBit | 424242; }), "accepted");
}

TEST_F(Messages, OfOthersChangeNothing) {
  const Scene& scene = model_.scene();
  const TerritoryMap map = bisect(scene, make_grid(scene), 2);
  border::Observer nobody;
  border::WorldCore world(model_, map, {.me = 0, .epoch = 1, .session = 7, .last_step = 10}, nobody);
  const auto refusal = [&](Message m) {
    EXPECT_FALSE(world.receive(border::encode(m)));
    return world.last_refusal();
  };
  Message hello;
  hello.header = message_.header;
  hello.header.upto = hello.header.final_step = 0;
  Message bad = hello;
  bad.header.session = 8;
  EXPECT_NE(refusal(bad).find("another session"), std::string::npos);
  bad = hello;
  bad.header.to = 1;
  EXPECT_NE(refusal(bad).find("for world 1"), std::string::npos);
  bad = hello;
  bad.header.from = 5;
  EXPECT_NE(refusal(bad).find("no neighbour"), std::string::npos);
  bad = hello;
  bad.header.sequence = 1;
  bad.header.upto = 500;
  EXPECT_NE(refusal(bad).find("cannot be"), std::string::npos);
  bad = hello;
  bad.parts = {{.origin = 9, .step = 0, .revision = {}, .components = {}}};
  EXPECT_NE(refusal(bad).find("origin 9"), std::string::npos);
  bad.parts = {{.origin = 1,
                .step = 0,
                .revision = {},
                .whole = false,
                .components = {std::make_shared<const border::Component>()}}};
  EXPECT_NE(refusal(bad).find("no bodies"), std::string::npos);
  bad = hello;
  bad.header.sequence = 1;
  bad.header.upto = 3;
  bad.header.final_step = 2;
  EXPECT_NE(refusal(bad).find("final steps 2"), std::string::npos) << "nobody is that far without this world";
  bad = hello;
  bad.header.sequence = 1;
  bad.frames = {{0, {1, 1}, message_.frames[0].set}};
  bad.frames[0].set.contacts.clear();
  bad.frames[0].set.bodies[4].linear_velocity[0] = -1e25;
  EXPECT_NE(refusal(bad).find("faster than"), std::string::npos);
  bad = hello;
  bad.header.sequence = 1u << 20;
  EXPECT_NE(refusal(bad).find("too far ahead"), std::string::npos);
  EXPECT_EQ(world.stats().refused, 9u);
  // None of them has spoilt the stream, or the sender's epoch.
  hello.header.sequence = 1;
  hello.header.epoch = 9;
  hello.header.final_step = 0;
  EXPECT_TRUE(world.receive(border::encode(hello))) << world.last_refusal();
  hello.header.sequence = 2;
  hello.header.epoch = 10;
  EXPECT_NE(refusal(hello).find("another start"), std::string::npos);
  EXPECT_EQ(world.clock(), 0);
}

TEST(Link, DeliversInOrderAndRepeatsWhatWasLost) {
  border::Link out(1, 0, 1, 1, 0), in(1, 1, 1, 0, 0);
  const physics::Model model(hard_scene("corner").make());
  std::vector<std::vector<std::byte>> sent;
  for (Step t = 0; t < 5; ++t) out.send(t, t - 1, t - 2, 0, sent);
  std::vector<Step> got;
  const auto deliver = [&](Message& m) { got.push_back(m.header.upto); };
  const auto give = [&](border::Link& to, const std::vector<std::byte>& bytes) {
    Message message = border::decode(bytes, model);
    to.receive(message, deliver);
  };
  give(in, sent[1]);  // 0 is late, 2 is lost
  give(in, sent[1]);
  give(in, sent[0]);
  give(in, sent[3]);
  give(in, sent[4]);
  EXPECT_EQ(got, (std::vector<Step>{0, 1}));
  EXPECT_EQ(in.upto(), 1) << "values count only when everything before them has arrived";
  EXPECT_EQ(in.duplicates(), 1u);
  std::vector<std::vector<std::byte>> questions, answers;
  in.collect(questions);
  ASSERT_EQ(questions.size(), 1u) << "a gap makes the receiver ask";
  give(out, questions[0]);
  out.collect(answers);
  ASSERT_EQ(answers.size(), 3u) << "what was acknowledged is not repeated";
  for (const auto& bytes : answers) give(in, bytes);
  EXPECT_EQ(got, (std::vector<Step>{0, 1, 2, 3, 4}));
  EXPECT_EQ(in.upto(), 4);
  EXPECT_EQ(in.final_step(), 3);
}

TEST(FrameBook, TellsWhatTheOtherSideWouldNotAssume) {
  const auto near = [](BodyId id, bool asleep) {
    BodyState b;
    b.id = id;
    if (asleep) b.flags |= kAsleep;
    return border::NearBody{static_cast<timeline::Slot>(id), timeline::make_record(b, {}, {}, 0)};
  };
  const auto ids = [](const BodySet& set) {
    std::vector<BodyId> all;
    for (const BodyState& b : set.bodies) all.push_back(b.id);
    return all;
  };
  const border::NearBody one = near(1, true), two = near(2, true), three = near(3, false);
  border::FrameBook book(0);
  book.extend();
  book.set(0, {one, two, three});
  std::vector<border::Frame> frames = book.tell(0, 1);
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(ids(frames[0].set), (std::vector<BodyId>{1, 2, 3}));
  for (int i = 0; i < 3; ++i) book.extend();
  for (Step t = 1; t <= 3; ++t) book.set(t, {one, two});
  EXPECT_TRUE(book.tell(3, 1).empty()) << "the other side assumes just this: sleepers stay, nobody else";
  book.set(2, {});
  frames = book.tell(3, 1);
  ASSERT_EQ(frames.size(), 2u) << "taken back at 2, so step 3, which was assumed from it, must be told";
  EXPECT_TRUE(frames[0].step == 2 && frames[0].set.bodies.empty());
  EXPECT_TRUE(frames[1].step == 3 && ids(frames[1].set) == (std::vector<BodyId>{1, 2}));
  book.set(2, {one, two});
  frames = book.tell(3, 1);
  ASSERT_EQ(frames.size(), 1u) << "only what was told may be told again, even where it is what was assumed";
  EXPECT_EQ(frames[0].step, 2);
  EXPECT_GT(frames[0].revision, (border::Revision{1, 1}));
}

}  // namespace
}  // namespace soda::test
