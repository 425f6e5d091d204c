// soda-bench accuracy: every case of the suite with many settings of the step, and with stock Bullet beside it.
#include "bench/accuracy/accuracy.h"

#include <algorithm>
#include <cstdio>
#include <stdexcept>

#include "bench/accuracy/distribution.h"
#include "bench/accuracy/report.h"
#include "bench/commands.h"

namespace soda::bench {
namespace {

constexpr double kSteps[] = {1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 1000};  // s

std::vector<Case> chosen_cases(const std::vector<std::string>& ids) {
  std::vector<Case> all = all_cases();
  if (ids.empty()) return all;
  std::string known;
  for (const Case& c : all) known += std::string(known.empty() ? "" : ", ") + c.id;
  for (const std::string& id : ids)
    if (std::none_of(all.begin(), all.end(), [&](const Case& c) { return id == c.id; }))
      throw std::invalid_argument("there is no case '" + id + "'; known are " + known);
  std::erase_if(all, [&](const Case& c) { return std::find(ids.begin(), ids.end(), c.id) == ids.end(); });
  return all;
}

// Both sides take turns, for each length of the step.
std::vector<Setting> settings_of(const Case& c, bool quick) {
  std::vector<Setting> settings;
  for (const double dt : kSteps) {
    if (quick && dt != 1.0 / 60) continue;
    if (dt >= c.smallest_dt_bullet) settings.push_back({true, dt, 0});
    for (const std::uint32_t n : c.substeps)
      if (n / dt <= c.most_substeps * 1.001 && (!quick || n == 0 || n == 4 || n == 16 || c.substeps.size() == 1))
        settings.push_back({false, dt, n});
  }
  return settings;
}

}  // namespace

void accuracy(const Options& options, Headline& headline) {
  if (options.distribution) return distribution(options, headline);
  const std::vector<Case> cases = chosen_cases(options.cases);
  if (!options.worlds.empty()) return compare_worlds(cases, options.worlds, headline);
  std::vector<std::pair<const Case*, Verdict>> table;
  for (const Case& c : cases) {
    const double start = cpu_seconds();
    std::vector<Result> results;
    for (const Setting& setting : settings_of(c, options.quick)) results.push_back(run(c, setting));
    write_case(options, c, results);
    const auto verdicts_of_case = verdicts(c, results);
    const Verdict& whole = verdicts_of_case.front();
    std::printf("%-4s %-18s %s (%zu settings, %.1f s of CPU time)\n", c.id, c.name,
                whole.soda.passes ? "passes" : ("FAILS: " + whole.soda.beyond).c_str(), results.size(),
                cpu_seconds() - start);
    std::fflush(stdout);
    for (const Verdict& v : verdicts_of_case) {
      table.emplace_back(&c, v);
      add_headlines(c, v, headline);
    }
  }
  print_table(table);
}

}  // namespace soda::bench
