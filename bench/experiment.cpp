#include "bench/experiment.h"

#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "bench/lone_core.h"
#include "bench/piece_file.h"

namespace soda::bench {
namespace {

using Factors = std::array<double, kActivities>;
constexpr Factors kAlone{1, 1, 1, 1};
constexpr WorldId kReplayed = 4;

// Memory that a process has had before costs less than what the kernel must find and clear, as does that of a session
// that has run for a while: so that all runs find it alike, so much, bytes, is taken and given back to the heap alone.
void warm_heap(std::size_t bytes) {
  mallopt(M_TRIM_THRESHOLD, -1);  // never
  mallopt(M_TOP_PAD, 64 << 20);
  mallopt(M_MMAP_MAX, 0);
  // Small pieces are joined as they are freed. Otherwise malloc does it for the whole heap at once now and then, and
  // the world that happens to free something large then tidies up after all others (up to 1 ms).
  mallopt(M_MXFAST, 0);
  constexpr std::size_t kPiece = std::size_t{1} << 16;
  std::vector<std::unique_ptr<char[]>> pieces;
  for (std::size_t i = 0; i < bytes / kPiece; ++i) {
    pieces.emplace_back(new char[kPiece]);
    std::memset(pieces.back().get(), 1, kPiece);
  }
}

// A whole session of so many steps, from the scene to when the last of them is final everywhere. (Between two steps on
// the way those who run ahead would have done more, or less, than what lies between.)
class Run {
 public:
  Run(const Scene& scene, WorldId worlds, const Mode& mode, const Network& network, Step steps, const Factors& factors,
      Yardstick& yardstick)
      : mode_(mode),
        latency_(network.latency),
        steps_(steps),
        yardstick_(yardstick),
        costs_(&yardstick),
        cluster_(scene, bisect(scene, make_grid(scene), worlds),
                 {.last_step = steps, .sync = mode.sync, .window = kWindow}, network, costs_),
        final_(worlds, 0),
        front_(worlds, 0) {
    cluster_.worked = [this](WorldId w) { worked(w); };
    if (mode.barrier) order_all(1);
    costs_.factors = factors;
  }

  // The session, with what some worlds are given kept in `file`, to be replayed elsewhere; what they cost here.
  Cluster::Usage together(const std::vector<WorldId>& some, std::FILE* file) {
    for (const WorldId w : some) cluster_.record(w);
    cluster_.run();
    Cluster::Usage sum;
    for (const WorldId w : some) {
      for (std::size_t a = 0; a < kActivities; ++a) sum.seconds[a] += cluster_.usage(w).seconds[a];
      keep(cluster_.recorded(w), file);
    }
    std::fflush(file);
    return sum;
  }

  Outcome outcome() {
    cluster_.run();
    Outcome o;
    const auto steps = static_cast<double>(steps_);
    const double worlds = cluster_.worlds();
    o.step = cluster_.now() / steps;
    double bodies_max = 0, bodies = 0, redone = 0, computed = 0;
    for (WorldId w = 0; w < cluster_.worlds(); ++w) {
      const border::WorldCore& core = cluster_.core(w);
      const Cluster::Usage& usage = cluster_.usage(w);
      for (std::size_t a = 0; a < kActivities; ++a) o.mean[a] += usage.seconds[a] / steps / worlds;
      o.pieces += static_cast<double>(usage.pieces) / steps / worlds;
      o.busy_mean += usage.busy() / steps / worlds;
      o.busy_max = std::max(o.busy_max, usage.busy() / steps);
      const auto own = static_cast<double>(core.own_bodies());
      bodies += own;
      bodies_max = std::max(bodies_max, own);
      o.messages += static_cast<double>(core.stats().messages_sent) / steps / worlds;
      o.bytes += static_cast<double>(core.stats().bytes_sent) / steps / worlds;
      o.mixed_islands += static_cast<double>(core.stats().mixed_islands) / steps;
      redone += static_cast<double>(bodies_redone(core));
      computed += static_cast<double>(bodies_computed(core));
    }
    o.bodies_max_over_mean = bodies_max / (bodies / worlds);
    o.redone = redone / computed;
    return o;
  }

 private:
  void worked(WorldId w) {
    if (mode_.barrier && pass(front_, w, cluster_.core(w).front(), limit_)) {
      // Word of it goes up a binary tree of all worlds, and down again.
      const int levels = static_cast<int>(std::bit_width(cluster_.worlds() - 1u));
      cluster_.at(cluster_.now() + 2 * levels * latency_, [this, next = limit_ + 1] { order_all(next); });
    }
    if (pass(final_, w, cluster_.core(w).final_step(), steps_)) cluster_.stop();
  }

  // Notes how far a world has got; whether all have now got to `goal`, and had not before.
  static bool pass(std::vector<Step>& reached, WorldId w, Step step, Step goal) {
    const bool before = std::exchange(reached[w], step) >= goal;
    return !before && step >= goal && *std::min_element(reached.begin(), reached.end()) >= goal;
  }

  void order_all(Step limit) {
    limit_ = limit;
    for (WorldId w = 0; w < cluster_.worlds(); ++w) cluster_.order(w, {limit, limit});
  }

  const Mode mode_;
  const double latency_;  // s
  const Step steps_;
  Yardstick& yardstick_;
  MeasuredCosts costs_;
  Cluster cluster_;
  std::vector<Step> final_, front_;  // by world
  Step limit_ = 0;                   // of the barrier
};

// What `f` returns, computed in a process of its own: so each run finds the same heap, in which no other has left its
// memory in pieces.
template <typename F>
auto apart(F&& f) {
  using Result = decltype(f());
  static_assert(std::is_trivially_copyable_v<Result>);
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("cannot make a pipe");
  std::fflush(stdout);
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("cannot start a process");
  if (child == 0) {
    int status = 1;
    try {
      const Result result = f();
      status = write(ends[1], &result, sizeof result) == static_cast<ssize_t>(sizeof result) ? 0 : 1;
    } catch (const std::exception& error) {
      std::fprintf(stderr, "soda-bench: %s\n", error.what());
    }
    _exit(status);
  }
  close(ends[1]);
  Result result;
  const bool got = read(ends[0], &result, sizeof result) == static_cast<ssize_t>(sizeof result);
  close(ends[0]);
  waitpid(child, nullptr, 0);
  if (!got) throw std::runtime_error("a run of the model has failed");
  return result;
}

}  // namespace

Outcome Experiment::run(const Mode& mode, const Network& network) {
  const Factors factors = this->factors(mode, network);
  Outcome o = apart([&] {
    warm_heap(heap(worlds_));
    return Run(scene_, worlds_, mode, network, steps_, factors, yardstick_).outcome();
  });
  o.alone = factors[static_cast<std::size_t>(Activity::kWorking)];
  return o;
}

Outcome Experiment::best(const Mode& mode, const Network& network, int rounds) {
  Outcome best = run(mode, network);
  for (int round = 1; round < rounds; ++round)
    if (const Outcome o = run(mode, network); o.busy_mean < best.busy_mean) best = o;
  return best;
}

// What a world's work costs in a process of its own against what it costs among the others, where all share one
// processor's caches and one heap. By some worlds, with the same messages.
Experiment::Factors Experiment::factors(const Mode& mode, const Network& network) {
  std::optional<Factors>& known = factors_[mode.sync == border::Sync::kAnticipative];
  if (worlds_ == 1) return kAlone;
  if (known) return *known;
  std::vector<WorldId> some;
  for (WorldId i = 0; i < kReplayed; ++i)
    if (const WorldId w = (2 * i + 1) * worlds_ / (2 * kReplayed); some.empty() || w != some.back()) some.push_back(w);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::tmpfile(), &std::fclose);
  if (!file) throw std::runtime_error("cannot keep what worlds are given");
  const Cluster::Usage together = apart([&] {
    warm_heap(heap(worlds_));
    return Run(scene_, worlds_, {mode.name, mode.sync, false}, network, steps_, kAlone, yardstick_)
        .together(some, file.get());
  });
  std::rewind(file.get());
  Cluster::Usage alone;
  for (const WorldId w : some) {
    const std::vector<Cluster::Piece> pieces = kept(file.get());
    const Cluster::Usage one = apart([&] {
      warm_heap(heap(1));
      MeasuredCosts costs(&yardstick_);
      return Cluster(scene_, bisect(scene_, make_grid(scene_), worlds_),
                     {.last_step = steps_, .sync = mode.sync, .window = kWindow}, network, costs, false)
          .replay(w, pieces, costs);
    });
    for (std::size_t a = 0; a < kActivities; ++a) alone.seconds[a] += one.seconds[a];
  }
  known.emplace();
  for (std::size_t a = 0; a < kActivities; ++a)
    (*known)[a] = together.seconds[a] > 0 ? alone.seconds[a] / together.seconds[a] : 1;
  return *known;
}
// Bytes: records of a body at all steps of a window, and a start for each world.
std::size_t Experiment::heap(WorldId worlds) const {
  return scene_.bodies.size() / worlds_ * worlds * 40'000 + worlds * (std::size_t{2} << 20);
}

}  // namespace soda::bench
