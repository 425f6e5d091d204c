// What a neighbour may say, by what is known here: the last of what is checked of messages, after codec.h. All throw
// CodecError.
#pragma once

#include "server/border/context.h"
#include "server/border/message.h"
#include "server/border/territories.h"

namespace soda::border {

// The steps that the next message of a stream names.
void check_steps(const Context& context, const Link& link, const Message& message);
// A body that a neighbour tells of: this world's or a neighbour's, no faster than the scene lets it be.
void check_body(const Context& context, const timeline::Record& record);
// That it can be, and comes in time; one that is known already may be said again.
void check_transfer(const Context& context, const Territories& territories, const Transfer& transfer);

}  // namespace soda::border
