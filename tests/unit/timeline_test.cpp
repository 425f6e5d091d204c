// The buffer of steps by itself: what entries share, and that a change does again what it touches and nothing else.
#include "server/timeline/timeline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "common/scene/scene_builder.h"
#include "common/state_hash.h"
#include "tests/unit/physics_scenes.h"

namespace soda::timeline {
namespace {

Ref<Record> record_of(BodyId id) {
  BodyState body{};
  body.id = id;
  return make_record(body, {}, {}, 0);
}

TEST(Table, CopiesShareUntilOneIsWritten) {
  Table<Record> table(100);
  std::vector<Table<Record>::Item> items;
  for (Slot s = 0; s < 3000; s += 3) items.emplace_back(s, record_of(s));
  table.assign(items);
  Table<Record> copy = table;
  const Record* const kept = table.get(33);
  copy.set(36, record_of(7));
  copy.set(39, {});
  copy.set(5000, record_of(8));  // beyond what either has had
  EXPECT_EQ(table.get(36)->body.id, 36u);
  EXPECT_EQ(table.get(39)->body.id, 39u);
  EXPECT_EQ(table.get(5000), nullptr);
  EXPECT_EQ(copy.get(36)->body.id, 7u);
  EXPECT_EQ(copy.get(39), nullptr);
  EXPECT_EQ(copy.get(33), kept);  // the same page, copied, with the same records
  EXPECT_EQ(copy.get(2997), table.get(2997));
  std::vector<Slot> slots;
  copy.for_each([&](Slot slot, const Ref<Record>&) { slots.push_back(slot); });
  EXPECT_TRUE(std::is_sorted(slots.begin(), slots.end()));
  EXPECT_EQ(slots.size(), 1000u);  // one gone, one more
}

TEST(SpatialIndex, FindsEveryStateOfTheWindow) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  constexpr Slot kBodies = 60;
  constexpr Step kWindow = 10;
  SpatialIndex index(1.5);
  std::vector<std::vector<Vec3>> places;  // by step, by body
  std::vector<Vec3> at(kBodies);
  for (Vec3& x : at) x = 6 * Vec3(unit(random), unit(random), unit(random));
  for (Step step = 0; step < 80; ++step) {
    for (Slot slot = 0; slot < kBodies; ++slot) {
      if (slot % 3 == 0) at[slot] += Vec3(unit(random), unit(random), unit(random));
      index.note(slot, at[slot], slot == 7, step);
    }
    places.push_back(at);
    const Step oldest = std::max<Step>(0, step - kWindow);
    index.forget_before(oldest);
    const Vec3 centre = 6 * Vec3(unit(random), unit(random), unit(random));
    const Aabb box{centre - Vec3::Constant(0.7), centre + Vec3::Constant(0.7)};
    std::vector<Slot> found;
    index.query(box, found);
    for (Step t = oldest; t <= step; ++t)
      for (Slot slot = 0; slot < kBodies; ++slot) {
        const Vec3& x = places[static_cast<std::size_t>(t)][slot];
        const double reach = index.ordinary_reach();
        if (slot == 7 || Aabb{x - Vec3::Constant(reach), x + Vec3::Constant(reach)}.overlaps(box)) {
          EXPECT_NE(std::find(found.begin(), found.end(), slot), found.end()) << "body " << slot << " of step " << t;
        }
      }
    if (step == 79) {
      EXPECT_LT(std::set<Slot>(found.begin(), found.end()).size(), kBodies / 2) << "it finds everything";
    }
  }
}

TEST(SpatialIndex, KeepsBothPlacesOfABodyThatTwoTellOf) {
  const Vec3 here(0, 0, 0), there(9, 0, 0);
  const auto finds = [](const SpatialIndex& index, const Vec3& x) {
    std::vector<Slot> found;
    index.query({x - Vec3::Constant(0.1), x + Vec3::Constant(0.1)}, found);
    return std::count(found.begin(), found.end(), 3u) > 0;
  };
  SpatialIndex index(1);
  for (Slot other = 10; other < 60; ++other)
    index.note(other, Vec3(0, 0, 3.0 * other), false, 5);  // else all is looked at
  index.note(3, there, false, 5);
  index.note_beside(3, here, false, 5);  // asleep there, and so not noted again
  EXPECT_TRUE(index.is_beside(3));
  index.note(1, here, false, 60);
  index.forget_before(40);
  EXPECT_TRUE(finds(index, here));
  EXPECT_TRUE(finds(index, there));
  index.not_beside(3);
  index.note(3, here, false, 60);  // it was here all the time
  EXPECT_FALSE(index.is_beside(3));
  index.forget_before(61);
  EXPECT_TRUE(finds(index, here));
  EXPECT_FALSE(finds(index, there));
}

// World 0 owns what is left of x = border; nothing waits, what has foreign bodies is kept for the test.
class HalfSpace : public Arbiter {
 public:
  // Nobody else has to do with what is left of x = `inside`.
  explicit HalfSpace(double border, double inside = -1e9) : border_(border), inside_(inside) {}
  Place place(const BodyState& body, Step) const override {
    return {body.x().x() < border_ ? 0u : 1u, false, body.x().x() < inside_};
  }
  bool places_change(Step) const override { return false; }
  bool place_changes(const BodyState&, Step) const override { return false; }
  void extended(Step) override {}
  bool finding(Step, bool) override { return false; }
  void dropped(Step, const Island&) override { ++drops; }
  bool must_wait(Step, std::span<const Aabb>) override { return false; }
  void keep(Step step, Found found) override { kept.emplace_back(step, std::move(found)); }

  std::vector<std::pair<Step, Found>> kept;
  int drops = 0;

 private:
  double border_, inside_;
};

void advance(Timeline& timeline, Step to) {
  for (Step step = timeline.oldest(); step < to; ++step)
    if (step == timeline.newest() || timeline.has_pending(step)) {
      timeline.process(step);
      while (timeline.unfinished() >= 0) timeline.finish();
    }
}

TEST(Timeline, AloneItDoesWhatTheStepDoes) {
  for (const auto& c : physics::test::cases()) {
    SCOPED_TRACE(c.name);
    const physics::Model model(c.make());
    HalfSpace all(1e9);
    Timeline timeline(model, 0, 0, all);
    physics::Stepper stepper(model);
    BodySet set = model.initial_state();
    for (Step step = 0; step < 120; ++step) {
      ASSERT_EQ(physics::test::first_difference(set, timeline.all_produced(step)), "") << "step " << step;
      ASSERT_EQ(timeline.hash(step), bodies_hash(set.bodies));
      stepper.step(set);
      advance(timeline, step + 1);
      if (step >= 20) timeline.release_before(step - 20);
    }
    // A repair of what has not changed leaves everything as it is, down to the records.
    const Step step = timeline.oldest() + 5;
    std::vector<Slot> slots;
    for (Slot slot = 0; slot < model.bodies().size(); slot += 3) slots.push_back(slot);
    std::vector<const Record*> before;
    for (Step t = step; t <= timeline.newest(); ++t)
      for (Slot slot = 0; slot < model.bodies().size(); ++slot) before.push_back(timeline.produced(t, slot));
    timeline.touch(step, slots);
    advance(timeline, timeline.newest());
    for (Step t = step; t <= timeline.newest(); ++t)
      for (Slot slot = 0; slot < model.bodies().size(); ++slot)
        ASSERT_EQ(timeline.produced(t, slot),
                  before[static_cast<std::size_t>(t - step) * model.bodies().size() + slot]);
    EXPECT_EQ(timeline.stats().bodies_redone, 0u);
  }
}

// What others hear of is done first, and can be told while the rest is not there yet; the rest comes in pieces; all of
// it is what the step does at once.
TEST(Timeline, WhatOthersHearOfComesFirst) {
  SceneBuilder builder("row");
  builder.add_ground(200);
  for (int i = 0; i < 120; ++i) builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(0.49 * i - 59, 0, 1.5 + 0.1 * (i % 3)));
  for (int i = 0; i < 60; ++i) builder.add(Sphere{0.2}, Vec3(i - 60, 5, 2));
  const physics::Model model(builder.finish());
  HalfSpace space(1e9, -20);
  Timeline timeline(model, 0, 1, space, 10);
  physics::Stepper stepper(model);
  BodySet set = model.initial_state();
  int in_pieces = 0;
  for (Step step = 0; step < 90; ++step) {
    timeline.process(step);
    ASSERT_EQ(timeline.unfinished_outside(), step);
    timeline.finish();
    ASSERT_EQ(timeline.unfinished_outside(), -1);
    if (timeline.unfinished() == step) {
      std::size_t done = 0, left = 0;
      for (const BodyState& body : set.bodies) {
        const Slot slot = timeline.slot_of(body.id);
        const bool same = timeline.produced(step, slot) == timeline.produced(step + 1, slot);
        (same ? left : done) += !body.asleep();
        EXPECT_TRUE(!same || body.asleep() || body.x().x() < -20) << "body " << body.id << " is not told in time";
      }
      in_pieces += done > 0 && left > 0;
    }
    int pieces = 1;
    for (; timeline.unfinished() >= 0; ++pieces) timeline.finish();
    EXPECT_LE(pieces, 9);
    stepper.step(set);
    ASSERT_EQ(physics::test::first_difference(set, timeline.all_produced(step + 1)), "") << "step " << step;
  }
  EXPECT_GT(in_pieces, 30);
  EXPECT_EQ(timeline.stats().bodies_redone, 0u);
}

TEST(Timeline, WhatRestsIsSharedByAllEntries) {
  SceneBuilder builder("rest");
  builder.add_ground(100);
  for (int i = 0; i < 40; ++i) builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(i - 20, 0, 0.25));
  Body& roller = builder.add(Sphere{0.3}, Vec3(0, 5, 0.3));
  roller.linear_velocity = Vec3(3, 0, 0);
  const physics::Model model(builder.finish());
  HalfSpace all(1e9);
  Timeline timeline(model, 0, 0, all);
  advance(timeline, 240);
  int rollers = 0;
  const auto computed = timeline.stats().bodies_computed;
  advance(timeline, 280);
  EXPECT_EQ(timeline.stats().bodies_computed - computed, 40u) << "more than the one that rolls, in 40 steps";
  for (const BodyState& body : model.initial_state().bodies)
    if (body.v().x() > 0) {
      const Slot roller_slot = timeline.slot_of(body.id);
      EXPECT_NE(timeline.produced(240, roller_slot), timeline.produced(280, roller_slot));
      ++rollers;
    }
  ASSERT_EQ(rollers, 1);
  std::size_t shared = 0;
  for (Slot slot = 0; slot < model.bodies().size(); ++slot) {
    const Record* const record = timeline.produced(240, slot);
    shared += record && record == timeline.produced(280, slot);
  }
  EXPECT_EQ(shared, 40u);
}

// What rests is copied from entry to entry and never noted again: a repair of how it got there must not make the index
// forget where it is.
TEST(Timeline, WhatRestsIsFoundAfterARepairOfItsFall) {
  SceneBuilder builder("strike");
  builder.add_ground(100);
  builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(0, 0, 3.5));  // falls through some cells of the index
  for (int i = 0; i < 80; ++i)
    builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(1.2 * (i % 40) - 24, 10 + 2 * (i / 40), 0.25));
  Body& striker = builder.add(Sphere{0.25}, Vec3(-30, 0, 0.25));
  striker.linear_velocity = Vec3(9, 0, 0);
  striker.friction = 0;
  const physics::Model model(builder.finish());
  HalfSpace all(1e9);
  Timeline timeline(model, 0, 0, all);
  physics::Stepper stepper(model);
  BodySet set = model.initial_state();
  bool slept = false, struck = false;
  for (Step step = 0; step < 260; ++step) {
    ASSERT_EQ(physics::test::first_difference(set, timeline.all_produced(step)), "") << "step " << step;
    slept = slept || set.bodies[0].asleep();
    struck = struck || (slept && !set.bodies[0].asleep());
    stepper.step(set);
    advance(timeline, step + 1);
    if (step == 110) {
      ASSERT_TRUE(slept);
      const Slot faller = timeline.slot_of(set.bodies[0].id);
      timeline.touch(3, std::span(&faller, 1));
      advance(timeline, timeline.newest());
    }
    if (step > 110) timeline.release_before(step - 5);
  }
  EXPECT_TRUE(struck);
}

// Two groups far apart; a late message puts a foreign body into one of them.
TEST(Timeline, AChangeDoesAgainWhatItTouchesAndNothingElse) {
  SceneBuilder builder("two groups");
  builder.scene.sleeping = false;
  builder.add_ground(100);
  for (int i = 0; i < 6; ++i) builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(-0.62, 0, 0.25 + 0.5 * i));
  for (int i = 0; i < 6; ++i) builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(-30.0, 0, 0.25 + 0.5 * i));
  Body& stranger = builder.add(Sphere{0.4}, Vec3(0.05, 0, 0.6));
  stranger.linear_velocity = Vec3(-4, 0, 0);
  const physics::Model model(builder.finish());
  const Slot stranger_slot = 12;
  HalfSpace arbiter(0);
  Timeline timeline(model, 0, 1, arbiter);
  advance(timeline, 30);
  EXPECT_EQ(timeline.known(0, stranger_slot), nullptr);
  EXPECT_TRUE(arbiter.kept.empty());
  std::vector<const Record*> before;
  for (Slot slot = 0; slot < 12; ++slot) before.push_back(timeline.produced(30, slot));

  BodySet set;
  for (const BodyState& body : model.initial_state().bodies)
    if (body.id == model.bodies()[stranger_slot].id) set.bodies.push_back(body);
  ASSERT_EQ(set.bodies.size(), 1u);
  // At step 10 it is close to the first group.
  timeline.hear(0, 10, timeline.near_set(set, 10));
  EXPECT_TRUE(timeline.has_pending(10));
  EXPECT_FALSE(timeline.has_pending(11));  // it is awake, so it is gone there, as before
  EXPECT_FALSE(timeline.has_pending(9));
  const auto computed = timeline.stats().bodies_computed;
  timeline.process(10);
  ASSERT_EQ(arbiter.kept.size(), 1u);
  const auto& [step, found] = arbiter.kept[0];
  EXPECT_EQ(step, 10);
  ASSERT_EQ(found.foreign.size(), 1u);
  EXPECT_EQ(found.foreign[0]->body.id, set.bodies[0].id);
  EXPECT_EQ(found.own.bodies.size(), 6u) << "an island is affected as a whole";
  timeline.finish();
  EXPECT_EQ(timeline.stats().bodies_computed, computed) << "only the island that is kept was to be done";

  // Whoever keeps it settles it: here with the strike that a solver would have found.
  BodySet results;
  results.bodies = found.own.bodies;
  for (BodyState& body : results.bodies) body.v().x() -= 0.1;
  timeline.settle(10, results);
  advance(timeline, 30);
  for (Slot slot = 0; slot < 12; ++slot)
    EXPECT_EQ(timeline.produced(30, slot) == before[slot], slot >= 6) << "body " << slot;
  EXPECT_GT(timeline.stats().bodies_redone, 0u);
  EXPECT_LE(timeline.stats().bodies_redone, 20u * 6);
  EXPECT_EQ(timeline.stats().longest_rollback, 19u);  // the first result is that of step 11

  // Told that it was not so, everything is as before, bit for bit.
  timeline.hear(0, 10, Ref<NearSet>(new NearSet));
  EXPECT_TRUE(timeline.has_pending(10));
  advance(timeline, 30);
  EXPECT_GT(arbiter.drops, 0);

  const physics::Model again(model.scene());
  HalfSpace untouched_arbiter(0);
  Timeline untouched(again, 0, 1, untouched_arbiter);
  advance(untouched, 30);
  for (Step t = 0; t <= 30; ++t)
    EXPECT_EQ(physics::test::first_difference(untouched.all_produced(t), timeline.all_produced(t)), "") << t;
}

TEST(Timeline, WhatSleepsIsAssumedToStayAndWhatIsAwakeToBeGone) {
  SceneBuilder builder("neighbours");
  builder.add_ground(100);
  builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(-5, 0, 0.25));
  builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(1, 0, 0.25));
  builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(2, 0, 0.25));
  const physics::Model model(builder.finish());
  HalfSpace arbiter(0);
  Timeline timeline(model, 0, 1, arbiter);
  BodySet set;
  for (const BodyState& body : model.initial_state().bodies)
    if (body.x().x() > 0) set.bodies.push_back(body);
  ASSERT_EQ(set.bodies.size(), 2u);
  set.bodies[0].flags |= kAsleep;
  timeline.hear(0, 3, timeline.near_set(set, 3));
  advance(timeline, 6);
  EXPECT_EQ(timeline.known(2, 1), nullptr);
  EXPECT_NE(timeline.known(3, 1), nullptr);
  EXPECT_NE(timeline.known(3, 2), nullptr);
  EXPECT_EQ(timeline.known(6, 1), timeline.known(3, 1));
  EXPECT_EQ(timeline.known(4, 2), nullptr);
}

}  // namespace
}  // namespace soda::timeline
