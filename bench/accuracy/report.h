// What the accuracy suite tells: tables, pictures, headline numbers.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/accuracy/accuracy.h"
#include "bench/harness.h"

namespace soda::bench {

// One line of the final table: a case, or one of its variants.
struct Verdict {
  std::string name;         // "A11", "A11.40"
  std::string description;  // of the whole case; empty for a variant
  struct Side {
    std::optional<Setting> setting;  // the cheapest within the limits, else the one nearest to them
    Outcome outcome;
    bool within = false;  // that setting is within the limits ...
    bool passes = false;  // ... and there are such at all steps at which the case is judged
    std::string beyond;   // which limits the nearest one breaks, and by how much; or at which steps none is within
  } soda, bullet;
};

// The whole case first, then its variants where there are several.
std::vector<Verdict> verdicts(const Case& c, const std::vector<Result>& results);

void print_table(const std::vector<std::pair<const Case*, Verdict>>& verdicts);
void add_headlines(const Case& c, const Verdict& verdict, Headline& headline);
// accuracy_A11.csv, accuracy_A11.svg
void write_case(const Options& options, const Case& c, const std::vector<Result>& results);

std::string text_of(const Setting& setting);  // "1/60 x 4"

}  // namespace soda::bench
