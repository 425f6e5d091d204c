#include "server/balance/balancer.h"

#include <algorithm>
#include <cmath>

#include "common/anticipation.h"

namespace soda::balance {
namespace {

// What a body costs, against one that lies awake without contacts.
constexpr double kPerContact = 0.5, kAsleep = 0.02;
constexpr double kNewest = 0.5;  // weight of the newest measurement in the mean

double weight(const timeline::Record& record) {
  return record.body.asleep() ? kAsleep : 1 + kPerContact * static_cast<double>(record.contacts().size());
}

}  // namespace

Balancer::Balancer(border::WorldCore& core, const Grid& grid, WorldId me, Step window, bool gives)
    : core_(core),
      grid_(grid),
      me_(me),
      window_(window),
      gives_(gives),
      policy_([&] {
        Settings settings;
        settings.transfer_steps = static_cast<double>(border::steps_to_transfer(window));
        return settings;
      }()),
      cost_(grid.cells(), 0) {}

void Balancer::consider(const Pace& pace) {
  answer_offers();
  if (core_.clock() < measured_at_ + kEvery) return;
  measure(pace);
  core_.tell_load(load_);
  if (gives_) offer(pace);
}

// The mean work of a step, spread over cells by what is in them.
void Balancer::measure(const Pace& pace) {
  const Step now = core_.clock();
  const double work = since_ / static_cast<double>(now - measured_at_);
  load_.work = measured_at_ == 0 ? work : (1 - kNewest) * load_.work + kNewest * work;
  since_ = 0;
  measured_at_ = now;

  for (const std::uint32_t cell : costly_) cost_[cell] = 0;
  costly_.clear();
  double all = 0;
  core_.states(now).for_each([&](timeline::Slot, const Ref<timeline::Record>& held) {
    const timeline::Record& record = *held;
    if (record.place.owner != me_) return;
    const auto cell = static_cast<std::uint32_t>(grid_.index(grid_.cell_of(record.body.x())));
    if (cost_[cell] == 0) costly_.push_back(cell);
    const double share = weight(record);
    cost_[cell] += share;
    all += share;
  });
  for (const std::uint32_t cell : costly_) cost_[cell] *= load_.work / all;

  const std::vector<WorldId> owners = core_.owners_ahead();
  load_.expected = 0;
  for (const std::uint32_t cell : costly_)
    if (owners[cell] == me_) load_.expected += cost_[cell];
  std::erase_if(promises_, [&](const Promise& p) {
    return std::all_of(p.cells.begin(), p.cells.end(), [&](std::uint32_t cell) { return core_.has_cell(cell); });
  });
  for (const Promise& p : promises_) load_.expected += p.cost;
  const double ahead = static_cast<double>(std::max<Step>(0, now - pace.displayed));
  load_.on_time = pace.budget > 0 ? steps_on_time(ahead, pace.budget, load_.work) : 0;
}

double Balancer::cost_of(std::span<const std::uint32_t> cells) const {
  double sum = 0;
  for (const std::uint32_t cell : cells) sum += cost_[cell];
  return sum;
}

void Balancer::answer_offers() {
  for (const border::Asked& asked : core_.take_offers()) {
    const auto giver = core_.loads().find(asked.giver);
    const bool accept =
        !core_.giving() && giver != core_.loads().end() &&
        may_take(grid_, core_.owners_ahead(), me_, asked.offer.cells, asked.offer.cost, load_, giver->second);
    core_.answer(asked, accept);
    if (!accept) continue;
    promises_.push_back({asked.offer.cells, asked.offer.cost});
    load_.expected += asked.offer.cost;
    policy_.took(core_.clock(), asked.giver, asked.offer.cells);
  }
}

void Balancer::offer(const Pace& pace) {
  const Step now = core_.clock();
  if (core_.offering()) return;
  if (proposed_) {
    const bool declined = core_.stats().offers_declined > declined_;
    declined_ = core_.stats().offers_declined;
    policy_.answered(now, *proposed_, !declined);
    proposed_.reset();
  }
  if (core_.giving()) return;
  const std::vector<WorldId> owners = core_.owners_ahead();
  mine_.clear();
  for (std::uint32_t cell = 0; cell < owners.size(); ++cell)
    if (owners[cell] == me_ && core_.may_give(cell)) mine_.push_back(cell);
  neighbours_.clear();
  for (const auto& [world, load] : core_.loads()) neighbours_.push_back({world, load});
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
  if (proposal && core_.give(proposal->taker, proposal->cells, proposal->cost)) proposed_ = std::move(proposal);
}

}  // namespace soda::balance
