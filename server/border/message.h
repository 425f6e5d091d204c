// What worlds tell each other, as plain values. codec.h turns it into bytes and back.
#pragma once

#include <compare>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "common/actions/action.h"
#include "common/body_set.h"
#include "common/ids.h"
#include "common/load.h"
#include "server/border/territories.h"

namespace soda::border {

// Of what one world says of one step: later ones replace earlier ones.
struct Revision {
  std::uint32_t epoch = 0, count = 0;
  auto operator<=>(const Revision&) const = default;
};

// The bodies that the sender produced at a step and that the receiver owns then (arrivals) or has near. Left out where
// it would say just what the receiver assumes without it: the sleeping bodies of the step before.
struct Frame {
  Step step = 0;
  Revision revision;
  BodySet set;
};

// A foreign body that a component touches.
struct Port {
  BodyId body = 0;
  WorldId owner = 0;
  std::uint64_t record = 0;  // record_hash of the state that the component was found with
};

// Own bodies connected by own contacts, the contacts of all of them (those with ports and static bodies included), as
// found at the step, and the ports. A component without own bodies tells that wide bodies of two others touch here.
struct Component {
  BodySet set;
  std::vector<Port> ports;
};

// The components of a world that touch foreign bodies at a step: all, or those that concern the receiver. Each has
// bodies, where they are not all. Components are shared with whoever else keeps them.
struct Part {
  WorldId origin = 0;
  Step step = 0;
  Revision revision;
  bool whole = true;
  std::vector<std::shared_ptr<const Component>> components;
};

// That part of another world, passed on before, will not change any more.
struct FinalPart {
  WorldId origin = 0;
  Step step = 0;
  Revision revision;
};

// May these cells of the sender, which it keeps otherwise, become the receiver's? One at a time.
struct Offer {
  std::uint32_t number = 0;          // of the sender's offers
  double cost = 0;                   // s of CPU time per step, of what is in them
  std::vector<std::uint32_t> cells;  // by Grid::index, ascending
};
// As the receiver keeps it until it has answered.
struct Asked {
  WorldId giver = 0;
  Offer offer;
};
struct Answer {
  std::uint32_t number = 0;  // of the receiver's offer
  bool accepted = false;     // then the sender counts on it
};

// What the sender of a message wants to know.
enum class Ask : std::uint8_t {
  kNothing,
  kNews,  // how much there is: it has heard nothing for some time
  kAgain  // everything after `ack` once more: something is missing
};

struct Header {
  std::uint64_t session = 0;  // what both ends must agree on: see session_tag
  WorldId from = 0, to = 0;
  std::uint32_t epoch = 0, to_epoch = 0;
  std::uint64_t sequence = 0;  // from 1; 0: outside of the stream, only `ack`, `ask` and `sent` count
  std::uint64_t ack = 0;       // everything up to this number has arrived at the sender
  Ask ask = Ask::kNothing;
  std::uint64_t sent = 0;  // the newest number that the sender has sent
  Step upto = 0;           // the sender's front: all states up to it are computed and told; can fall
  Step final_step = 0;
  Step near_final = 0;      // up to this step the sender's parts will not change any more
  Step durable = 0;         // for checkpoints, later
  ActionNumber logged = 0;  // the sender has acted on the action log up to this number: what it tells may be of bodies
                            // that are spawned there
};

// Everything from one world to another is one numbered stream of these.
struct Message {
  Header header;
  std::vector<Frame> frames;
  std::vector<Part> parts;
  std::vector<FinalPart> finals;
  std::vector<Transfer> transfers;  // that the sender has come to know of, before all that rests on them
  std::vector<Offer> offers;
  std::vector<Answer> answers;
  std::optional<Load> load;

  void clear() {  // but for the header
    frames.clear();
    parts.clear();
    finals.clear();
    transfers.clear();
    offers.clear();
    answers.clear();
    load.reset();
  }
};

}  // namespace soda::border
