// The numbered streams to and from one neighbour: numbering, putting in order, dropping what comes twice, and a log of
// what has not been acknowledged, to be sent again when asked.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "server/border/codec.h"
#include "server/border/message.h"

namespace soda::border {

class Link {
 public:
  // `index`: of the link among this world's.
  Link(std::uint64_t session, WorldId me, std::uint32_t epoch, WorldId peer, std::size_t index);

  WorldId peer() const { return peer_; }
  std::size_t index() const { return index_; }
  // The first step at which the two have to do with each other: of earlier ones nothing is told or expected.
  Step since() const { return since_; }
  void set_since(Step step) { since_ = step; }

  // ---- out
  void add(Frame frame) { next_.frames.push_back(std::move(frame)); }
  void add(Part part) { next_.parts.push_back(std::move(part)); }
  void add(FinalPart part) { next_.finals.push_back(part); }
  void add(Transfer transfer) { next_.transfers.push_back(std::move(transfer)); }
  // Before anything has been sent: all of these, and no others.
  void tell_all(const std::vector<Transfer>& transfers) { next_.transfers = transfers; }
  void add(Offer offer) { next_.offers.push_back(std::move(offer)); }
  void add(Answer answer) { next_.answers.push_back(answer); }
  void add(const Load& load) { next_.load = load; }  // with the next message, which it is no reason for
  bool has_content() const {
    return !next_.frames.empty() || !next_.parts.empty() || !next_.finals.empty() || !next_.transfers.empty() ||
           !next_.offers.empty() || !next_.answers.empty();
  }
  // Nothing is sent before this world has reached the first step that matters; what is added waits.
  bool may_send(Step front) const { return sent_ > 0 || front >= since_; }
  Step told_upto() const { return told_upto_; }
  Step told_final() const { return told_final_; }
  Step told_near_final() const { return told_near_final_; }
  // Closes the next message of the stream and appends it, as bytes, to `out`.
  void send(Step upto, Step final_step, Step near_final, ActionNumber logged, std::vector<std::vector<std::byte>>& out);
  // Asks the peer at the next collect() how much it has sent; and again for all that is missing here, when it answers.
  // (Not at once: it may just be about to send, or have sent what is still on its way.)
  void ask() { ask_ = std::max(ask_, Ask::kNews); }
  // Asks for what is missing without asking whether anything is, and repeats what the peer has not acknowledged.
  void interrupted();
  // Appends questions, answers and repetitions that are due.
  void collect(std::vector<std::vector<std::byte>>& out);

  // ---- in
  // Takes a decoded message from the peer, away where it comes early; hands every message whose turn has come to
  // `deliver`, in order. Throws CodecError for one of another start of the peer, or to another start of this world.
  void receive(Message& message, const std::function<void(Message&)>& deliver);

  // The peer's values, counted: everything said before them has been delivered.
  Step upto() const { return upto_; }
  Step final_step() const { return final_; }
  Step near_final() const { return near_final_; }
  // The peer has reached a step, or is done with it, as far as it matters here.
  bool reached(Step step) const { return step < since_ || upto_ >= step; }
  bool finished(Step step) const { return step < since_ || final_ >= step; }
  std::uint64_t delivered() const { return received_; }  // messages
  std::uint64_t duplicates() const { return duplicates_; }
  std::uint64_t resent() const { return resent_; }

 private:
  Header header(std::uint64_t sequence, Ask ask) const;
  std::uint64_t session_;
  WorldId me_, peer_;
  std::size_t index_;
  Step since_ = 0;
  std::uint32_t epoch_;
  std::optional<std::uint32_t> peer_epoch_;  // once heard of

  Message next_;
  Step told_upto_ = -1, told_final_ = -1, told_near_final_ = -1;
  std::uint64_t sent_ = 0;                     // newest number sent
  std::deque<std::vector<std::byte>> log_;     // messages sent_ - log_.size() + 1 .. sent_
  std::vector<std::vector<std::byte>> spare_;  // memory for messages to come
  bool repeat_ = false, answer_ = false;
  Ask ask_ = Ask::kNothing;

  std::uint64_t received_ = 0;                     // everything up to this number has been delivered
  std::uint64_t asked_after_ = ~std::uint64_t{0};  // the gap after this number has been asked for already
  std::map<std::uint64_t, Message> early_;         // beyond a gap
  Step upto_ = -1, final_ = -1, near_final_ = -1;
  std::uint64_t duplicates_ = 0, resent_ = 0;
};

}  // namespace soda::border
