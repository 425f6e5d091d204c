// soda-bench step: one step of ours against one of stock Bullet, in the same run on the same scenes, and what saving,
// restoring and hashing its state cost.
#include <algorithm>
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

// How far touching bodies stand in each other, as a share of the smaller's smallest half extent: what resting contacts
// are wrong by. Found anew from the poses alone, the same way for all sides.
struct Overlap {
  double most = 0, one_in_a_hundred = 0;  // the largest, and what a hundredth of the contacts is beyond
};

Overlap overlap(const physics::Model& model, std::span<const BodyState> bodies) {
  BodySet set;
  set.bodies.assign(bodies.begin(), bodies.end());
  std::vector<ContactRecord> contacts;
  physics::Stepper(model).find_contacts(set, {}, contacts);
  std::vector<double> depths;
  for (const ContactRecord& r : contacts) {
    if (r.with_static()) continue;
    const Vec3 normal(r.normal[0], r.normal[1], r.normal[2]), offset(r.offset[0], r.offset[1], r.offset[2]);
    double depth = 0;
    for (std::uint32_t k = 0; k < r.count; ++k) {
      const double *a = r.points[k].arm_a, *b = r.points[k].arm_b;
      depth = std::max(depth, -normal.dot(offset + Vec3(b[0] - a[0], b[1] - a[1], b[2] - a[2])));
    }
    depths.push_back(depth / std::min(model.find(r.a)->inner_extent, model.find(r.b)->inner_extent));
  }
  if (depths.empty()) return {};
  std::sort(depths.begin(), depths.end());
  return {depths.back(), depths[depths.size() * 99 / 100]};
}

// How far bodies without a drive have moved, mean, m: at rest, not at all.
constexpr int kRestBlocks = 4;  // the last so many of a run: 2 s
double moved(const Scene& scene, std::span<const Vec3> before, const std::function<Vec3(std::size_t)>& position) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (scene.bodies[i].drive) continue;
    sum += (position(i) - before[i]).norm();
    ++count;
  }
  return sum / count;
}

// Ours with four sub-steps throughout, ours with what each island needs, and stock Bullet.
enum Side { kFour, kChosen, kBullet, kSides };

struct Measured {
  std::vector<std::vector<double>> blocks[kSides];  // ms per step, by block, then round
  physics::StageTimes stages;                       // of kFour: ms per step, mean over all rounds
  Standing standing[kSides];
  Overlap overlap[kSides];
  double moved[kSides] = {};
  double contacts = 0;  // records at the end
};

class Ours {
 public:
  Ours(Scene scene, std::uint32_t substeps) : model_(fixed(std::move(scene), substeps)), stepper_(model_) {
    stepper_.timing = true;
    set = model_.initial_state();
  }
  void step() { stepper_.step(set); }
  const physics::StageTimes& times() const { return stepper_.times; }
  BodySet set;

 private:
  static Scene fixed(Scene scene, std::uint32_t substeps) {
    scene.substeps = substeps;
    return scene;
  }
  physics::Model model_;
  physics::Stepper stepper_;
};

void measure_round(const Scene& scene, const SceneCase& c, int blocks, int round, int rounds, Measured& m,
                   BodySet& last) {
  Ours four(scene, 4), chosen(scene, 0);
  BulletWorld bullet(scene);
  const std::function<void()> steps[kSides] = {[&] { four.step(); }, [&] { chosen.step(); }, [&] { bullet.step(); }};
  const std::function<Vec3(std::size_t)> position[kSides] = {[&](std::size_t i) { return four.set.bodies[i].x(); },
                                                             [&](std::size_t i) { return chosen.set.bodies[i].x(); },
                                                             [&](std::size_t i) { return bullet.position(i); }};
  std::vector<Vec3> before[kSides];
  for (int side = 0; side < kSides; ++side) m.blocks[side].resize(blocks);
  for (int b = 0; b < blocks; ++b) {
    for (int side = 0; side < kSides && b == blocks - kRestBlocks; ++side)
      for (std::size_t i = 0; i < four.set.bodies.size(); ++i) before[side].push_back(position[side](i));
    for (int turn = 0; turn < kSides; ++turn) {
      const int side = (turn + round) % kSides;
      const double start = cpu_seconds();
      for (int i = 0; i < kBlock; ++i) steps[side]();
      m.blocks[side][b].push_back(1e3 * (cpu_seconds() - start) / kBlock);
    }
  }
  const double scale = 1e3 / (kBlock * blocks * rounds);
  const auto& times = four.times();
  m.stages.boxes += scale * times.boxes;
  m.stages.broad += scale * times.broad;
  m.stages.narrow += scale * times.narrow;
  m.stages.islands += scale * times.islands;
  m.stages.order += scale * times.order;
  m.stages.solve += scale * times.solve;
  for (int side = 0; side < kSides; ++side) {
    m.standing[side] = standing(scene, c, position[side]);
    m.moved[side] = moved(scene, before[side], position[side]);
  }
  const physics::Model model(scene);
  std::vector<BodyState> of_bullet;
  bullet.read(of_bullet);
  m.overlap[kFour] = overlap(model, four.set.bodies);
  m.overlap[kChosen] = overlap(model, chosen.set.bodies);
  m.overlap[kBullet] = overlap(model, of_bullet);
  m.contacts = static_cast<double>(four.set.contacts.size());
  last = std::move(four.set);
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
set boxwidth 0.24
set ylabel 'CPU time per step (ms)'
set yrange [0:*]
set xrange [-0.6:3.6]
set grid y
set key top left
set bmargin 3.5
set title 'One step of SODA (4 sub-steps, by stage; and as needed) and of stock Bullet in double precision, sleeping off'
# columns: scene, bodies, bullet, ours, chosen, boxes, broad, narrow, islands, order, solve
plot 'step.csv' skip 1 using ($0-0.19):3 with boxes lc rgb '#b0b0b0' title 'stock Bullet', \
  '' skip 1 using ($0+0.06):($6+$7+$8+$9+$10+$11) with boxes lc rgb '#d1603d' title 'solve', \
  '' skip 1 using ($0+0.06):($6+$7+$8+$9+$10) with boxes lc rgb '#e9b44c' title 'order', \
  '' skip 1 using ($0+0.06):($6+$7+$8+$9) with boxes lc rgb '#8e6c8a' title 'islands', \
  '' skip 1 using ($0+0.06):($6+$7+$8) with boxes lc rgb '#3d7ea6' title 'narrow phase', \
  '' skip 1 using ($0+0.06):($6+$7) with boxes lc rgb '#6a994e' title 'broad phase', \
  '' skip 1 using ($0+0.06):6 with boxes lc rgb '#5c9ead' title 'boxes', \
  '' skip 1 using ($0+0.31):5 with boxes lc rgb '#606060' title 'sub-steps as needed', \
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
    '' skip 1 using 2:(stringcolumn(1) eq scene ? $3 : NaN) with linespoints pt 7 ps .5 lc rgb '#d1603d' \
      title 'SODA, 4 sub-steps', \
    '' skip 1 using 2:(stringcolumn(1) eq scene ? $5 : NaN) with linespoints pt 7 ps .5 lc rgb '#3d7ea6' \
      title 'SODA, as needed'
}
unset multiplot
)";

}  // namespace

void step(const Options& options, Headline& headline) {
  const int rounds = options.rounds > 0 ? options.rounds : options.quick ? 1 : 3;
  Csv table(options, "step",
            "scene,bodies,bullet_ms,soda_ms,chosen_ms,boxes_ms,broad_ms,narrow_ms,islands_ms,order_ms,solve_ms,"
            "stacks,standing,standing_chosen,standing_bullet,drift_m,drift_chosen_m,drift_bullet_m,sink_m,"
            "sink_chosen_m,sink_bullet_m,overlap,overlap_chosen,overlap_bullet,moved_m,moved_chosen_m,moved_bullet_m");
  Csv course(options, "step_course", "scene,seconds,soda_ms,bullet_ms,chosen_ms");
  const char* const side_names[kSides] = {"", "_chosen", "_bullet"};
  for (SceneCase c : kScenes) {
    if (options.quick) c.bodies /= 4, c.stacked /= 4;
    Scene scene = generate(c.name, c.bodies, kSeed);
    scene.sleeping = false;
    const int blocks = static_cast<int>(std::lround((options.quick ? 2 : kSeconds) / scene.dt)) / kBlock;
    Measured m;
    BodySet last;
    for (int round = 0; round < rounds; ++round) measure_round(scene, c, blocks, round, rounds, m, last);
    // All runs are deterministic, so a block does the same work in every round.
    double ms[kSides] = {};
    for (int b = 0; b < blocks; ++b) {
      double here[kSides];
      for (int side = 0; side < kSides; ++side) ms[side] += (here[side] = median(m.blocks[side][b])) / blocks;
      course.row(c.name, (b + 0.5) * kBlock * scene.dt, here[kFour], here[kBullet], here[kChosen]);
    }
    const std::uint32_t stacks = c.stacked / c.per_stack;
    std::printf(
        "%-7s %5u bodies: SODA %.3f ms per step (sub-steps as needed: %.3f), stock Bullet %.3f, ratio %.3f (%.3f)",
        c.name, c.bodies, ms[kFour], ms[kChosen], ms[kBullet], ms[kFour] / ms[kBullet], ms[kChosen] / ms[kBullet]);
    if (stacks)
      std::printf("; of %u stacks %u (%u) stand, with Bullet %u", stacks, m.standing[kFour].stacks,
                  m.standing[kChosen].stacks, m.standing[kBullet].stacks);
    std::printf("; moved in the last 2 s, mean: %.2g m (%.2g), Bullet %.2g", m.moved[kFour], m.moved[kChosen],
                m.moved[kBullet]);
    std::printf("; overlap of one contact in a hundred, of half extents: %.3f (%.3f), Bullet %.3f\n",
                m.overlap[kFour].one_in_a_hundred, m.overlap[kChosen].one_in_a_hundred,
                m.overlap[kBullet].one_in_a_hundred);
    std::fflush(stdout);
    const auto& [four, chosen, bullet] = m.standing;
    table.row(c.name, c.bodies, ms[kBullet], ms[kFour], ms[kChosen], m.stages.boxes, m.stages.broad, m.stages.narrow,
              m.stages.islands, m.stages.order, m.stages.solve, stacks, four.stacks, chosen.stacks, bullet.stacks,
              four.drift, chosen.drift, bullet.drift, four.sink, chosen.sink, bullet.sink,
              m.overlap[kFour].one_in_a_hundred, m.overlap[kChosen].one_in_a_hundred,
              m.overlap[kBullet].one_in_a_hundred, m.moved[kFour], m.moved[kChosen], m.moved[kBullet]);
    const std::string name = c.name;
    headline.add(name + ".time_over_bullet", ms[kFour] / ms[kBullet]);
    headline.add(name + ".time_over_bullet_chosen", ms[kChosen] / ms[kBullet]);
    headline.add(name + ".boxes_ms", m.stages.boxes);
    headline.add(name + ".broad_ms", m.stages.broad);
    headline.add(name + ".narrow_ms", m.stages.narrow);
    headline.add(name + ".islands_ms", m.stages.islands);
    headline.add(name + ".order_ms", m.stages.order);
    headline.add(name + ".solve_ms", m.stages.solve);
    headline.add(name + ".contact_records", m.contacts);
    if (stacks) headline.add(name + ".stacks", stacks);
    for (int side = 0; side < kSides; ++side) {
      const std::string of = side_names[side];
      headline.add(name + ".ms_per_step" + of, ms[side]);
      headline.add(name + ".overlap" + of, m.overlap[side].one_in_a_hundred);
      headline.add(name + ".overlap_most" + of, m.overlap[side].most);
      headline.add(name + ".moved" + of + "_m", m.moved[side]);
      if (!stacks) continue;
      headline.add(name + ".standing" + of, m.standing[side].stacks);
      headline.add(name + ".drift" + of + "_m", m.standing[side].drift);
      headline.add(name + ".sink" + of + "_m", m.standing[side].sink);
    }
    measure_state(name, physics::Model(scene), last, headline);
  }
  table.close();
  course.close();
  plot(options, "step", kBars, 900, 520);
  plot(options, "step_course", kCourse, 900, 620);
}

}  // namespace soda::bench
