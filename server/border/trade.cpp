#include "server/border/trade.h"

#include <algorithm>
#include <string>
#include <utility>

namespace soda::border {

bool Trade::may_give(std::size_t cell) const {
  return territories_.keeps(context_.settings.me, cell, context_.final_step);
}

bool Trade::may_give_to(WorldId taker) const {
  const Link* const link = context_.link_to(taker);
  return link && link->since() <= context_.final_step;
}

bool Trade::offer(WorldId taker, std::vector<std::uint32_t> cells, double cost) {
  if (!may_give_to(taker) || offered_ || cells.empty()) return false;
  if (context_.final_step + steps_to_transfer() > context_.settings.last_step) return false;
  if (std::adjacent_find(cells.begin(), cells.end(), std::greater_equal()) != cells.end()) return false;
  for (const std::uint32_t cell : cells)
    if (cell >= territories_.grid().cells() || !may_give(cell)) return false;
  offered_ = Offered{taker, {++offers_, cost, std::move(cells)}};
  context_.link_to(taker)->add(offered_->offer);
  ++context_.stats.offers;
  return true;
}

void Trade::answered(const Link& from, const Answer& answer) {
  if (!offered_ || offered_->taker != from.peer() || offered_->offer.number != answer.number) return;  // said again
  if (answer.accepted) {
    offered_->accepted = true;
  } else {
    offered_.reset();
    ++context_.stats.offers_declined;
  }
}

std::optional<Transfer> Trade::agreed() {
  if (!offered_ || !offered_->accepted) return std::nullopt;
  const WorldId me = context_.settings.me;
  Transfer transfer{me, territories_.known(me) + 1, context_.final_step + steps_to_transfer(), offered_->taker,
                    std::move(offered_->offer.cells)};
  offered_.reset();
  return transfer;
}

void Trade::offered(const Link& from, Offer offer) {
  // Whoever gave it those that it has, told of that first.
  for (const std::uint32_t cell : offer.cells)
    if (cell >= territories_.grid().cells() || territories_.newest()[cell] != from.peer())
      throw CodecError("offer: cell " + std::to_string(cell) + " is not world " + std::to_string(from.peer()) + "'s");
  std::erase_if(asked_, [&](const Asked& asked) { return asked.giver == from.peer(); });
  asked_.push_back({from.peer(), std::move(offer)});
}

void Trade::answer(const Asked& asked, bool accept) {
  Link* const link = context_.link_to(asked.giver);
  if (!link) return;
  link->add(Answer{asked.offer.number, accept});
  if (accept) promised_.push_back(asked);
}

void Trade::learnt(const Transfer& transfer) {
  if (transfer.taker != context_.settings.me) return;
  std::erase_if(promised_,
                [&](const Asked& a) { return a.giver == transfer.giver && a.offer.cells == transfer.cells; });
}

std::vector<WorldId> Trade::owners_ahead() const {
  std::vector<WorldId> owners = territories_.newest();
  for (const Asked& promise : promised_)
    for (const std::uint32_t cell : promise.offer.cells) owners[cell] = context_.settings.me;
  return owners;
}

}  // namespace soda::border
