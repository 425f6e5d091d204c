#include "bench/accuracy/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

namespace soda::bench {
namespace {

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

using OutcomeOf = std::function<const Outcome&(const Result&)>;

std::string broken_limits(const Case& c, const Outcome& outcome) {
  if (!outcome.finite) return "not finite";
  std::string text;
  for (std::size_t m = 0; m < c.measures.size(); ++m) {
    const Measure& measure = c.measures[m];
    if (!(outcome.errors[m] > measure.limit)) continue;
    text += (text.empty() ? "" : ", ") + std::string(measure.name) + " " + short_number(outcome.errors[m]) + " > " +
            short_number(measure.limit);
  }
  return text;
}

// Steps at which the case is judged, was run, and has no setting of that side within the limits.
std::string missed_steps(const Case& c, const std::vector<Result>& results, bool bullet, const OutcomeOf& outcome_of) {
  std::string text;
  for (const double dt : c.judged_at) {
    bool run = false, within = false;
    for (const Result& r : results) {
      if (r.setting.bullet != bullet || r.setting.dt != dt) continue;
      run = true;
      within = within || outcome_of(r).passes(c);
    }
    if (run && !within)
      text += (text.empty() ? "none within the limits at 1/" : ", 1/") + std::to_string(std::lround(1 / dt));
  }
  return text;
}

// Of one side: the cheapest setting within the limits, else the one nearest to them.
Verdict::Side judge(const Case& c, const std::vector<Result>& results, bool bullet, const OutcomeOf& outcome_of) {
  Verdict::Side side;
  double best_score = 0;
  for (const Result& result : results) {
    if (result.setting.bullet != bullet) continue;
    const Outcome& outcome = outcome_of(result);
    const double score = outcome.score(c);
    const bool within = score <= 1;
    bool better = !side.setting || (within && !side.within);
    if (!better && within == side.within) better = within ? outcome.cost_ms < side.outcome.cost_ms : score < best_score;
    if (!better) continue;
    side.setting = result.setting;
    side.outcome = outcome;
    side.within = within;
    best_score = score;
  }
  if (!side.setting) return side;
  side.beyond = side.within ? missed_steps(c, results, bullet, outcome_of) : broken_limits(c, side.outcome);
  side.passes = side.within && side.beyond.empty();
  return side;
}

// The case's main measure, or for a variant without it the first with a limit that it has.
std::size_t shown_measure(const Case& c, const Outcome& outcome) {
  std::size_t m = c.main_measure();
  while (m + 1 < c.measures.size() && (std::isnan(c.measures[m].limit) || std::isnan(outcome.errors[m]))) ++m;
  return m;
}

std::string text_of(const Verdict::Side& side, std::size_t measure) {
  if (!side.setting) return "not run";
  char text[200];
  const double error = side.outcome.errors[measure];
  if (side.within)
    std::snprintf(text, sizeof text, "%8.3g ms/s%c %-10s %9.2g", side.outcome.cost_ms, side.passes ? ' ' : '!',
                  soda::bench::text_of(*side.setting).c_str(), error);
  else
    std::snprintf(text, sizeof text, "   never     %-10s %9.2g", soda::bench::text_of(*side.setting).c_str(), error);
  return text;
}

}  // namespace

std::string text_of(const Setting& setting) {
  const std::string rate = "1/" + std::to_string(std::lround(1 / setting.dt));
  if (setting.bullet) return rate;
  return setting.substeps == 0 ? rate + " chosen" : rate + " x " + std::to_string(setting.substeps);
}

std::vector<Verdict> verdicts(const Case& c, const std::vector<Result>& results) {
  std::vector<Verdict> all;
  const auto add = [&](const std::string& name, const std::string& description, const auto& outcome_of) {
    all.push_back({name, description, judge(c, results, false, outcome_of), judge(c, results, true, outcome_of)});
  };
  add(c.id, c.name, [](const Result& r) -> const Outcome& { return r.all; });
  if (c.variants.size() > 1)
    for (std::size_t v = 0; v < c.variants.size(); ++v)
      add(std::string(c.id) + "." + c.variants[v].name, "",
          [v](const Result& r) -> const Outcome& { return r.variants[v]; });
  return all;
}

void print_table(const std::vector<std::pair<const Case*, Verdict>>& verdicts) {
  std::printf(
      "\nCost at the pass limit: CPU ms per simulated second, setting, error by the measure named.\n"
      "'!': within the limits there, but not at every step at which the case is judged.\n");
  std::printf("%-22s %-19s %8s | %-33s | %-33s | %s\n", "case", "measure", "limit", "SODA (dt x sub-steps)",
              "stock Bullet (dt)", "SODA / Bullet");
  for (const auto& [c, v] : verdicts) {
    if (!v.soda.setting) continue;
    const std::size_t shown = shown_measure(*c, v.soda.outcome);
    std::string ratio = "-";
    if (v.soda.passes && v.bullet.passes)
      ratio = short_number(v.soda.outcome.cost_ms / v.bullet.outcome.cost_ms);
    else if (!v.bullet.passes)
      ratio = "Bullet never passes";
    if (!std::isnan(c->goal_ms)) ratio += " (goal " + short_number(c->goal_ms) + " ms/s)";
    const std::string name = v.description.empty() ? "  " + v.name : v.name + " " + v.description;
    std::printf("%-22s %-19s %8.3g | %-33s | %-33s | %s\n", name.c_str(), c->measures[shown].name,
                c->measures[shown].limit, text_of(v.soda, shown).c_str(), text_of(v.bullet, shown).c_str(),
                ratio.c_str());
  }
  const bool any = std::any_of(verdicts.begin(), verdicts.end(), [](const auto& v) {
    return (!v.second.soda.passes && v.second.soda.setting) || (!v.second.bullet.passes && v.second.bullet.setting);
  });
  std::printf("\nWhat fails:%s\n", any ? "" : " nothing");
  for (const auto& [c, v] : verdicts) {
    if (!v.description.empty() && c->variants.size() > 1) continue;  // its variants tell
    if (!v.soda.passes && v.soda.setting)
      std::printf("  %-14s SODA   %-9s %s\n", v.name.c_str(), text_of(*v.soda.setting).c_str(), v.soda.beyond.c_str());
    if (!v.bullet.passes && v.bullet.setting)
      std::printf("  %-14s Bullet %-9s %s\n", v.name.c_str(), text_of(*v.bullet.setting).c_str(),
                  v.bullet.beyond.c_str());
  }
  std::printf("\n");
}

void add_headlines(const Case& c, const Verdict& verdict, Headline& headline) {
  const auto& [soda, bullet] = std::pair(verdict.soda, verdict.bullet);
  if (!soda.setting) return;
  headline.add(verdict.name + ".pass", soda.passes);
  if (soda.passes) headline.add(verdict.name + ".cost_ms", soda.outcome.cost_ms);
  const double error = soda.outcome.errors[c.main_measure()];
  if (std::isfinite(error)) headline.add(verdict.name + ".error", error);  // JSON has no other numbers
  headline.add(verdict.name + ".bullet_passes", bullet.passes);
  if (bullet.passes) headline.add(verdict.name + ".bullet_cost_ms", bullet.outcome.cost_ms);
  if (soda.passes && bullet.passes)
    headline.add(verdict.name + ".cost_over_bullet", soda.outcome.cost_ms / bullet.outcome.cost_ms);
}

namespace {

constexpr const char* kColours[] = {"#5c9ead", "#3d7ea6", "#6a994e", "#e9b44c", "#d1603d", "#8e6c8a", "#7f8c8d"};

// One curve: its line, then its points within the limits (full) and beyond (hollow). Data stand in the script itself.
struct Curve {
  std::string title, colour;
  std::vector<const Result*> points;
};

void write_curve(const Case& c, const Curve& curve, std::size_t number, double floor, std::ostream& data,
                 std::ostream& plots) {
  const std::size_t m = c.main_measure();
  const auto block = [&](const char* kind, const auto& wanted) {
    data << "$" << kind << number << " << EOD\n";
    bool any = false;
    for (const Result* r : curve.points) {
      const double error = r->all.errors[m];
      if (!wanted(*r) || !std::isfinite(error)) continue;
      data << r->all.cost_ms << ',' << std::max(error, floor) << '\n';
      any = true;
    }
    data << "EOD\n";
    return any;
  };
  if (block("line", [](const Result&) { return true; }))
    plots << "$line" << number << " with lines lw 2 lc rgb '" << curve.colour << "' title '" << curve.title << "', ";
  if (block("good", [&](const Result& r) { return r.all.passes(c); }))
    plots << "$good" << number << " with points pt 7 ps .8 lc rgb '" << curve.colour << "' notitle, ";
  if (block("bad", [&](const Result& r) { return !r.all.passes(c); }))
    plots << "$bad" << number << " with points pt 6 ps .8 lc rgb '" << curve.colour << "' notitle, ";
}

void draw(const Options& options, const Case& c, const std::vector<Result>& results) {
  const Measure& main = c.measures[c.main_measure()];
  std::vector<Curve> curves = {{"stock Bullet", "#909090", {}}};
  for (std::size_t i = 0; i < c.substeps.size(); ++i)
    curves.push_back({c.substeps[i] == 0 ? "SODA, sub-steps chosen by island"
                                         : "SODA, " + std::to_string(c.substeps[i]) + " sub-steps",
                      kColours[i % std::size(kColours)],
                      {}});
  double least = main.limit;  // a logarithmic axis knows no 0: those lie at its foot
  for (const Result& r : results) {
    const auto n = std::find(c.substeps.begin(), c.substeps.end(), r.setting.substeps) - c.substeps.begin();
    curves[r.setting.bullet ? 0 : static_cast<std::size_t>(n) + 1].points.push_back(&r);
    const double error = r.all.errors[c.main_measure()];
    if (error > 0) least = std::min(least, error);
  }
  std::ostringstream data, plots;
  for (std::size_t i = 0; i < curves.size(); ++i) write_curve(c, curves[i], i, 0.5 * least, data, plots);
  std::ostringstream script;
  script << data.str() << "set logscale xy\nset grid\nset key outside right top\nset format y '%.0e'\n"
         << "set xlabel 'CPU time (ms per simulated second)'\nset ylabel '" << main.what << "' noenhanced\n"
         << "set title '" << c.id << " " << c.name << ": full points pass, hollow ones break a limit'\n"
         << "plot " << plots.str() << main.limit << " with lines dt 2 lw 1.5 lc rgb '#c02020' title 'limit'\n";
  plot(options, std::string("accuracy_") + c.id, script.str(), 820, 460);
}

}  // namespace

void write_case(const Options& options, const Case& c, const std::vector<Result>& results) {
  std::string header = "side,dt_s,substeps,variant,cost_ms_per_s,pass";
  for (const Measure& measure : c.measures) header += std::string(",") + measure.name;
  Csv table(options, std::string("accuracy_") + c.id, header);
  const auto row = [&](const Result& r, const std::string& variant, const Outcome& outcome) {
    std::ostringstream errors;
    for (const double e : outcome.errors) {
      errors << ',';
      if (!std::isnan(e)) errors << e;
    }
    table.row(r.setting.bullet ? "bullet" : "soda", r.setting.dt, r.setting.substeps, variant, outcome.cost_ms,
              std::to_string(outcome.passes(c)) + errors.str());
  };
  for (const Result& r : results) {
    row(r, "all", r.all);
    if (c.variants.size() > 1)
      for (std::size_t v = 0; v < c.variants.size(); ++v) row(r, c.variants[v].name, r.variants[v]);
  }
  table.close();
  draw(options, c, results);
}

}  // namespace soda::bench
