// Up to which step no action comes any more. News of that may overtake the actions that they count.
#pragma once

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "common/ids.h"

namespace soda::border {

class Closings {
 public:
  // Without `actions` none ever comes.
  explicit Closings(bool actions) : closed_(actions ? 0 : std::numeric_limits<Step>::max()) {}

  Step closed() const { return closed_; }

  // No action for steps up to `step` comes after the first `logged` ones.
  void add(Step step, ActionNumber logged) {
    if (waiting_.empty() || waiting_.back().second != logged) waiting_.emplace_back(0, logged);
    waiting_.back().first = std::max(waiting_.back().first, step);
  }

  // So many actions are known now. Whether closed() has grown.
  bool release(ActionNumber logged) {
    const Step before = closed_;
    std::erase_if(waiting_, [&](const auto& closing) {
      if (closing.second > logged) return false;
      closed_ = std::max(closed_, closing.first);
      return true;
    });
    return closed_ != before;
  }

 private:
  Step closed_;
  std::vector<std::pair<Step, ActionNumber>> waiting_;  // for actions that have not come yet
};

}  // namespace soda::border
