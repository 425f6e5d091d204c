// How cells change hands while a session runs, without anybody in the middle.
//
// A giver offers cells of its own to a neighbour, one offer at a time, and keeps them until that one has answered. What
// has been accepted becomes a transfer at step T, which the giver tells all its neighbours within the streams, and they
// theirs. Nobody has to answer, for news of a transfer travel ahead of what is final: a world's state t + 1 is final
// only when it has heard that its neighbours' states t are, and in a stream the transfer comes before whatever becomes
// final after it. So a world h neighbours away knows it before its own final step is beyond F + h, with F the giver's
// when it was told, and before its clock, which is at most K beyond that, is beyond F + h + K. With
//   T = F + K + H + 2,   H the most neighbours from any world to any other (Neighbourhood::hops)
// nobody has computed state T yet. Links are never given up, so that H, by the initial territories, stays a bound.
//
// The same holds for worlds that become neighbours at T: when one of them, having reached T, first speaks to the other,
// that one's final step is at least F + H + 2 - d, with d neighbours between the two, and it knows the transfer from
// F + h + 1 on. All three are near the same cells, so that d + h is at most 7; with H at least 6 or, where that is
// less, twice the most neighbours between any two, it is at most H + 1.
//
// News of two transfers of which one rests on the other cannot come in the wrong order: who made the second knew the
// first, and told it first.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "server/border/context.h"
#include "server/border/message.h"
#include "server/border/territories.h"

namespace soda::border {

class Trade {
 public:
  Trade(const Context& context, const Territories& territories) : context_(context), territories_(territories) {}

  // ---- to give
  // Whether this world has the cell, and keeps it, by all that is known.
  bool may_give(std::size_t cell) const;
  // Whether a world is a neighbour at the final step.
  bool may_give_to(WorldId taker) const;
  // How much later than the final step a transfer is that is told now.
  Step steps_to_transfer() const { return context_.settings.window + context_.neighbourhood.hops() + 2; }
  // Offers cells, ascending, to a neighbour. False, and nothing has happened: some may not be given, `taker` is no
  // neighbour yet, something is being offered already, or the run ends before.
  bool offer(WorldId taker, std::vector<std::uint32_t> cells, double cost);
  // Something has been offered, and is not a transfer yet. (Several transfers may be on their way.)
  bool offering() const { return offered_.has_value(); }
  void answered(const Link& from, const Answer& answer);
  // What has been accepted, as a transfer that is to be told before anything else becomes final.
  std::optional<Transfer> agreed();

  // ---- to take
  // Throws CodecError for cells that are not the giver's. Of one giver the newest offer counts.
  void offered(const Link& from, Offer offer);
  std::vector<Asked> take_offers() { return std::exchange(asked_, {}); }
  void answer(const Asked& asked, bool accept);

  // A transfer has become known.
  void learnt(const Transfer& transfer);
  // Owners after all that is known, and after what this world has been promised.
  std::vector<WorldId> owners_ahead() const;

 private:
  struct Offered {
    WorldId taker = 0;
    Offer offer;
    bool accepted = false;
  };
  const Context& context_;
  const Territories& territories_;
  std::optional<Offered> offered_;
  std::uint32_t offers_ = 0;
  std::vector<Asked> asked_;     // not answered yet
  std::vector<Asked> promised_;  // accepted, and not known as a transfer yet
};

}  // namespace soda::border
