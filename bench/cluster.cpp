#include "bench/cluster.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "bench/clocks.h"

namespace soda::bench {

void MeasuredCosts::begin(const border::WorldCore&) { since_ = cpu_seconds(); }

double MeasuredCosts::spent(WorldId, const border::WorldCore&, Activity, double) {
  const double now = cpu_seconds();
  return now - std::exchange(since_, now);
}

Cluster::Cluster(const Scene& scene, const TerritoryMap& map, border::CoreSettings settings, const Network& network,
                 Costs& costs)
    : network_(network), costs_(costs), model_(scene), map_(map), worlds_(map.worlds) {
  for (WorldId w = 0; w < worlds(); ++w) {
    settings.me = w;
    worlds_[w].core = std::make_unique<border::WorldCore>(model_, map_, settings, ignores_);
  }
}

void Cluster::at(double time, std::function<void()> happens) {
  events_.push_back({time, ++number_, std::move(happens)});
  std::push_heap(events_.begin(), events_.end());
}

void Cluster::order(WorldId w, const Order& order) {
  worlds_[w].order = order;
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

// A world that is not busy takes what has come, and does what it can.
void Cluster::look(WorldId w) {
  World& world = worlds_[w];
  border::WorldCore& core = *world.core;
  bool more = true;
  while (more && !world.busy && !stopped_) {
    double took = 0;
    const auto spend = [&](Activity activity, double seconds) {
      world.usage.seconds[static_cast<std::size_t>(activity)] += seconds;
      took += seconds;
    };
    const auto measure = [&](Activity activity) { spend(activity, costs_.spent(w, core, activity, now_)); };
    costs_.begin(core);
    if (const auto order = std::exchange(world.order, std::nullopt)) {
      core.set_limit(order->limit);
      core.close_actions(order->closed, 0);
    }
    double network = 0;
    for (const auto& bytes : world.inbox) {
      if (!core.receive(bytes)) throw std::runtime_error(core.last_refusal());
      network += network_.receive_seconds + network_.receive_seconds_per_byte * static_cast<double>(bytes.size());
    }
    world.inbox.clear();
    measure(Activity::kReceiving);
    more = core.work() == border::Progress::kWorked;
    measure(Activity::kWorking);
    std::vector<border::Outgoing> out = core.take_outgoing();
    measure(Activity::kTelling);
    for (const border::Outgoing& message : out)
      network += network_.send_seconds + network_.send_seconds_per_byte * static_cast<double>(message.bytes.size());
    spend(Activity::kNetwork, network);
    if (!(took > 0)) {
      hand_over(w, std::move(out));
      continue;
    }
    world.busy = true;  // what has come of it is known afterwards
    at(now_ + took, [this, w, more, out = std::move(out)]() mutable {
      World& done = worlds_[w];
      done.busy = false;
      hand_over(w, std::move(out));
      if (more || !done.inbox.empty() || done.order) look(w);
    });
  }
}

void Cluster::hand_over(WorldId w, std::vector<border::Outgoing> out) {
  double& free = worlds_[w].line_free;
  for (border::Outgoing& message : out) {
    free = std::max(free, now_) + static_cast<double>(message.bytes.size()) / network_.bytes_per_second;
    at(free + network_.latency, [this, to = message.to, bytes = std::move(message.bytes)]() mutable {
      worlds_[to].inbox.push_back(std::move(bytes));
      look(to);
    });
  }
  if (worked) worked(w);
}

}  // namespace soda::bench
