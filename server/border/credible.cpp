#include "server/border/credible.h"

#include <algorithm>
#include <string>

namespace soda::border {

void check_steps(const Context& context, const Link& link, const Message& message) {
  if (link.since() == Neighbourhood::kNever) throw CodecError("border message of what is no neighbour any more");
  // Final steps of neighbours differ by one at most, and nobody computes beyond its window.
  const Step most_final = std::max(context.final_step + 1, link.since());
  const Step horizon = most_final + context.settings.window + 1;
  const auto bounded = [&](Step step, const char* what) {
    if (step < 0 || step > horizon)
      throw CodecError(std::string(what) + ": step " + std::to_string(step) + " cannot be");
  };
  const Header& h = message.header;
  bounded(h.upto, "stream");
  if (h.near_final < -1 || h.near_final > h.final_step || h.final_step > h.upto || h.final_step > most_final)
    throw CodecError("stream: final steps " + std::to_string(h.final_step) + " and " + std::to_string(h.near_final) +
                     " cannot be");
  for (const Frame& frame : message.frames) {
    bounded(frame.step, "frame");
    if (frame.step <= link.final_step())
      throw CodecError("frame: step " + std::to_string(frame.step) + " is final and cannot change");
  }
  for (const Part& part : message.parts) bounded(part.step, "part");
  for (const FinalPart& part : message.finals) bounded(part.step, "final part");
  if (!context.settings.balance && !message.offers.empty())
    throw CodecError("offer: cells do not change hands in this session");
}

void check_body(const Context& context, const timeline::Record& record) {
  const auto name = [&] { return "frame: body " + std::to_string(record.body.id); };  // for a refusal only
  if (record.place.owner != context.settings.me && !context.link_to(record.place.owner))
    throw CodecError(name() + " is of world " + std::to_string(record.place.owner) + ", which is no neighbour");
  constexpr double kRounding = 1 + 1e-9;
  if (!(record.body.v().norm() <= context.model.scene().max_speed * kRounding))
    throw CodecError(name() + " is faster than the scene's largest speed");
}

void check_transfer(const Context& context, const Territories& territories, const Transfer& transfer) {
  const auto fail = [&](const std::string& why) {
    throw CodecError("transfer " + std::to_string(transfer.number) + " of world " + std::to_string(transfer.giver) +
                     ": " + why);
  };
  if (!context.settings.balance) fail("cells do not change hands in this session");
  if (const std::string why = territories.fault(transfer); !why.empty()) fail(why);
  if (transfer.number <= territories.known(transfer.giver)) return;
  if (transfer.giver == context.settings.me) fail("is not of this world");
  if (transfer.step <= context.timeline.newest()) fail("comes too late");
  // Their giver's final step may be beyond this world's by as many steps as there are worlds between.
  if (transfer.step > context.final_step + context.settings.window + 2 * static_cast<Step>(territories.worlds()) + 16)
    fail("is of a step that nobody can have named");
}

}  // namespace soda::border
