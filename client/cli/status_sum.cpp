#include "client/cli/status_sum.h"

#include <algorithm>

namespace soda::cli {

wire::Status sum_of(const std::vector<wire::Status>& worlds) {
  wire::Status sum;
  for (const wire::Status& s : worlds) {
    sum.bodies() += s.bodies(), sum.cells() += s.cells(), sum.steps() += s.steps(), sum.syncs() += s.syncs();
    sum.mixed_islands() += s.mixed_islands(), sum.arrived() += s.arrived(), sum.departed() += s.departed();
    sum.wide_bodies() += s.wide_bodies(), sum.messages_sent() += s.messages_sent(), sum.bytes_sent() += s.bytes_sent();
    sum.frames_sent() += s.frames_sent(), sum.frame_bodies_sent() += s.frame_bodies_sent();
    sum.parts_sent() += s.parts_sent(), sum.messages_resent() += s.messages_resent();
    sum.duplicates() += s.duplicates(), sum.refused() += s.refused(), sum.clamped() += s.clamped();
    sum.non_finite() += s.non_finite(), sum.interruptions() += s.interruptions();
    sum.logged() = std::max(sum.logged(), s.logged()), sum.held_back() += s.held_back();
    sum.anticipated() += s.anticipated(), sum.bodies_computed() += s.bodies_computed();
    sum.bodies_redone() += s.bodies_redone(), sum.rollbacks() += s.rollbacks();
    sum.longest_rollback() = std::max(sum.longest_rollback(), s.longest_rollback());
    sum.work_seconds() += s.work_seconds(), sum.waiting_seconds() += s.waiting_seconds();
    sum.paced_seconds() += s.paced_seconds(), sum.cpu_seconds() += s.cpu_seconds();
    sum.peak_memory() += s.peak_memory();
    sum.transfers() += s.transfers(), sum.cells_given() += s.cells_given();
    for (std::size_t k = 0; k < s.shares().size(); ++k) {
      wire::ModelShare& share = sum.shares()[k];
      share.islands() += s.shares()[k].islands(), share.bodies() += s.shares()[k].bodies();
      share.contacts() += s.shares()[k].contacts(), share.seconds() += s.shares()[k].seconds();
    }
    sum.joints_together() += s.joints_together(), sum.joints_alone() += s.joints_alone();
    sum.turning_flights() += s.turning_flights(), sum.bouncing() += s.bouncing();
  }
  return sum;
}

}  // namespace soda::cli
