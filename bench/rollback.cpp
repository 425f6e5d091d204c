// soda-bench rollback: what it costs to repair what was computed ahead, to compute ahead at all where nothing must be
// repaired, and to keep the steps in between in memory.
#include <malloc.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <deque>
#include <future>
#include <optional>
#include <stdexcept>

#include "bench/commands.h"
#include "bench/lone_core.h"
#include "common/scene/generators.h"
#include "common/scene/scene_builder.h"
#include "server/physics/stepper.h"

namespace soda::bench {
namespace {

void require(bool holds, const char* what) {
  if (!holds) throw std::runtime_error(std::string("this measures nothing: ") + what);
}

// ---- one island repaired, against everything computed again ---------------------------------------------------------

constexpr std::uint32_t kBoxes = 3;  // of a stack

Scene stacks(std::uint32_t count) {
  constexpr double kApart = 6;  // m
  SceneBuilder builder("stacks");
  const auto side = static_cast<std::uint32_t>(std::ceil(std::sqrt(count)));
  for (std::uint32_t i = 0; i < count; ++i)
    for (std::uint32_t n = 0; n < kBoxes; ++n)
      builder.add(Box{Vec3(1, 1, 1)}, Vec3(kApart * (i % side), kApart * (i / side), n + 0.5));
  builder.add_ground(2 * kApart * (side + 1));
  builder.scene.sleeping = false;  // else the full re-simulation would cost little
  return builder.finish();
}

struct Repair {
  std::vector<double> full, stepped, repair;  // ms, by round; of the repairs in a round, their median
  std::vector<double> over_full, over_stepped;
  std::uint64_t redone = 0;  // bodies, by one repair
};

LoggedAction push_at_1(std::uint32_t stack, ActionNumber number) {
  return {number, 1, Push{.body = stack * kBoxes + 1, .impulse = Vec3(300, 200, 0)}};  // a box has 1,000 kg
}

// A repair must leave what would be there had the action been known before.
void check_repair(const Scene& scene, std::uint32_t stack) {
  LoneCore repaired(scene, kWindow), known(scene, kWindow);
  repaired.work();
  repaired.act(push_at_1(stack, 1));
  known->act(push_at_1(stack, 1));
  known.work();
  for (Step step = 0; step <= kWindow; ++step)
    if (repaired->digest(step) != known->digest(step))
      throw std::runtime_error("a repaired step differs: " + std::to_string(step));
}

void repair_round(const Scene& scene, std::uint32_t islands, Repair& r) {
  constexpr std::uint32_t kRepairs = 10;  // of different islands
  LoneCore world(scene, kWindow);
  const double full = 1e3 * world.work();
  require(world->clock() == kWindow && world->final_step() == 0, "the window is not full");
  require(bodies_computed(*world) == std::uint64_t{kWindow} * kBoxes * islands, "not all bodies are awake");
  std::vector<double> repairs;
  for (std::uint32_t i = 0; i < kRepairs; ++i) {
    const std::uint64_t before = bodies_redone(*world);
    repairs.push_back(1e3 * world.act(push_at_1((i * islands / kRepairs + islands / 20) % islands, i + 1)));
    r.redone = bodies_redone(*world) - before;
    // The body that was pushed at step 1, its stack at all later ones.
    require(r.redone == 1 + kBoxes * (kWindow - 1), "a repair did not do its island again, or more than that");
  }
  // The step alone, without anything kept, is the least that doing everything again can cost.
  const physics::Model model(scene);
  physics::Stepper stepper(model);
  BodySet set = model.initial_state();
  const double start = cpu_seconds();
  for (Step step = 0; step < kWindow; ++step) stepper.step(set);
  const double stepped = 1e3 * (cpu_seconds() - start);
  r.full.push_back(full);
  r.stepped.push_back(stepped);
  r.repair.push_back(median(repairs));
  r.over_full.push_back(r.repair.back() / full);
  r.over_stepped.push_back(r.repair.back() / stepped);
}

constexpr const char* kRepairPicture = R"(
set logscale xy
set xlabel 'islands of 3 boxes in the world'
set ylabel 'CPU time (ms)'
set key top left
set grid
set xrange [7:1500]
set format y '%g'
set title '48 steps of one island repaired, and all 48 steps computed again'
plot 'rollback_repair.csv' skip 1 using 1:3 with linespoints pt 7 lw 2 lc rgb '#d1603d' title 'repair of one island', \
  '' skip 1 using 1:4 with linespoints pt 7 lw 2 lc rgb '#3d7ea6' title 'all again, by a world', \
  '' skip 1 using 1:5 with linespoints pt 6 lc rgb '#909090' title 'all again, the step alone'
)";

void measure_repair(const Options& options, Headline& headline) {
  const int rounds = options.rounds > 0 ? options.rounds : options.quick ? 1 : 9;
  constexpr std::array<std::uint32_t, 3> kIslands = {10, 100, 1000};
  std::array<Repair, kIslands.size()> results;
  for (const std::uint32_t islands : kIslands) check_repair(stacks(islands), islands / 2);
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < kIslands.size(); ++i) repair_round(stacks(kIslands[i]), kIslands[i], results[i]);
  Csv table(options, "rollback_repair", "islands,bodies_redone,repair_ms,full_ms,stepper_ms,repair_over_full");
  for (std::size_t i = 0; i < kIslands.size(); ++i) {
    const Repair& r = results[i];
    const std::string key = ".islands_" + std::to_string(kIslands[i]);
    std::printf("%4u islands: one repaired in %.3f ms (%lu bodies redone), all 48 steps computed in %.2f ms: %.4f\n",
                kIslands[i], median(r.repair), static_cast<unsigned long>(r.redone), median(r.full),
                median(r.over_full));
    table.row(kIslands[i], r.redone, median(r.repair), median(r.full), median(r.stepped), median(r.over_full));
    headline.add("repair_over_full" + key, median(r.over_full));
    headline.add("repair_over_stepper" + key, median(r.over_stepped));
    headline.add("repair_ms" + key, median(r.repair));
    headline.add("full_ms" + key, median(r.full));
    headline.add("stepper_ms" + key, median(r.stepped));
    headline.add("bodies_redone" + key, static_cast<double>(r.redone));
  }
  table.close();
  plot(options, "rollback_repair", kRepairPicture);
}

// ---- computing ahead where nothing must be repaired -----------------------------------------------------------------

struct Pair {
  double cpu = 0;  // s
  std::uint64_t anticipated = 0, computed = 0;
  double depth = 0;  // steps kept beyond the final one, mean over turns and worlds
};

struct Turns {
  const char *key, *what;
  int works;  // calls of work() in a turn, two for a step
  int delay;  // turns until what is said is heard, beside those that pass anyway
};

// Two worlds take turns; what one says in a turn the other hears in its next, or later.
Pair run_pair(const Scene& scene, const TerritoryMap& map, border::Sync sync, Step steps, const Turns& turns) {
  std::array<std::optional<LoneCore>, 2> worlds;
  for (WorldId w = 0; w < 2; ++w)
    worlds[w].emplace(scene, map, border::CoreSettings{.me = w, .last_step = steps, .sync = sync, .window = kWindow});
  struct Flight {
    int turn;
    std::vector<std::byte> bytes;
  };
  std::array<std::deque<Flight>, 2> flights;
  Pair result;
  int turn = 0;
  const double start = cpu_seconds();
  for (int done = 0; done < 2 || !flights[0].empty() || !flights[1].empty(); ++turn) {
    done = 0;
    for (WorldId w = 0; w < 2; ++w) {
      border::WorldCore& core = **worlds[w];
      for (; !flights[w].empty() && flights[w].front().turn <= turn; flights[w].pop_front())
        if (!core.receive(flights[w].front().bytes)) throw std::runtime_error(core.last_refusal());
      auto progress = border::Progress::kWorked;
      for (int i = 0; i < turns.works && progress == border::Progress::kWorked; ++i) progress = core.work();
      done += progress == border::Progress::kDone;
      result.depth += static_cast<double>(core.clock() - core.final_step());
      for (border::Outgoing& out : core.take_outgoing())
        flights[out.to].push_back({turn + turns.delay, std::move(out.bytes)});
    }
  }
  result.cpu = cpu_seconds() - start;
  result.depth /= 2 * turn;
  for (auto& world : worlds) {
    const border::CoreStats& stats = (*world)->stats();
    require(stats.mixed_islands == 0 && stats.frame_bodies_sent == 0, "the worlds have to do with each other");
    require(stats.timeline.bodies_redone == 0, "something was done again");
    result.anticipated += stats.anticipated;
    result.computed += stats.timeline.bodies_computed;
  }
  return result;
}

void measure_anticipation(const Options& options, Headline& headline) {
  const int rounds = options.rounds > 0 ? std::max(options.rounds, 5) : options.quick ? 1 : 11;
  const Step steps = options.quick ? 60 : 240;
  // 6 x 6 heaps 10 m apart: the border falls into a gap, out of reach of all.
  Scene scene = generate("piles", 972, 1);
  scene.sleeping = false;
  const TerritoryMap map = bisect(scene, make_grid(scene), 2);
  // A final step takes an exchange of messages. So with several steps in a turn the window fills.
  constexpr Turns kCases[] = {{".two_steps", "two steps in a turn", 4, 0},
                              {"", "four steps in a turn", 8, 0},
                              {".window_full", "four steps in a turn, messages 12 turns late", 8, 12}};
  Csv table(options, "rollback_anticipation",
            "works_in_turn,delay_turns,conservative_s,anticipative_s,overhead,anticipated_share,depth");
  for (const Turns& c : kCases) {
    std::vector<double> conservative, anticipative, overhead;
    Pair ahead;
    for (int round = 0; round < rounds; ++round) {
      Pair behind;
      for (int turn = 0; turn < 2; ++turn) {
        if ((turn == 0) == (round % 2 == 0))
          behind = run_pair(scene, map, border::Sync::kConservative, steps, c);
        else
          ahead = run_pair(scene, map, border::Sync::kAnticipative, steps, c);
      }
      require(ahead.computed == behind.computed, "the two modes did not do the same work");
      conservative.push_back(behind.cpu);
      anticipative.push_back(ahead.cpu);
      overhead.push_back(ahead.cpu / behind.cpu - 1);
    }
    require(ahead.anticipated > 0, "nothing was computed ahead");
    const double share = static_cast<double>(ahead.anticipated) / static_cast<double>(2 * steps);
    std::printf("ahead, %s: %.0f %% of the steps, %.1f steps kept; %.3f s against %.3f s, overhead %+.1f %%\n", c.what,
                100 * share, ahead.depth, median(anticipative), median(conservative), 100 * median(overhead));
    table.row(c.works, c.delay, median(conservative), median(anticipative), median(overhead), share, ahead.depth);
    headline.add(std::string("anticipation_overhead") + c.key, median(overhead));
    headline.add(std::string("anticipated_share") + c.key, share);
    headline.add(std::string("steps_kept") + c.key, ahead.depth);
  }
}

// ---- what the window takes of memory --------------------------------------------------------------------------------

double heap_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);  // of all arenas, and mapped apart from them
}

// In a thread of its own, which has ended when this returns.
template <typename F>
void apart(F&& f) {
  std::async(std::launch::async, std::forward<F>(f)).get();
}

// Counts the contact records of one step.
class ContactCounter : public border::Observer {
 public:
  explicit ContactCounter(Step step) : step_(step) {}
  void finalised(Step step, const border::Produced& produced) override {
    if (step == step_) contacts = produced.all().contacts.size();
  }
  std::size_t contacts = 0;

 private:
  Step step_;
};

struct Memory {
  double bytes = 0;     // per entry and body
  double contacts = 0;  // records per body, at step `settle`
  Step began = 0;
};

// Fills the window of a world that has run for `settle` steps, and on until all its bodies sleep if they are to.
Memory window_memory(const Scene& scene, std::uint32_t bodies, Step settle, bool asleep) {
  constexpr Step kAtMost = 6000;  // steps until all sleep
  Memory memory{.began = settle};
  ContactCounter counter(settle);
  LoneCore world(scene, bisect(scene, make_grid(scene), 1), {.last_step = settle + kAtMost, .actions = true}, &counter);
  // A thread keeps the memory of records that it has dropped for new ones. What the way so far has left must not hide
  // what the window takes: it goes with the thread.
  apart([&] {
    const auto advance = [&](Step step) {
      const std::uint64_t before = bodies_computed(*world);
      world->set_limit(step);
      world->close_actions(step, 0);
      world.work();
      return bodies_computed(*world) - before;
    };
    for (Step step = 1; step <= settle; ++step) advance(step);
    if (asleep)  // then a step computes nothing
      while (memory.began < kAtMost && advance(++memory.began) > 0) {
      }
  });
  require(world->clock() == memory.began && world->final_step() == memory.began, "the window is not empty");
  apart([&] {
    const double before = heap_bytes();
    const std::uint64_t computed = bodies_computed(*world);
    world->set_limit(memory.began + kWindow);
    world.work();
    require(world->clock() == memory.began + kWindow && world->final_step() == memory.began, "the window is not full");
    require(bodies_computed(*world) - computed == (asleep ? 0 : std::uint64_t{kWindow} * bodies),
            "not all bodies are awake, or asleep");
    memory.bytes = (heap_bytes() - before) / (static_cast<double>(kWindow) * bodies);
  });
  memory.contacts = static_cast<double>(counter.contacts) / bodies;
  return memory;
}

void measure_memory(const Options& options, Headline& headline) {
  const std::uint32_t bodies = options.quick ? 500 : 2000;
  const Step settle = options.quick ? 120 : 300;
  struct Case {
    const char *scene, *key;
    bool asleep;
  };
  // Of heaps, some bodies may rock for ever; towers sleep.
  constexpr Case kCases[] = {{"piles", "awake", false}, {"towers", "towers_awake", false}, {"towers", "asleep", true}};
  Csv table(options, "rollback_memory",
            "scene,state,bodies,from_step,bytes_per_entry_and_body,contact_records_per_body");
  for (const Case& c : kCases) {
    Scene scene = generate(c.scene, bodies, 1);
    scene.sleeping = c.asleep;
    const Memory m = window_memory(scene, bodies, settle, c.asleep);
    const char* const state = c.asleep ? "asleep" : "awake";
    std::printf(
        "a window of %u bodies of %s, all %s, takes %.1f bytes per entry and body (%.2f contact records each)\n",
        bodies, c.scene, state, m.bytes, m.contacts);
    table.row(c.scene, state, bodies, m.began, m.bytes, m.contacts);
    headline.add(std::string("bytes_per_entry_and_body.") + c.key, m.bytes);
    headline.add(std::string("contact_records_per_body.") + c.key, m.contacts);
  }
}

}  // namespace

void rollback(const Options& options, Headline& headline) {
  measure_repair(options, headline);
  measure_anticipation(options, headline);
  measure_memory(options, headline);
}

}  // namespace soda::bench
