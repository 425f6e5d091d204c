#include "tests/simulation/scenario.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <random>

#include "common/scene/scene_builder.h"
#include "tests/simulation/scenes.h"
#include "tests/support/random_actions.h"

namespace soda::test {

const Reference& reference(const std::string& name) {
  static std::mutex mutex;
  static std::map<std::string, Reference> cache;
  const std::lock_guard lock(mutex);
  const auto it = cache.find(name);
  if (it != cache.end()) return it->second;
  const HardScene& hard = hard_scene(name);
  Reference made{hard.make(), {}};
  made.steps = run_single(made.scene, hard.steps);
  return cache.emplace(name, std::move(made)).first->second;
}

NetworkSettings network_of(std::uint64_t seed) {
  std::mt19937_64 random(seed * 7919);
  NetworkSettings n;
  n.seed = seed;
  n.delay = std::vector<int>{1, 3, 15, 60}[random() % 4];
  n.slow_share = std::vector<double>{0, 0.05, 0.4}[random() % 3];
  n.double_share = std::vector<double>{0, 0.1}[random() % 2];
  n.loss_share = std::vector<double>{0, 0, 0.03}[random() % 3];
  n.stall_share = std::vector<double>{0, 0.5, 0.9}[random() % 3];
  n.sync = random() % 4 == 0 ? border::Sync::kConservative : border::Sync::kAnticipative;
  n.window = std::vector<Step>{48, 12, 3}[random() % 3];
  n.lead = std::vector<Step>{1, 4, 20, 200}[random() % 4];
  n.touch_share = std::vector<double>{0, 0.004}[random() % 2];
  n.piece_bodies = std::vector<std::size_t>{1, 20}[random() % 2];  // few: so are the bodies
  return n;
}

std::vector<WorldId> slabs(const Scene& scene, WorldId worlds) {
  const Grid grid = make_grid(scene);
  if (grid.size[0] < static_cast<std::int32_t>(worlds)) return {};
  std::vector<WorldId> owner(grid.cells());
  for (std::size_t i = 0; i < owner.size(); ++i)
    owner[i] = static_cast<WorldId>(i % static_cast<std::size_t>(grid.size[0]) * worlds /
                                    static_cast<std::size_t>(grid.size[0]));
  return owner;
}

std::vector<WorldId> confetti(const Scene& scene, WorldId worlds, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<WorldId> owner(make_grid(scene).cells());
  for (WorldId& w : owner) w = static_cast<WorldId>(random() % worlds);
  for (WorldId w = 0; w < worlds; ++w) owner[w] = w;
  return owner;
}

std::vector<border::Transfer> random_transfers(const Scene& scene, WorldId worlds, const std::vector<WorldId>& owner,
                                               Step steps, std::uint64_t seed) {
  std::mt19937_64 random(seed * 15485863 + 3);
  const Grid grid = make_grid(scene);
  std::vector<WorldId> now = owner.empty() ? bisect(scene, grid, worlds).owner : owner;
  std::vector<std::uint32_t> numbers(worlds, 0);
  std::vector<border::Transfer> transfers;
  const auto count = 1 + random() % 8;
  std::vector<Step> when;
  for (std::uint64_t i = 0; i < count; ++i)
    when.push_back(1 + static_cast<Step>(random() % static_cast<std::uint64_t>(steps)));
  std::sort(when.begin(), when.end());
  when.erase(std::unique(when.begin(), when.end()), when.end());  // cells go on at a later step only
  for (const Step step : when) {
    border::Transfer t;
    t.step = step;
    // Where bodies are, at first.
    const Body& body = scene.bodies[random() % scene.bodies.size()];
    t.giver = now[grid.index(grid.cell_of(body.pose.position))];
    t.taker = (t.giver + 1 + static_cast<WorldId>(random() % (worlds - 1))) % worlds;
    const auto share = std::vector<std::uint64_t>{1, 2, 10}[random() % 3];  // one in so many of the giver's cells
    for (std::uint32_t cell = 0; cell < now.size(); ++cell)
      if (now[cell] == t.giver && random() % share == 0) t.cells.push_back(cell);
    for (const std::uint32_t cell : t.cells) now[cell] = t.taker;
    if (t.cells.empty()) continue;
    t.number = ++numbers[t.giver];
    transfers.push_back(t);
  }
  return transfers;
}

Scenario scenario_of(std::uint64_t seed) {
  std::mt19937_64 random(seed * 104729 + 1);
  // Machines came later; other seeds keep the meaning that they had, for tests name some.
  constexpr std::size_t kFirst = 9;
  const HardScene& first = hard_scenes()[random() % kFirst];
  const HardScene& hard = seed % 7 == 3 ? hard_scene("machines") : first;
  Scenario s;
  s.scene = hard.name;
  s.worlds = 2 + static_cast<WorldId>(random() % 8);
  s.steps = hard.steps / 3 + static_cast<Step>(random() % static_cast<std::uint64_t>(hard.steps - hard.steps / 3 + 1));
  s.network = network_of(seed);
  const Scene& scene = reference(s.scene).scene;
  switch (random() % 5) {
    case 0:
    case 1:
      break;
    case 2:
      // Every body is near somebody else's: dear, so not too long.
      s.owner = confetti(scene, s.worlds, seed);
      s.steps = std::min<Step>(s.steps, 60);
      break;
    default:
      s.owner = slabs(scene, s.worlds);
  }
  // A third without any; half of the others as they come, half as a file has them.
  if (const auto kind = random() % 6; kind >= 2)
    s.actions = random_actions(scene, s.steps, 1 + random() % 12, kind >= 4, seed);
  if (seed % 2 == 0) s.transfers = random_transfers(scene, s.worlds, s.owner, s.steps, seed);
  // Half of the time a step takes no longer than there is for it, if all have the same to do.
  if (seed % 8 == 1 || seed % 8 == 7)
    s.network.budget = seed % 16 < 8 ? -1 : 1e-6 * static_cast<double>(scene.bodies.size()) / s.worlds;
  if (seed % 8 == 3 || seed % 8 == 5) s.network.give_share = seed % 16 < 8 ? 0.002 : 0.05;
  return s;
}

std::string Scenario::text() const {
  const auto share = [](double x) { return std::to_string(static_cast<int>(1000 * x + 0.5)) + "/1000"; };
  return scene + ", " + std::to_string(steps) + " steps, " + std::to_string(worlds) + " worlds, " +
         (network.sync == border::Sync::kConservative ? "conservative" : "K " + std::to_string(network.window)) +
         ", pieces of " + std::to_string(network.piece_bodies) + ", delay " + std::to_string(network.delay) +
         ", slow " + share(network.slow_share) + ", doubled " + share(network.double_share) + ", lost " +
         share(network.loss_share) + ", stalled " + share(network.stall_share) + ", touched " +
         share(network.touch_share) + ", lead " + std::to_string(network.lead) + ", " + std::to_string(actions.size()) +
         " actions, " + std::to_string(transfers.size()) + " transfers" +
         (network.give_share > 0 ? ", cells given " + share(network.give_share) : "") +
         (network.budget != 0 ? ", balanced" : "");
}

SessionResult run_scenario(const Scenario& s) {
  const Reference& expected = reference(s.scene);
  SessionResult got = run_session(expected.scene, s.worlds, s.steps, s.network, s.owner, s.actions, s.transfers);
  if (!got.failure.empty()) return got;
  const auto end = expected.steps.begin() + s.steps + 1;
  got.failure = first_difference(s.actions.empty() ? std::vector<StepDigest>(expected.steps.begin(), end)
                                                   : run_single(expected.scene, s.steps, s.actions),
                                 got.steps);
  if (got.failure.empty() && got.kept > 0)
    got.failure = std::to_string(got.kept) + " final steps are still kept at the end";
  if (got.failure.empty() && got.total.refused > 0)
    got.failure = std::to_string(got.total.refused) + " messages refused";
  return got;
}

}  // namespace soda::test
