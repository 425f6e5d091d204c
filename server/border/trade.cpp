#include "server/border/trade.h"

#include <algorithm>
#include <utility>

namespace soda::border {

bool Trade::may_give(std::size_t cell) const {
  return territories_.keeps(context_.settings.me, cell, context_.final_step);
}

bool Trade::offer(WorldId taker, std::vector<std::uint32_t> cells, double cost) {
  Link* const link = context_.link_to(taker);
  if (!link || link->since() > context_.final_step || offered_ || cells.empty()) return false;
  if (std::adjacent_find(cells.begin(), cells.end(), std::greater_equal()) != cells.end()) return false;
  for (const std::uint32_t cell : cells)
    if (cell >= territories_.grid().cells() || !may_give(cell)) return false;
  link->add(Offer{++offers_, cost, cells});
  offered_ = Offered{taker, offers_, std::move(cells)};
  ++context_.stats.offers;
  return true;
}

void Trade::answered(const Link& from, const Answer& answer) {
  if (!offered_ || offered_->taker != from.peer() || offered_->number != answer.number) return;  // said again
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
  Transfer transfer{me, territories_.known(me) + 1, context_.final_step + steps_to_transfer(context_.settings.window),
                    offered_->taker, std::move(offered_->cells)};
  offered_.reset();
  return transfer;
}

void Trade::offered(const Link& from, Offer offer) { asked_.push_back({from.peer(), std::move(offer)}); }

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
