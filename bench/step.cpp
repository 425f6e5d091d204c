// soda-bench step: one step of ours against one of stock Bullet, in the same run on the same scenes, and what saving,
// restoring and hashing its state cost.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>

#include "bench/bullet_world.h"
#include "bench/commands.h"
#include "common/scene/generators.h"
#include "common/state_hash.h"
#include "server/border/codec.h"
#include "server/physics/stepper.h"

namespace soda::bench {
namespace {

constexpr double kSeconds = 10;  // simulated
constexpr int kBlock = 30;       // steps; ours and Bullet's take turns after each block
constexpr std::uint64_t kSeed = 1;

struct SceneCase {
  const char* name;
  std::uint32_t bodies;
  std::uint32_t stacked;    // the first so many bodies stand in stacks ...
  std::uint32_t per_stack;  // ... of so many each
};
constexpr SceneCase kScenes[] = {
    {"piles", 1728, 0, 1}, {"heap", 3000, 0, 1}, {"towers", 1000, 1000, 10}, {"city", 8000, 4000, 20}};

// What became of the stacks.
struct Standing {
  std::uint32_t stacks = 0;
  double drift = 0;  // m, sideways, of the bodies of stacks that stand, at most
  double sink = 0;   // m, downwards, likewise
};

// A stack stands if each of its bodies is still above the one below, and none has moved aside by half its width. (Soft
// contacts give: how far a stack sinks is told apart.)
Standing standing(const Scene& scene, const SceneCase& c, const std::function<Vec3(std::size_t)>& position) {
  Standing result;
  for (std::uint32_t first = 0; first < c.stacked; first += c.per_stack) {
    bool stands = true;
    double drift = 0, sink = 0, below = 0;
    for (std::uint32_t i = first; i < std::min(first + c.per_stack, c.stacked); ++i) {
      const Body& body = scene.bodies[i];
      const Vec3 size = std::get<Box>(scene.geometries[body.shapes[0].geometry]).size, now = position(i);
      const Vec3 moved = now - body.pose.position;
      const double aside = std::hypot(moved.x(), moved.y());
      stands = stands && now.z() > below && aside < 0.5 * std::min(size.x(), size.y());
      below = now.z();
      drift = std::max(drift, aside);
      sink = std::max(sink, -moved.z());
    }
    if (!stands) continue;
    ++result.stacks;
    result.drift = std::max(result.drift, drift);
    result.sink = std::max(result.sink, sink);
  }
  return result;
}

struct Block {
  std::vector<double> ours, bullet;  // ms per step, by round
};

struct Measured {
  std::vector<Block> blocks;
  physics::StageTimes stages;  // ms per step, mean over all rounds
  Standing ours, bullet;
  double contacts = 0;  // records at the end
};

void measure_round(const Scene& scene, const SceneCase& c, int blocks, bool ours_first, int rounds, Measured& m,
                   BodySet& last) {
  const physics::Model model(scene);
  physics::Stepper stepper(model);
  stepper.timing = true;
  BodySet set = model.initial_state();
  BulletWorld bullet(scene);
  const auto block = [&](auto&& step) {
    const double start = cpu_seconds();
    for (int i = 0; i < kBlock; ++i) step();
    return 1e3 * (cpu_seconds() - start) / kBlock;
  };
  m.blocks.resize(blocks);
  for (int b = 0; b < blocks; ++b)
    for (int turn = 0; turn < 2; ++turn) {
      if ((turn == 0) == ours_first)
        m.blocks[b].ours.push_back(block([&] { stepper.step(set); }));
      else
        m.blocks[b].bullet.push_back(block([&] { bullet.step(); }));
    }
  const double scale = 1e3 / (kBlock * blocks * rounds);
  m.stages.boxes += scale * stepper.times.boxes;
  m.stages.broad += scale * stepper.times.broad;
  m.stages.narrow += scale * stepper.times.narrow;
  m.stages.islands += scale * stepper.times.islands;
  m.stages.order += scale * stepper.times.order;
  m.stages.solve += scale * stepper.times.solve;
  m.ours = standing(scene, c, [&](std::size_t i) { return set.bodies[i].x(); });
  m.bullet = standing(scene, c, [&](std::size_t i) { return bullet.position(i); });
  m.contacts = static_cast<double>(set.contacts.size());
  last = std::move(set);
}

// What it costs to keep, bring back and compare a state, per body.
void measure_state(const std::string& name, const physics::Model& model, const BodySet& set, Headline& headline) {
  const double bodies = static_cast<double>(set.bodies.size());
  const std::size_t body_bytes = set.bodies.size() * sizeof(BodyState);
  const std::size_t contact_bytes = set.contacts.size() * sizeof(ContactRecord);
  std::vector<unsigned char> saved(body_bytes + contact_bytes);
  const double save = time_of([&] {
    std::memcpy(saved.data(), set.bodies.data(), body_bytes);
    std::memcpy(saved.data() + body_bytes, set.contacts.data(), contact_bytes);
  });
  BodySet restored = set;
  const double restore = time_of([&] {
    restored.bodies.resize(set.bodies.size());
    restored.contacts.resize(set.contacts.size());
    std::memcpy(restored.bodies.data(), saved.data(), body_bytes);
    std::memcpy(restored.contacts.data(), saved.data() + body_bytes, contact_bytes);
  });
  std::uint64_t hash = 0;
  const double bodies_hashed = time_of([&] { hash += bodies_hash(set.bodies); });
  const double all_hashed = time_of([&] { hash += full_hash(set); });
  if (hash == 0 || full_hash(restored) != full_hash(set)) throw std::runtime_error("a restored state differs");
  headline.add(name + ".state_bytes_per_body", static_cast<double>(saved.size()) / bodies);
  headline.add(name + ".save_ns_per_body", 1e9 * save / bodies);
  headline.add(name + ".restore_ns_per_body", 1e9 * restore / bodies);
  headline.add(name + ".hash_ns_per_body", 1e9 * bodies_hashed / bodies);
  headline.add(name + ".full_hash_ns_per_body", 1e9 * all_hashed / bodies);

  // A border frame that holds every body, with its contact records: to bytes, and back through the door.
  border::Message message;
  message.frames.push_back({0, {}, set});
  std::vector<std::byte> bytes;
  const double encoded = time_of([&] { bytes = border::encode(message); });
  const double decoded = time_of([&] { message = border::decode(bytes, model); });
  if (!same(message.frames[0].set, set)) throw std::runtime_error("a decoded frame differs");
  headline.add(name + ".frame_bytes_per_body", static_cast<double>(bytes.size()) / bodies);
  headline.add(name + ".frame_encode_ns_per_body", 1e9 * encoded / bodies);
  headline.add(name + ".frame_decode_ns_per_body", 1e9 * decoded / bodies);
}

constexpr const char* kBars = R"(
set style fill solid 0.9 border -1
set boxwidth 0.35
set ylabel 'CPU time per step (ms)'
set yrange [0:*]
set xrange [-0.6:3.6]
set grid y
set key top left
set bmargin 3.5
set title 'One step of SODA (by stage) and of stock Bullet in double precision, sleeping off'
# columns: scene, bodies, bullet, ours, boxes, broad, narrow, islands, order, solve
plot 'step.csv' skip 1 using ($0-0.19):3 with boxes lc rgb '#b0b0b0' title 'stock Bullet', \
  '' skip 1 using ($0+0.19):($5+$6+$7+$8+$9+$10) with boxes lc rgb '#d1603d' title 'solve', \
  '' skip 1 using ($0+0.19):($5+$6+$7+$8+$9) with boxes lc rgb '#e9b44c' title 'order', \
  '' skip 1 using ($0+0.19):($5+$6+$7+$8) with boxes lc rgb '#8e6c8a' title 'islands', \
  '' skip 1 using ($0+0.19):($5+$6+$7) with boxes lc rgb '#3d7ea6' title 'narrow phase', \
  '' skip 1 using ($0+0.19):($5+$6) with boxes lc rgb '#6a994e' title 'broad phase', \
  '' skip 1 using ($0+0.19):5 with boxes lc rgb '#5c9ead' title 'boxes', \
  '' skip 1 using 0:(0):xtic(sprintf("%s\n%d bodies", stringcolumn(1), column(2))) with points pt 0 notitle
)";

constexpr const char* kCourse = R"(
set key bottom right
set multiplot layout 2,2 title 'CPU time per step as the scenes unfold (sleeping off)'
set grid
set yrange [0:*]
set xlabel 'simulated time (s)'
set ylabel 'ms per step'
do for [scene in 'piles heap towers city'] {
  set title scene
  plot 'step_course.csv' skip 1 using 2:(stringcolumn(1) eq scene ? $4 : NaN) with linespoints pt 7 ps .5 lc rgb '#909090' \
      title 'stock Bullet', \
    '' skip 1 using 2:(stringcolumn(1) eq scene ? $3 : NaN) with linespoints pt 7 ps .5 lc rgb '#d1603d' title 'SODA'
}
unset multiplot
)";

}  // namespace

void step(const Options& options, Headline& headline) {
  const int rounds = options.rounds > 0 ? options.rounds : options.quick ? 1 : 3;
  Csv table(options, "step",
            "scene,bodies,bullet_ms,soda_ms,boxes_ms,broad_ms,narrow_ms,islands_ms,order_ms,solve_ms,"
            "stacks,standing,standing_bullet,drift_m,drift_bullet_m,sink_m,sink_bullet_m");
  Csv course(options, "step_course", "scene,seconds,soda_ms,bullet_ms");
  for (SceneCase c : kScenes) {
    if (options.quick) c.bodies /= 4, c.stacked /= 4;
    Scene scene = generate(c.name, c.bodies, kSeed);
    scene.sleeping = false;
    const int blocks = static_cast<int>(std::lround((options.quick ? 2 : kSeconds) / scene.dt)) / kBlock;
    Measured m;
    BodySet last;
    for (int round = 0; round < rounds; ++round) measure_round(scene, c, blocks, round % 2 == 0, rounds, m, last);
    // Both runs are deterministic, so a block does the same work in every round.
    double ours = 0, bullet = 0;
    for (int b = 0; b < blocks; ++b) {
      const double o = median(m.blocks[b].ours), s = median(m.blocks[b].bullet);
      ours += o / blocks;
      bullet += s / blocks;
      course.row(c.name, (b + 0.5) * kBlock * scene.dt, o, s);
    }
    const std::uint32_t stacks = c.stacked / c.per_stack;
    std::printf("%-7s %5u bodies: SODA %.3f ms per step, stock Bullet %.3f, ratio %.3f", c.name, c.bodies, ours, bullet,
                ours / bullet);
    if (stacks) std::printf("; of %u stacks %u stand, with Bullet %u", stacks, m.ours.stacks, m.bullet.stacks);
    std::printf("\n");
    std::fflush(stdout);
    table.row(c.name, c.bodies, bullet, ours, m.stages.boxes, m.stages.broad, m.stages.narrow, m.stages.islands,
              m.stages.order, m.stages.solve, stacks, m.ours.stacks, m.bullet.stacks, m.ours.drift, m.bullet.drift,
              m.ours.sink, m.bullet.sink);
    const std::string name = c.name;
    headline.add(name + ".time_over_bullet", ours / bullet);
    headline.add(name + ".ms_per_step", ours);
    headline.add(name + ".ms_per_step_bullet", bullet);
    headline.add(name + ".boxes_ms", m.stages.boxes);
    headline.add(name + ".broad_ms", m.stages.broad);
    headline.add(name + ".narrow_ms", m.stages.narrow);
    headline.add(name + ".islands_ms", m.stages.islands);
    headline.add(name + ".order_ms", m.stages.order);
    headline.add(name + ".solve_ms", m.stages.solve);
    headline.add(name + ".contact_records", m.contacts);
    if (stacks) {
      headline.add(name + ".stacks", stacks);
      headline.add(name + ".standing", m.ours.stacks);
      headline.add(name + ".standing_bullet", m.bullet.stacks);
      headline.add(name + ".drift_m", m.ours.drift);
      headline.add(name + ".drift_bullet_m", m.bullet.drift);
      headline.add(name + ".sink_m", m.ours.sink);
      headline.add(name + ".sink_bullet_m", m.bullet.sink);
    }
    measure_state(name, physics::Model(scene), last, headline);
  }
  table.close();
  course.close();
  plot(options, "step", kBars, 900, 520);
  plot(options, "step_course", kCourse, 900, 620);
}

}  // namespace soda::bench
