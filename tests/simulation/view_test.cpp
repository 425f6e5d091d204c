// What viewers are told, and what they make of it, against what the worlds hold: every step that can be shown, after
// every piece of work, though steps are computed ahead and done again, and samples get lost.
#include <gtest/gtest.h>

#include <chrono>
#include <deque>
#include <memory>
#include <queue>
#include <random>

#include "client/buffer/transform_buffer.h"
#include "server/world/view_feed.h"
#include "tests/simulation/scenario.h"
#include "tests/simulation/scenes.h"

namespace soda::test {
namespace {

using namespace std::chrono_literals;

class Samples final : public world::Reports {
 public:
  bool listened_to() const override { return true; }
  void status(const wire::Status&) override {}
  void digests(const wire::Digests&) override {}
  void state(const wire::StateChunk&) override {}
  void poses(const wire::Poses&) override {}
  void transfer(const wire::Transfer&) override {}
  bool wants_transforms() const override { return watched; }
  bool take_lack() override { return std::exchange(lack, false); }
  void transforms(const wire::Transforms& sample) override { told.push_back(sample); }
  bool finish(std::chrono::milliseconds) override { return true; }

  bool watched = true, lack = true;
  std::deque<wire::Transforms> told;
};

// A world with what it tells viewers.
struct World final : border::Observer {
  World(const Scene& scene, const TerritoryMap& map, WorldId me, Step steps)
      : model(scene),
        core(model, map, {.me = me, .epoch = 1, .session = 42, .last_step = steps, .window = 24}, *this),
        feed(7, me, scene.dt, samples) {}
  void finalised(Step step, const border::Produced& produced) override { feed.finalised(step, produced); }

  Samples samples;
  physics::Model model;
  border::WorldCore core;
  world::ViewFeed feed;
};

// How many bodies of the world were compared.
std::size_t expect_same(const World& world, Step step, const buffer::Poses& poses, const buffer::BodyIndex& bodies) {
  std::size_t here = 0, shown = 0;
  world.core.states(step).for_each([&](auto, const Ref<timeline::Record>& record) {
    ++here;
    const auto index = bodies.find(record->body.id);
    ASSERT_TRUE(index) << "body " << record->body.id << " at step " << step;
    const buffer::Pose* const pose = poses.get(*index);
    ASSERT_TRUE(pose) << "body " << record->body.id << " at step " << step;
    for (int i = 0; i < 3; ++i) ASSERT_EQ(pose->position[i], record->body.position[i]) << "step " << step;
    for (int i = 0; i < 3; ++i)
      ASSERT_EQ(pose->angular[i], static_cast<float>(record->body.angular_velocity[i])) << "step " << step;
    ASSERT_EQ((pose->flags & wire::VIEW_ASLEEP) != 0, record->body.asleep());
  });
  poses.for_each([&](auto, const auto&) { ++shown; });
  EXPECT_EQ(shown, here) << "step " << step;
  return here;
}

struct Seen {
  std::size_t compared = 0, anticipated = 0, lost = 0, most_worlds = 0;
  std::uint64_t redone = 0;
};

Seen watch(const std::string& name, WorldId worlds, Step steps, double loss, std::uint64_t seed) {
  const Scene& scene = reference(name).scene;
  const TerritoryMap map{make_grid(scene), worlds, slabs(scene, worlds)};
  std::vector<std::unique_ptr<World>> all;
  for (WorldId me = 0; me < worlds; ++me) all.push_back(std::make_unique<World>(scene, map, me, steps));
  buffer::TransformBuffer buffer(worlds);
  struct Flight {
    std::uint64_t at, number;
    WorldId to;
    std::vector<std::byte> bytes;
    bool operator<(const Flight& o) const { return std::tie(at, number) > std::tie(o.at, o.number); }
  };
  std::priority_queue<Flight> flights;
  std::mt19937_64 random(seed);
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  std::uint64_t number = 0;
  Seen seen;
  std::chrono::steady_clock::time_point now{};
  for (std::uint64_t tick = 0;; ++tick, now += 10ms) {
    for (; !flights.empty() && flights.top().at <= tick; flights.pop())
      EXPECT_TRUE(all[flights.top().to]->core.receive(flights.top().bytes));
    bool done = flights.empty();
    for (WorldId w = 0; w < worlds; ++w) {
      World& world = *all[w];
      if (uniform() < 0.4) {
        done = false;
        continue;
      }
      done = (world.core.work() == border::Progress::kDone) && done;
      for (border::Outgoing& out : world.core.take_outgoing())
        flights.push({tick + 1 + random() % 12, ++number, out.to, std::move(out.bytes)});
      world.feed.report(world.core, true, now);
      for (; !world.samples.told.empty(); world.samples.told.pop_front()) {
        if (uniform() < loss) {
          ++seen.lost;
          continue;
        }
        if (!buffer.add(world.samples.told.front())) world.samples.lack = true;
      }
    }
    for (Step step = buffer.oldest(); step <= buffer.newest(); ++step) {
      const buffer::View view = buffer.at(step);
      EXPECT_EQ(view.step, step);
      seen.anticipated += view.anticipated;
      for (WorldId w = 0; w < worlds; ++w)
        if (step >= all[w]->core.oldest() && step <= all[w]->core.front())
          seen.compared += expect_same(*all[w], step, view.worlds[w], buffer.bodies());
      if (testing::Test::HasFailure()) return seen;
    }
    buffer.release_before(buffer.final_step() - 5);
    EXPECT_LE(buffer.newest() - buffer.oldest(), 5 + 2 * 24) << "nothing is freed";
    if (done) break;
    if (tick > 100'000) {
      ADD_FAILURE() << "it does not come to its end";
      break;
    }
  }
  EXPECT_EQ(buffer.final_step(), steps);
  seen.redone = buffer.redone_count();
  return seen;
}

TEST(View, IsWhatTheWorldsHold) {
  for (const char* scene : {"cubes", "sleeping_chain", "corner"}) {
    SCOPED_TRACE(scene);
    const Seen seen = watch(scene, 3, 120, 0, 1);
    EXPECT_GT(seen.compared, 10'000u);
    EXPECT_GT(seen.anticipated, 100u) << "nothing was shown before it was final";
  }
}

TEST(View, IsMendedWhereSamplesAreLost) {
  const Seen seen = watch("cubes", 3, 240, 0.01, 2);
  EXPECT_GT(seen.lost, 5u);
  EXPECT_GT(seen.compared, 5'000u);
  EXPECT_GT(seen.redone, 0u) << "nothing was rolled back";
}

}  // namespace
}  // namespace soda::test
