#include "server/balance/balancer.h"

#include <algorithm>
#include <utility>

#include "common/anticipation.h"

namespace soda::balance {
namespace {

// What a body costs, against one that lies awake without contacts.
constexpr double kPerContact = 0.5, kStill = 0.02;
constexpr double kNewest = 0.5;         // weight of the newest measurement in the mean
constexpr double kLate = 2;             // frames by which a world falls behind before it looks at its load
constexpr double kMostForesight = 1.5;  // s; who walks turns round, later on
constexpr int kMostOffers = 4;          // one after the other, before the next measurement

}  // namespace

Balancer::Balancer(border::WorldCore& core, const Grid& grid, WorldId me, double dt)
    : core_(core),
      grid_(grid),
      me_(me),
      foresight_(std::min(kMostForesight,
                          dt * (static_cast<double>(core.steps_to_transfer()) + 0.5 * static_cast<double>(kEvery)))),
      policy_([&] {
        Settings settings;
        settings.transfer_steps = static_cast<double>(core.steps_to_transfer());
        settings.keep = std::max(settings.keep, 2 * core.steps_to_transfer());
        return settings;
      }()),
      cost_(grid.cells(), 0) {}

void Balancer::consider(const Pace& pace) {
  answer_offers();
  const bool again = hear_answer(pace);
  // Sooner where it falls behind: every step counts then.
  const Step now = core_.clock();
  if (now > seen_) {
    const double steps = static_cast<double>(now - std::exchange(seen_, now));
    late_ = std::max(0.0, late_ + (since_ - std::exchange(seen_since_, since_)) - steps * pace.budget);
  }
  const bool late = pace.budget > 0 && late_ > kLate * pace.budget;
  const bool due = now >= measured_at_ + kEvery || (late && now > measured_at_);
  if (due) {
    measure(pace);
    for (const WorldId neighbour : core_.neighbours()) {
      Load told = load_;
      const auto leaving = leaving_.find(neighbour);
      told.coming = leaving == leaving_.end() ? 0 : leaving->second;
      core_.tell_load(neighbour, told);
    }
    offers_ = 0;
  }
  if ((due || (again && offers_ < kMostOffers)) && !proposed_) offer(pace);
}

// What a step costs, in the mean, and what it will cost.
void Balancer::measure(const Pace& pace) {
  const Step now = core_.clock();
  // By the body, so that it holds at once for what has been given or taken since.
  const std::uint64_t before = std::exchange(computed_, core_.stats().timeline.bodies_computed);
  if (computed_ > before) {
    const double each = since_ / static_cast<double>(computed_ - before);
    const bool urgent = pace.budget > 0 && each > per_body_;  // who is late must not wait for a mean
    per_body_ = urgent || per_body_ == 0 ? each : (1 - kNewest) * per_body_ + kNewest * each;
  }
  since_ = seen_since_ = late_ = 0;
  measured_at_ = now;
  const std::vector<WorldId> owners = core_.owners_ahead();
  spread_cost(owners);
  load_.expected = 0;
  for (const std::uint32_t cell : costly_)
    if (owners[cell] == me_) load_.expected += cost_[cell];
  std::erase_if(promises_, [&](const border::Offer& p) {
    return std::all_of(p.cells.begin(), p.cells.end(),
                       [&](std::uint32_t cell) { return core_.has_cell(cell) || owners[cell] != me_; });
  });
  for (const border::Offer& p : promises_) load_.expected += p.cost;
  for (const auto& [world, load] : core_.loads()) load_.expected += load.coming;
  const double ahead = static_cast<double>(std::max<Step>(0, now - pace.displayed));
  load_.on_time = pace.budget > 0 ? steps_on_time(ahead, pace.budget, load_.work) : 0;
}

// Over the cells where bodies will be, by their present speed; those who will be in others' cells count there.
void Balancer::spread_cost(const std::vector<WorldId>& owners) {
  for (const std::uint32_t cell : costly_) cost_[cell] = 0;
  costly_.clear();
  leaving_.clear();
  const Step seen = core_.front();  // all of it is computed
  double all = 0, moving = 0;
  core_.states(seen).for_each([&](timeline::Slot, const Ref<timeline::Record>& held) {
    const timeline::Record& record = *held;
    if (record.place.owner != me_) return;
    const Vec3 x = record.body.x();
    const auto cell = static_cast<std::uint32_t>(grid_.index(grid_.cell_of(x + foresight_ * record.body.v())));
    const bool moves = record.computed == seen;
    const double share = moves ? 1 + kPerContact * static_cast<double>(record.contacts().size()) : kStill;
    all += share;
    moving += moves;
    if (owners[cell] != me_ && !core_.has_cell(cell)) {
      leaving_[owners[cell]] += share;
      return;
    }
    if (cost_[cell] == 0) costly_.push_back(cell);
    cost_[cell] += share;
  });
  load_.work = per_body_ * moving;
  if (all == 0) return;
  for (const std::uint32_t cell : costly_) cost_[cell] *= load_.work / all;
  for (auto& [world, share] : leaving_) share *= load_.work / all;
}

void Balancer::answer_offers() {
  for (const border::Asked& asked : core_.take_offers()) {
    const border::Offer& offer = asked.offer;
    const auto giver = core_.loads().find(asked.giver);
    const bool accept = !core_.offering() && giver != core_.loads().end() &&
                        may_take(grid_, core_.owners_ahead(), me_, offer.cells, offer.cost, load_, giver->second);
    core_.answer(asked, accept);
    if (!accept) continue;
    promises_.push_back(offer);
    load_.expected += offer.cost;
    policy_.took(core_.clock(), asked.giver, offer.cells);
  }
}

// Whether to look at once for more to give: somebody else may take what was declined, and where time is short, one
// neighbour may not be enough.
bool Balancer::hear_answer(const Pace& pace) {
  if (!proposed_ || core_.offering()) return false;
  const std::uint64_t before = std::exchange(declined_, core_.stats().offers_declined);
  const bool accepted = declined_ == before;
  policy_.answered(core_.clock(), *proposed_, accepted);
  if (accepted) load_.expected -= std::min(load_.expected, proposed_->cost);
  proposed_.reset();
  return !accepted || (pace.budget > 0 && load_.expected > pace.budget);
}

void Balancer::offer(const Pace& pace) {
  const Step now = core_.clock();
  const std::vector<WorldId> owners = core_.owners_ahead();
  mine_.clear();
  for (std::uint32_t cell = 0; cell < owners.size(); ++cell)
    if (owners[cell] == me_ && core_.may_give(cell)) mine_.push_back(cell);
  neighbours_.clear();
  for (const auto& [world, load] : core_.loads())
    if (core_.may_give_to(world)) neighbours_.push_back({world, load});
  const Situation situation{.grid = grid_,
                            .me = me_,
                            .now = now,
                            .owner = owners,
                            .mine = mine_,
                            .cost = cost_,
                            .load = load_,
                            .ahead = static_cast<double>(std::max<Step>(0, now - pace.displayed)),
                            .budget = pace.budget,
                            .neighbours = neighbours_};
  std::optional<Proposal> proposal = policy_.propose(situation);
  if (!proposal || !core_.give(proposal->taker, proposal->cells, proposal->cost)) return;
  proposed_ = std::move(proposal);
  ++offers_;
}

}  // namespace soda::balance
