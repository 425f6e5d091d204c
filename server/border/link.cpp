#include "server/border/link.h"

#include <algorithm>
#include <string>
#include <utility>

namespace soda::border {
namespace {

// Messages that a peer may be ahead of what has arrived: far more than windows allow.
constexpr std::uint64_t kFarthest = 1u << 14;
constexpr std::size_t kSpare = 8;  // messages whose memory is kept: more than are on their way, mostly

}  // namespace

Link::Link(std::uint64_t session, WorldId me, std::uint32_t epoch, WorldId peer, std::size_t index)
    : session_(session), me_(me), peer_(peer), index_(index), epoch_(epoch) {}

Header Link::header(std::uint64_t sequence, Ask ask) const {
  Header h;
  h.session = session_;
  h.from = me_;
  h.to = peer_;
  h.epoch = epoch_;
  h.to_epoch = peer_epoch_.value_or(0);
  h.sequence = sequence;
  h.ack = received_;
  h.ask = ask;
  h.sent = sent_;
  h.upto = told_upto_;
  h.final_step = told_final_;
  h.near_final = told_near_final_;
  return h;
}

void Link::send(Step upto, Step final_step, Step near_final, ActionNumber logged,
                std::vector<std::vector<std::byte>>& out) {
  told_upto_ = upto;
  told_final_ = final_step;
  told_near_final_ = near_final;
  ++sent_;
  next_.header = header(sent_, Ask::kNothing);
  next_.header.logged = logged;
  std::vector<std::byte> bytes;
  if (!spare_.empty()) {
    bytes = std::move(spare_.back());
    spare_.pop_back();
  }
  encode(next_, bytes);
  out.push_back(bytes);
  log_.push_back(std::move(bytes));
  next_.clear();
}

void Link::interrupted() {
  repeat_ = true;
  ask_ = Ask::kAgain;
}

void Link::collect(std::vector<std::vector<std::byte>>& out) {
  if (std::exchange(repeat_, false)) {
    out.insert(out.end(), log_.begin(), log_.end());
    resent_ += log_.size();
  }
  const Ask ask = std::exchange(ask_, Ask::kNothing);
  if (!std::exchange(answer_, false) && ask == Ask::kNothing) return;
  if (ask == Ask::kAgain) asked_after_ = received_;
  Message outside;
  outside.header = header(0, ask);
  out.push_back(encode(outside));
}

void Link::receive(Message& message, const std::function<void(Message&)>& deliver) {
  const Header& h = message.header;
  if ((peer_epoch_ && *peer_epoch_ != h.epoch) || (h.sequence > 0 && h.to_epoch != 0 && h.to_epoch != epoch_))
    throw CodecError("border message of another start of world " + std::to_string(h.from) + " or of this one");
  if (h.sequence > received_ + kFarthest)
    throw CodecError("border message " + std::to_string(h.sequence) + " is too far ahead");
  const std::uint64_t logged_before = sent_ - log_.size();
  if (h.ack <= sent_)
    for (std::uint64_t n = logged_before; n < h.ack; ++n) {
      if (spare_.size() < kSpare) spare_.push_back(std::move(log_.front()));
      log_.pop_front();
    }
  if (h.ask == Ask::kAgain) repeat_ = true;
  if (h.ask == Ask::kNews) answer_ = true;
  if (h.sequence == 0) {
    if (h.sent > received_) ask_ = Ask::kAgain;
    return;
  }
  if (h.sequence <= received_ || early_.contains(h.sequence)) {
    ++duplicates_;
    return;
  }
  const auto take = [&](Message& next) {
    deliver(next);  // a message that is refused does not count, and will be asked for again
    ++received_;
    peer_epoch_ = next.header.epoch;
    upto_ = next.header.upto;
    final_ = std::max(final_, next.header.final_step);
    near_final_ = std::max(near_final_, next.header.near_final);
  };
  if (h.sequence == received_ + 1)
    take(message);
  else
    early_.emplace(h.sequence, std::move(message));
  while (!early_.empty() && early_.begin()->first == received_ + 1) {
    Message next = std::move(early_.begin()->second);
    early_.erase(early_.begin());
    take(next);
  }
  if (!early_.empty() && asked_after_ != received_) ask_ = Ask::kAgain;
}

}  // namespace soda::border
