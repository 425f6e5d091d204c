#include "bench/cluster.h"

#include <algorithm>
#include <array>
#include <bit>
#include <stdexcept>
#include <utility>

#include "bench/harness.h"
#include "common/cpu_clock.h"
#include "common/scene/generators.h"

namespace soda::bench {

double CostBySize::operator()(std::size_t bytes) const {
  const auto size = static_cast<double>(bytes);
  if (known_.size() == 1) return known_.front().seconds;
  std::size_t i = 1;
  while (i + 1 < known_.size() && known_[i].bytes < size) ++i;
  const Known &low = known_[i - 1], &high = known_[i];
  // By noise a larger one may have been quicker.
  return std::max(0.0, low.seconds + (high.seconds - low.seconds) * (size - low.bytes) / (high.bytes - low.bytes));
}

Yardstick::Yardstick() : model_(generate("piles", 324, 1)), stepper_(model_), start_(model_.initial_state()) {
  for (int i = 0; i < 30; ++i) stepper_.step(start_);
  at_first_ = seconds();
  for (int i = 0; i < 100; ++i) at_first_ = std::min(at_first_, seconds());
}

double Yardstick::seconds() {
  BodySet set = start_;
  const double begun = cpu_seconds();
  for (int i = 0; i < 4; ++i) stepper_.step(set);
  return cpu_seconds() - begun;
}

double Yardstick::slowness() {
  (void)seconds();  // brings it into the cache
  std::array<double, 3> some{seconds(), seconds(), seconds()};
  std::sort(some.begin(), some.end());
  return some[1] / at_first_;
}

MeasuredCosts::MeasuredCosts(Yardstick* yardstick) : yardstick_(yardstick) {
  for (int i = 0; i < 100; ++i) {
    const double begun = cpu_seconds();
    reading_ = std::min(reading_, cpu_seconds() - begun);
  }
}

void MeasuredCosts::begin(const border::WorldCore& core) {
  constexpr double kEvery = 0.2;  // s of CPU time: others begin and end all the time
  bodies_ = core.stats().timeline.bodies_computed;
  clock_ = core.clock();
  since_ = cpu_seconds();
  if (!yardstick_ || since_ < known_at_ + kEvery) return;
  slowness_ = yardstick_->slowness();
  known_at_ = since_ = cpu_seconds();
}

double MeasuredCosts::spent(WorldId world, const border::WorldCore& core, Activity activity, double) {
  const double now = cpu_seconds();
  double seconds = std::max(0.0, now - since_ - reading_) / slowness_;
  if (activity == Activity::kWorking) seconds = clipped(world, core, seconds);
  since_ = cpu_seconds();
  return factors[static_cast<std::size_t>(activity)] * seconds;
}

double MeasuredCosts::clipped(WorldId world, const border::WorldCore& core, double seconds) {
  constexpr std::uint64_t kLarge = 32;        // bodies
  constexpr std::size_t kFew = 3, kMost = 9;  // pieces of work that say what is usual
  const std::uint64_t bodies = core.stats().timeline.bodies_computed - bodies_;
  const bool step = core.clock() > clock_;  // its islands have been found
  if (!step && bodies < kLarge) return seconds;
  std::vector<double>& like = like_[{world, step, static_cast<std::uint32_t>(std::bit_width(bodies))}];
  const double most = like.size() >= kFew ? 2 * median(like) : seconds;
  if (like.size() >= kMost) like.erase(like.begin());
  like.push_back(seconds);
  return std::min(seconds, most);
}

Cluster::Cluster(const Scene& scene, const TerritoryMap& map, const border::CoreSettings& settings,
                 const Network& network, Costs& costs, bool with_worlds)
    : settings_(settings), network_(network), costs_(costs), model_(scene), map_(map), worlds_(map.worlds) {
  for (WorldId w = 0; with_worlds && w < worlds(); ++w) {
    worlds_[w].core = make_core(w);
    if (settings.balance)
      worlds_[w].balancer = std::make_unique<balance::Balancer>(*worlds_[w].core, map_.grid, w, scene.dt);
  }
}

std::unique_ptr<border::WorldCore> Cluster::make_core(WorldId w) const {
  border::CoreSettings settings = settings_;
  settings.me = w;
  return std::make_unique<border::WorldCore>(model_, map_, settings, ignores_);
}

void Cluster::at(double time, std::function<void()> happens) {
  events_.push_back({time, ++number_, std::move(happens)});
  std::push_heap(events_.begin(), events_.end());
}

void Cluster::order(WorldId w, const Order& order) {
  worlds_[w].next.order = order;
  if (running_) look(w);
}

void Cluster::run() {
  running_ = true;
  for (WorldId w = 0; w < worlds(); ++w) at(0, [this, w] { look(w); });
  while (!stopped_) {
    if (events_.empty()) throw std::runtime_error("the session stands still");
    std::pop_heap(events_.begin(), events_.end());
    const Event event = std::move(events_.back());
    events_.pop_back();
    now_ = event.time;
    event.happens();
  }
}

Cluster::Done Cluster::work(WorldId w, border::WorldCore& core, balance::Balancer* balancer, const Piece& piece,
                            Costs& costs, Usage& usage) const {
  Done done{};
  const auto spend = [&](Activity activity, double seconds) {
    usage.seconds[static_cast<std::size_t>(activity)] += seconds;
    done.seconds += seconds;
  };
  const auto measure = [&](Activity activity) { spend(activity, costs.spent(w, core, activity, now_)); };
  costs.begin(core);
  if (piece.order) {
    core.set_limit(piece.order->limit);
    core.close_actions(piece.order->closed, 0);
  }
  double network = 0;
  for (const auto& bytes : piece.messages) {
    if (!core.receive(bytes)) throw std::runtime_error(core.last_refusal());
    network += network_.receive(bytes.size());
  }
  measure(Activity::kReceiving);
  done.progress = core.work(piece.patient);
  measure(Activity::kWorking);
  if (balancer) {
    balancer->worked(done.seconds);
    balancer->consider(pace);
  }
  done.out = core.take_outgoing();
  measure(Activity::kTelling);
  for (const border::Outgoing& message : done.out) network += network_.send(message.bytes.size());
  spend(Activity::kNetwork, network);
  usage.pieces += done.progress == border::Progress::kWorked;
  return done;
}

Cluster::Usage Cluster::replay(WorldId w, const std::vector<Piece>& pieces, Costs& costs) const {
  const auto core = make_core(w);
  Usage usage;
  for (const Piece& piece : pieces) (void)work(w, *core, nullptr, piece, costs, usage);
  return usage;
}

// A world that is not busy takes what has come, and does what it can.
void Cluster::look(WorldId w) {
  World& world = worlds_[w];
  bool more = true;
  while (more && !world.busy && !stopped_) {
    Piece piece = std::exchange(world.next, {});
    Done done = work(w, *world.core, world.balancer.get(), piece, costs_, world.usage);
    if (world.recorded) world.pieces.push_back(std::move(piece));
    more = done.progress == border::Progress::kWorked;
    if (done.progress == border::Progress::kHolding)
      hold(w, done.seconds);
    else
      world.holds = 0;
    if (!(done.seconds > 0)) {
      hand_over(w, std::move(done.out));
      continue;
    }
    world.busy = true;  // what has come of it is known afterwards
    at(now_ + done.seconds, [this, w, more, out = std::move(done.out)]() mutable {
      World& ready = worlds_[w];
      ready.busy = false;
      hand_over(w, std::move(out));
      if (more || !ready.next.messages.empty() || ready.next.order) look(w);
    });
  }
}

// As the daemon does: begins without what is on its way when that has not come within a part of a step's time.
void Cluster::hold(WorldId w, double seconds) {
  World& world = worlds_[w];
  if (world.holds != 0) return;
  world.holds = number_ + 1;
  const double step = world.usage.busy() / static_cast<double>(std::max<Step>(1, world.core->clock()));
  at(now_ + seconds + border::kPatienceShare * step, [this, w, held = world.holds] {
    if (worlds_[w].holds != held) return;
    worlds_[w].holds = 0;
    worlds_[w].next.patient = false;
    look(w);
  });
}

void Cluster::hand_over(WorldId w, std::vector<border::Outgoing> out) {
  double& free = worlds_[w].line_free;
  for (border::Outgoing& message : out) {
    free = std::max(free, now_) + static_cast<double>(message.bytes.size()) / network_.bytes_per_second;
    at(free + network_.latency, [this, to = message.to, bytes = std::move(message.bytes)]() mutable {
      worlds_[to].next.messages.push_back(std::move(bytes));
      look(to);
    });
  }
  if (worked) worked(w);
}

}  // namespace soda::bench
