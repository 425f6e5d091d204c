#include "server/world/view_feed.h"

#include <algorithm>
#include <utility>

namespace soda::world {
namespace {

using namespace std::chrono_literals;

constexpr auto kEvery = 4ms;
// Whoever loses samples because there are too many must not make for more, nor take a world's time.
constexpr auto kWholeEvery = 250ms;
constexpr int kWholeShare = 10;  // of the time at most one part in so many
// Steps told at once, or the fourth part of what there is to tell: what a reader misses has to be kept until it has
// asked (topics.cpp: 32 samples).
constexpr Step kAtOnce = 8;

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

ViewFeed::ViewFeed(std::uint64_t instance, WorldId me, double dt, Reports& reports)
    : instance_(instance), me_(me), dt_(dt), reports_(reports) {
  sample_.instance(instance);
  sample_.world(me);
}

void ViewFeed::finalised(Step step, const border::Produced& produced) {
  if (!watched_) return;
  if (finals_.empty()) first_final_ = step;
  finals_.push_back(produced.states());
}

bool ViewFeed::report(const border::WorldCore& core, bool rest, Clock::time_point now) {
  if ((!rest || behind_) && now - reported_ < kEvery) return !behind_;
  reported_ = now;
  watched_ = reports_.wants_transforms();
  if (!watched_) {
    told_.clear();
    finals_.clear();
    behind_ = false;
    return true;
  }
  if (core.clock() < 0) return true;
  anew_ = reports_.take_lack() || anew_;
  if (anew_ && !behind_ && now >= next_whole_) {
    anew_ = false;
    told_.clear();
  }
  const auto began = Clock::now();
  const bool whole = told_.empty();
  if (whole) finals_.clear();
  behind_ = !tell_all(core);
  catching_up_ = catching_up_ || whole;
  if (catching_up_) {
    const auto spent = Clock::now() - began;
    spent_ = whole ? spent : spent_ + spent;
    next_whole_ = now + spent + std::max<Clock::duration>(kWholeEvery, kWholeShare * spent_);
    catching_up_ = behind_;
  }
  return !behind_;
}

bool ViewFeed::tell_all(const border::WorldCore& core) {
  const Step front = core.front();
  const auto states = [&](Step step) -> const States& {
    return step < core.oldest() ? finals_.at(static_cast<std::size_t>(step - first_final_)) : core.states(step);
  };
  if (told_.empty()) {
    first_told_ = core.oldest();
    told_.push_back(core.states(first_told_));
    tell(wire::VIEW_WHOLE, first_told_, States(), told_.back(), first_told_, core);
  }
  Step budget = std::max(kAtOnce, (front - first_told_ - static_cast<Step>(told_.size()) + 1) / 4);
  // What is told of first_told_ is final.
  for (Step step = first_told_ + 1; step <= front; ++step) {
    const auto at = static_cast<std::size_t>(step - first_told_);
    if (at < told_.size()) {
      if (told_[at].same_as(states(step))) continue;
      const States before = std::exchange(told_[at], states(step));
      tell(wire::VIEW_AGAIN, step, before, told_[at], step, core);
    } else if (budget-- > 0) {
      told_.push_back(states(step));
      tell(wire::VIEW_STEP, step, told_[at - 1], told_[at], step, core);
    } else {
      break;
    }
  }
  // Nothing changes in a final step; the newest is what the next one is compared with.
  while (told_.size() > 1 && first_told_ < core.final_step()) {
    told_.pop_front();
    ++first_told_;
  }
  while (!finals_.empty() && first_final_ < first_told_) {
    finals_.pop_front();
    ++first_final_;
  }
  const Step whole = std::min(front, first_told_ + static_cast<Step>(told_.size()) - 1);
  // The end of a repair, one under way, or news of finality, are news, too.
  if (whole != front_told_ || core.final_step() != final_told_)
    tell(wire::VIEW_AGAIN, first_told_, told_.front(), told_.front(), whole, core);
  return whole == front;
}

void ViewFeed::tell(std::uint8_t kind, Step step, const States& before, const States& now, Step front,
                    const border::WorldCore& core) {
  sample_.number(++number_);
  sample_.kind(kind);
  sample_.step(step);
  sample_.time(static_cast<double>(step) * dt_);
  sample_.front(front_told_ = front);
  sample_.final_step(final_told_ = core.final_step());
  sample_.computed(now_ns());
  sample_.ids().clear();
  sample_.positions().clear();
  sample_.orientations().clear();
  sample_.velocities().clear();
  sample_.flags().clear();
  sample_.gone().clear();
  States::for_each_difference(before, now, [&](timeline::Slot slot, const auto* old, const auto* record) {
    if (!record) return sample_.gone().push_back(old->body.id);
    const BodyState& body = record->body;
    sample_.ids().push_back(body.id);
    const auto add = [](auto& to, const double* values, int n) {
      for (int i = 0; i < n; ++i) to.push_back(static_cast<typename std::decay_t<decltype(to)>::value_type>(values[i]));
    };
    add(sample_.positions(), body.position, 3);
    add(sample_.orientations(), body.orientation, 4);
    add(sample_.velocities(), body.linear_velocity, 3);
    add(sample_.velocities(), body.angular_velocity, 3);
    const bool mixed = step >= core.oldest() && core.touches_foreign(step, slot);
    sample_.flags().push_back(static_cast<std::uint8_t>((body.asleep() ? wire::VIEW_ASLEEP : 0) |
                                                        (record->place.inside ? 0 : wire::VIEW_NEAR) |
                                                        (mixed ? wire::VIEW_MIXED : 0)));
  });
  reports_.transforms(sample_);
}

}  // namespace soda::world
