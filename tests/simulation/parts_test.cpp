// Parts of islands with bodies of several worlds: whom they are told, and how they come together.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <set>

#include "common/scene/scene_builder.h"
#include "common/state_hash.h"
#include "server/border/codec.h"
#include "server/border/mixed_islands.h"
#include "server/border/world_core.h"

namespace soda {
namespace {

using border::Component;
using border::MixedIslands;
using border::Part;

// Pairs of boxes that touch each other, side by side, in rows along x that are shifted against each other.
Scene pairs(int rows, int in_row) {
  SceneBuilder builder("pairs");
  builder.scene.sleeping = false;
  builder.add_ground(400);
  for (int row = 0; row < rows; ++row)
    for (int i = 0; i < in_row; ++i)
      for (int k = 0; k < 2; ++k)
        builder.add(Box{Vec3(0.9, 0.9, 0.9)}, Vec3(3.0 * i + 0.3 * row + 0.9 * k, 4.0 * row, 0.45));
  return builder.finish();
}

class Parts : public ::testing::Test {
 protected:
  Parts() {
    for (BodyState& body : all_.bodies) body.flags = 0;
  }
  // A component of one body that touches others'.
  std::shared_ptr<const Component> component(std::size_t body,
                                             std::vector<std::pair<std::size_t, WorldId>> ports) const {
    Component c;
    c.set.bodies = {all_.bodies[body]};
    for (const auto& [of, owner] : ports) c.ports.push_back({all_.bodies[of].id, owner, record_hash(all_.bodies[of])});
    return std::make_shared<const Component>(std::move(c));
  }
  static Part some(WorldId origin, std::uint32_t revision, std::vector<std::shared_ptr<const Component>> components) {
    return {origin, 0, {1, revision}, false, std::move(components)};
  }
  static Part whole(WorldId origin, std::uint32_t revision, std::vector<std::shared_ptr<const Component>> components) {
    return {origin, 0, {1, revision}, true, std::move(components)};
  }

  physics::Model model_{pairs(1, 4)};
  BodySet all_ = model_.initial_state();
  TerritoryMap map_ = bisect(model_.scene(), make_grid(model_.scene()), 4);
  border::Territories territories_{map_};
  border::Neighbourhood neighbourhood_{model_, territories_, 0};
  MixedIslands islands_{neighbourhood_, 0};
};

// 0 - 1 - 2 - 1 again: what world 1 has twice in the island comes in two pieces.
TEST_F(Parts, OfOneRevisionComeTogether) {
  islands_.put(whole(0, 1, {component(0, {{1, 1}})}));
  EXPECT_EQ(islands_.close({0, 0}).missing, std::vector<WorldId>{1});
  EXPECT_TRUE(islands_.put(some(1, 1, {component(1, {{0, 0}, {2, 2}})})));
  EXPECT_TRUE(islands_.put(some(2, 1, {component(2, {{1, 1}, {3, 1}})})));
  const auto open = islands_.close({0, 0});
  EXPECT_EQ(open.missing, std::vector<WorldId>{1}) << "its component with body 3 is yet to be passed on";
  EXPECT_EQ(open.misfit, "");
  EXPECT_FALSE(islands_.put(some(1, 1, {component(1, {{0, 0}, {2, 2}})}))) << "known already";
  EXPECT_TRUE(islands_.put(some(1, 1, {component(1, {{0, 0}, {2, 2}}), component(3, {{2, 2}})})));
  const auto closed = islands_.close({0, 0});
  EXPECT_TRUE(closed.missing.empty());
  EXPECT_EQ(closed.components.size(), 4u);
  std::string misfit;
  const auto set = islands_.assemble(closed, misfit);
  ASSERT_TRUE(set) << misfit;
  EXPECT_EQ(set->bodies.size(), 4u);
}

TEST_F(Parts, OfALaterRevisionReplaceThem) {
  islands_.put(whole(0, 1, {component(0, {{1, 1}, {3, 1}})}));
  EXPECT_TRUE(islands_.put(some(1, 2, {component(1, {{0, 0}})})));
  EXPECT_FALSE(islands_.put(some(1, 1, {component(3, {{0, 0}})}))) << "of an older one";
  EXPECT_EQ(islands_.close({0, 0}).missing, std::vector<WorldId>{1});
  EXPECT_TRUE(islands_.put(some(1, 3, {component(3, {{0, 0}})})));
  EXPECT_EQ(islands_.close({0, 0}).missing, std::vector<WorldId>{1}) << "body 1 was of an older one";
  EXPECT_TRUE(islands_.put(whole(1, 3, {component(1, {{0, 0}}), component(3, {{0, 0}})})));
  EXPECT_TRUE(islands_.close({0, 0}).missing.empty());
  EXPECT_FALSE(islands_.put(some(1, 3, {component(3, {{0, 0}})}))) << "there is more already";
  EXPECT_TRUE(islands_.close({0, 0}).missing.empty());
}

// What is missing in a whole part is a contradiction.
TEST_F(Parts, WholeOnesSayAll) {
  islands_.put(whole(0, 1, {component(0, {{1, 1}})}));
  islands_.put(whole(1, 1, {component(3, {{0, 0}})}));
  EXPECT_NE(islands_.close({0, 0}).misfit, "");
}

TEST_F(Parts, PassedOnByWhoTouchesBoth) {
  islands_.put(whole(0, 1, {component(0, {{1, 1}, {2, 2}})}));
  islands_.put(some(1, 1, {component(1, {{0, 0}, {2, 2}}), component(4, {{0, 0}})}));
  islands_.put(some(2, 1, {component(2, {{0, 0}, {1, 1}, {3, 3}})}));
  const auto island = islands_.close({0, 0});
  EXPECT_TRUE(islands_.touches(MixedIslands::Key{1, 0}, 2));
  EXPECT_FALSE(islands_.touches(MixedIslands::Key{1, 1}, 2));
  EXPECT_TRUE(islands_.leads_over(island, {1, 0}, 2, 3)) << "world 2 touches body 1, and a body of world 3";
  EXPECT_FALSE(islands_.leads_over(island, {1, 1}, 2, 3)) << "it does not touch body 4";
  EXPECT_FALSE(islands_.leads_over(island, {1, 0}, 0, 3));
}

// Of a row of three worlds, the one in the middle tells the others of the pairs on their own borders only.
TEST(PartsTold, ConcernWhoHearsThem) {
  physics::Model model(pairs(10, 12));
  TerritoryMap map{make_grid(model.scene()), 3, {}};
  const int third = map.grid.size[0] / 3 + 1;
  for (std::size_t cell = 0; cell < map.grid.cells(); ++cell)
    map.owner.push_back(static_cast<WorldId>(static_cast<int>(cell) % map.grid.size[0] / third));
  border::Observer nobody;
  std::vector<std::unique_ptr<border::WorldCore>> worlds;
  for (WorldId me = 0; me < 3; ++me)
    worlds.push_back(std::make_unique<border::WorldCore>(
        model, map, border::CoreSettings{.me = me, .epoch = 1, .session = 7, .last_step = 20}, nobody));
  std::set<BodyId> told[3];
  for (int round = 0; round < 10'000 && worlds[1]->final_step() < 20; ++round)
    for (const auto& world : worlds) {
      world->work();
      for (const border::Outgoing& out : world->take_outgoing()) {
        const border::Message message = border::decode(out.bytes, model);
        for (const Part& part : message.parts)
          for (const auto& component : part.components) {
            EXPECT_FALSE(part.whole);
            EXPECT_TRUE(std::any_of(component->ports.begin(), component->ports.end(),
                                    [&](const border::Port& port) { return port.owner == out.to; }));
            if (part.origin == 1) told[out.to].insert(component->set.bodies.front().id);
          }
        ASSERT_TRUE(worlds[out.to]->receive(out.bytes)) << worlds[out.to]->last_refusal();
      }
    }
  EXPECT_EQ(worlds[1]->final_step(), 20);
  EXPECT_GT(worlds[1]->stats().mixed_islands, 0u);
  EXPECT_GT(told[0].size(), 0u);
  EXPECT_GT(told[2].size(), 0u);
  for (const BodyId body : told[0]) EXPECT_FALSE(told[2].contains(body));
}

}  // namespace
}  // namespace soda
