#include "balance_crowd.h"

#include <algorithm>
#include <cmath>

#include "common/anticipation.h"

namespace soda::balance::test {
namespace {

constexpr double kDt = 1.0 / 60;
constexpr Step kEvery = 15, kDelay = 15, kUntilEffect = 60, kLongAgo = 600;
constexpr int kTries = 3;  // of a world that is refused, at once

std::uint64_t mixed(std::uint64_t x) {  // splitmix64
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}
double uniform(std::uint64_t seed) { return (static_cast<double>(mixed(seed) >> 11) + 0.5) * 0x1p-53; }
double gaussian(std::uint64_t seed) {
  return std::sqrt(-2 * std::log(uniform(2 * seed))) * std::cos(2 * M_PI * uniform(2 * seed + 1));
}
}  // namespace

Walk walking_crowd(const Grid& grid, std::size_t bodies, double spread, double radius, double seconds) {
  std::vector<Vec3> offset(bodies);
  std::uint64_t seed = 0;
  const auto within = [&](double deviation, double most) {
    for (;;)
      if (const double x = deviation * gaussian(seed++); std::abs(x) < most) return x;
  };
  for (Vec3& o : offset) {
    o.x() = within(spread, radius);
    o.y() = within(spread, radius);
    o.z() = std::abs(within(1, grid.size[2]));
  }
  const Vec3 from(radius, radius, 0), to(grid.size[0] - radius, grid.size[1] - radius, 0);
  return [=](std::size_t b, double time) -> Vec3 {
    if (b < bodies) return from + (to - from) * std::min(time / seconds, 1.0) + offset[b];
    const Cell c = cell_at(grid, b - bodies);  // those that stand
    return {c[0] + 0.5, c[1] + 0.5, c[2] + 0.5};
  };
}

std::vector<WorldId> bisected(const CrowdOptions& o) {
  Scene scene;
  for (std::size_t b = 0; b < o.bodies; ++b) {
    Body body;
    body.id = b + 1;
    body.pose.position = o.walk(b, 0);
    scene.bodies.push_back(body);
  }
  return bisect(scene, o.grid, o.worlds, 0).owner;  // borders cost nothing here
}

CrowdSession::CrowdSession(const CrowdOptions& options)
    : o_(options),
      owner_(o_.owner),
      agreed_(o_.owner),
      cell_(o_.bodies),
      count_(o_.grid.cells()),
      load_(o_.worlds),
      expected_cost_(o_.worlds, std::vector<double>(o_.grid.cells())),
      policies_(o_.worlds, Policy(o_.settings)),
      past_(o_.grid.cells()),
      ahead_(o_.worlds, o_.window) {
  check("at the start", owner_);
}

double CrowdSession::measured(double cost) { return cost * (1 + o_.noise * (2 * uniform(random_++) - 1)); }

void CrowdSession::move() {
  std::fill(count_.begin(), count_.end(), 0);
  for (std::size_t b = 0; b < o_.bodies; ++b) {
    cell_[b] = static_cast<std::uint32_t>(o_.grid.index(o_.grid.cell_of(o_.walk(b, static_cast<double>(now_) * kDt))));
    ++count_[cell_[b]];
  }
  std::fill(load_.begin(), load_.end(), 0);
  for (std::size_t c = 0; c < count_.size(); ++c) load_[owner_[c]] += o_.cost * static_cast<double>(count_[c]);
}

// What each world expects of each cell: of the bodies that it knows, its own and those within half a cell of it, that
// they go on as they do.
void CrowdSession::forecast() {
  for (auto& cost : expected_cost_) std::fill(cost.begin(), cost.end(), 0);
  constexpr double kMoment = 0.05;
  for (std::size_t b = 0; b < o_.bodies; ++b) {
    const double time = static_cast<double>(now_) * kDt;
    const Vec3 at = o_.walk(b, time);
    const Vec3 then =
        o_.foresight && time > kMoment ? Vec3(at + (at - o_.walk(b, time - kMoment)) * (o_.horizon / kMoment)) : at;
    const std::size_t goal = o_.grid.index(o_.grid.cell_of(then));
    const WorldId w = agreed_[goal];
    bool known = false;
    for (int corner = 0; corner < 9 && !known; ++corner) {
      const Vec3 near = at + o_.speed_known * Vec3(corner % 3 - 1, corner / 3 - 1, 0);
      const std::size_t cell = o_.grid.index(o_.grid.cell_of(near));
      known = owner_[cell] == w || agreed_[cell] == w;
    }
    if (known) expected_cost_[w][goal] += o_.cost;
  }
}

void CrowdSession::check(const char* when, const std::vector<WorldId>& owner) {
  for (WorldId w = 0; w < o_.worlds; ++w) {
    if (!connected(o_.grid, owner, w))
      fault_ += "world " + std::to_string(w) + " in pieces " + when + " " + std::to_string(now_) + "\n";
    if (std::find(owner.begin(), owner.end(), w) == owner.end())
      fault_ += "world " + std::to_string(w) + " without cells " + when + " " + std::to_string(now_) + "\n";
  }
}

void CrowdSession::apply() {
  while (!flying_.empty() && flying_.front().step <= now_) {
    for (const std::uint32_t cell : flying_.front().cells) owner_[cell] = flying_.front().taker;
    flying_.pop_front();
    check("after a transfer, step", owner_);
  }
}

bool CrowdSession::decide(WorldId world) {
  const bool busy = std::any_of(flying_.begin(), flying_.end(),
                                [&](const Transfer& t) { return t.giver == world && now_ < t.agreed + o_.in_flight; });
  if (!o_.balancing || busy || reports_.size() * kEvery <= kDelay) return true;
  const auto& known = reports_[reports_.size() - 1 - kDelay / kEvery];
  std::vector<std::uint32_t> mine;
  for (std::uint32_t c = 0; c < owner_.size(); ++c)
    if (owner_[c] == world && agreed_[c] == world) mine.push_back(c);
  std::vector<Neighbour> neighbours;
  std::vector<std::uint8_t> near(o_.worlds, 0);
  for (std::size_t c = 0; c < owner_.size(); ++c)
    if (agreed_[c] == world) for_around(o_.grid, c, [&](std::size_t n) { near[agreed_[n]] = 1; });
  for (WorldId n = 0; n < o_.worlds; ++n)
    if (near[n] && n != world) neighbours.push_back({n, known[n]});
  const Situation situation{
      o_.grid,       world,     now_,      agreed_, mine, expected_cost_[world], reports_.back()[world],
      ahead_[world], o_.budget, neighbours};
  const auto proposal = policies_[world].propose(situation);
  if (!proposal) return true;
  // The taker counts what it has accepted since it reported.
  Load taker = reports_.back()[proposal->taker];
  for (const Transfer& t : flying_) {
    if (t.step != now_ + kUntilEffect) continue;
    if (t.taker == proposal->taker) taker.expected += t.cost;
    if (t.giver == proposal->taker) taker.expected -= t.cost;
  }
  const bool accepted =
      may_take(o_.grid, agreed_, proposal->taker, proposal->cells, proposal->cost, taker, reports_.back()[world]);
  policies_[world].answered(now_, *proposal, accepted);
  if (!accepted) {
    ++refused_;
    return false;
  }
  policies_[proposal->taker].took(now_, world, proposal->cells);
  for (const std::uint32_t cell : proposal->cells) {
    if (agreed_[cell] != world) fault_ += "gave what is another's\n";
    if (past_[cell].from == proposal->taker && now_ - past_[cell].at < kLongAgo) ++returned_;
    past_[cell] = {world, now_};
    agreed_[cell] = proposal->taker;
  }
  ++transfers_;
  cells_moved_ += proposal->cells.size();
  last_transfer_ = now_;
  flying_.push_back({now_ + kUntilEffect, now_, world, proposal->taker, proposal->cells, proposal->cost});
  check("when agreed, step", agreed_);
  return true;
}

double CrowdSession::slowest_over_mean() const {
  double sum = 0;
  for (const double load : load_) sum += load;
  return *std::max_element(load_.begin(), load_.end()) * o_.worlds / sum;
}

void CrowdSession::run(Step steps) {
  for (const Step end = now_ + steps; now_ < end; ++now_) {
    apply();
    if (now_ % 3 == 0) {
      move();
      worst_ = std::max(worst_, slowest_over_mean());
      ratios_ += slowest_over_mean();
      ++samples_;
    }
    // Paced: the display waits for the slowest; the others fill their windows.
    if (o_.budget > 0) {
      const double least = *std::min_element(ahead_.begin(), ahead_.end());
      const bool shown = least >= 1;
      if (!shown) late_ += kDt;
      for (WorldId w = 0; w < o_.worlds; ++w)
        ahead_[w] = std::min(o_.window, ahead_[w] - shown + o_.budget / std::max(load_[w], 1e-9));
    }
    if (now_ % kEvery != 0) continue;
    forecast();
    std::vector<Load> loads(o_.worlds);
    for (WorldId w = 0; w < o_.worlds; ++w) {
      for (double& cost : expected_cost_[w]) cost = measured(cost), loads[w].expected += cost;
      loads[w].work = measured(load_[w]);
      if (o_.budget > 0) loads[w].on_time = steps_on_time(ahead_[w], o_.budget, loads[w].work);
    }
    reports_.push_back(std::move(loads));
    if (reports_.size() > 4) reports_.pop_front();
    for (WorldId w = 0; w < o_.worlds; ++w)
      for (int tries = 0; tries < kTries && !decide(w); ++tries) {
      }
  }
}

std::size_t CrowdSession::bodies_near_borders() const {
  std::size_t bodies = 0;
  for (std::size_t c = 0; c < owner_.size(); ++c) {
    bool border = false;
    for_faces(o_.grid, c, [&](std::size_t n) { border |= owner_[n] != owner_[c]; });
    if (border) bodies += count_[c];
  }
  return bodies;
}

std::size_t CrowdSession::border_faces() const {
  std::size_t faces = 0;
  for (std::size_t c = 0; c < owner_.size(); ++c)
    for_faces(o_.grid, c, [&](std::size_t n) { faces += n > c && owner_[n] != owner_[c]; });
  return faces;
}

std::string CrowdSession::picture() const {
  std::string text;
  for (std::int32_t y = o_.grid.size[1]; y-- > 0; text += '\n')
    for (std::int32_t x = 0; x < o_.grid.size[0]; ++x)
      text += "0123456789ABCDEF"[owner_[o_.grid.index({x, y, 0})] % 16];
  return text;
}

}  // namespace soda::balance::test
