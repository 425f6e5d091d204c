#include "client/cli/explanation.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cstdio>
#include <string>

#include "client/cli/status_sum.h"

namespace soda::cli {

void print_explanation(const Collector& collector, std::uint32_t substeps) {
  if (!collector.session()) return;
  const double steps = static_cast<double>(std::max<Step>(1, collector.whole_steps() - 1));
  const wire::Status sum = sum_of(collector.worlds());
  const double work = sum.work_seconds();
  double seconds = 0;
  for (const wire::ModelShare& share : sum.shares()) seconds += share.seconds();
  std::string text =
      "\nHow the scene was modelled, per step (what was done again counts again; sleeping bodies do not):\n";
  text +=
      fmt::format("  {:<34}{:>10}{:>10}{:>10}{:>12}{:>8}\n", "", "islands", "bodies", "contacts*", "CPU us", "share");
  std::uint64_t islands = 0;
  for (std::size_t k = 0; k < sum.shares().size(); ++k) {
    const wire::ModelShare& share = sum.shares()[k];
    if (static_cast<double>(share.islands()) < 0.05 * steps && 1000 * share.seconds() < seconds) continue;  // a trace
    islands += share.islands();
    const std::string name = k == 0 ? "touching nothing: exact flight"
                             : substeps != 0
                                 ? fmt::format("solved in {} sub-step{}", substeps, substeps == 1 ? "" : "s")
                             : k == 1 ? "solved in 1 sub-step"
                                      : fmt::format("solved in {} sub-steps", 1u << (k - 1));
    text += fmt::format("  {:<34}{:>10.1f}{:>10.1f}{:>10.1f}{:>12.1f}{:>7.1f}%\n", name,
                        static_cast<double>(share.islands()) / steps, static_cast<double>(share.bodies()) / steps,
                        static_cast<double>(share.contacts()) / steps, 1e6 * share.seconds() / steps,
                        seconds > 0 ? 100 * share.seconds() / seconds : 0.0);
  }
  if (islands == 0) text += "  nothing moved\n";
  const auto line = [&](const char* what, std::uint64_t count) {
    if (count > 0) text += fmt::format("  {:<34}{:>10.1f}\n", what, static_cast<double>(count) / steps);
  };
  line("flights with gyroscopic terms", sum.turning_flights());
  line("contacts that bounce", sum.bouncing());
  line("joints solved as a whole", sum.joints_together());
  line("joints solved by themselves", sum.joints_alone());
  text += fmt::format(
      "  * joints included. Solving, of which these are the shares, took {:.0f} us per step of {:.0f} us of work;\n"
      "  the rest finds contacts, keeps states and talks to other worlds.\n",
      1e6 * seconds / steps, 1e6 * work / steps);
  text +=
      substeps != 0
          ? "The scene fixes the sub-steps (model { substeps }); left out, they are chosen for each island by its "
            "state.\n"
          : "Sub-steps are chosen for each island by its state, unless the scene fixes them: model { substeps: 4 }.\n";
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

}  // namespace soda::cli
