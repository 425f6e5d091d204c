// Messages as bytes: little-endian, fixed-width, no padding; records are shipped as they lie in memory, contact records
// with the points in use only. The one door for what comes from other worlds: everything is checked here.
#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <vector>

#include "server/border/message.h"
#include "server/physics/model.h"

namespace soda::border {

constexpr std::uint32_t kCodecVersion = 5;

// What was received is not a message: says which field and why.
struct CodecError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

std::vector<std::byte> encode(const Message& message);
void encode(const Message& message, std::vector<std::byte>& out);  // in place of what is there

// Throws CodecError for anything cut short, too long, out of order, not finite, or about bodies that `model` does not
// have. What it returns can be trusted to be well-formed, not to be true.
Message decode(std::span<const std::byte> bytes, const physics::Model& model);

// The same again and again, into the memory of the message before: what decode() returned before is gone then.
class Decoder {
 public:
  Message& decode(std::span<const std::byte> bytes, const physics::Model& model);

 private:
  Message message_;
  std::vector<BodySet> spare_;  // of frames
};

// The beginning alone: who speaks to whom.
Header decode_header(std::span<const std::byte> bytes);

// Throws CodecError where a well-formed message does not fit a session of that many worlds: unknown owners, contacts
// between bodies that are not there.
void check(const Message& message, WorldId me, WorldId worlds);

// The pieces, for those who store or measure them.
void encode_set(const BodySet& set, std::vector<std::byte>& out);
BodySet decode_set(std::span<const std::byte>& in, const physics::Model& model);

}  // namespace soda::border
