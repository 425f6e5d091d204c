// Tells those who watch what a world has computed: each step as soon as it is whole, and again what a repair has
// changed of it. Only differences are told, which cost what has changed: copies of the timeline's tables are kept of
// what was told last, and share their memory with it.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>

#include "server/border/world_core.h"
#include "server/world/reports.h"

namespace soda::world {

class ViewFeed {
 public:
  using Clock = std::chrono::steady_clock;
  using States = Table<timeline::Record>;

  ViewFeed(std::uint64_t instance, WorldId me, double dt, Reports& reports);

  // A step has become final: it may be released before anybody asks again.
  void finalised(Step step, const border::Produced& produced);
  // Tells what is new, if anybody watches. At most some hundred times a second, unless the world is about to `rest`.
  // False: there is more to tell soon.
  bool report(const border::WorldCore& core, bool rest, Clock::time_point now);

 private:
  bool tell_all(const border::WorldCore& core);
  // `front`: steps up to there are whole when this sample has been taken.
  void tell(std::uint8_t kind, Step step, const States& before, const States& now, Step front,
            const border::WorldCore& core);

  const std::uint64_t instance_;
  const WorldId me_;
  const double dt_;
  Reports& reports_;
  bool anew_ = false;
  bool watched_ = false;
  bool behind_ = false;       // there is more to tell than is told at once
  bool catching_up_ = false;  // since a VIEW_WHOLE
  Clock::duration spent_{};   // on that
  Clock::time_point reported_{}, next_whole_{};
  std::uint64_t number_ = 0;
  std::deque<States> told_;  // of steps first_told_, ...
  Step first_told_ = 0;
  std::deque<States> finals_;  // of steps first_final_, ..., which the core may have released
  Step first_final_ = 0;
  Step front_told_ = -1, final_told_ = -1;
  wire::Transforms sample_;
};

}  // namespace soda::world
