#include <algorithm>

#include "bench/accuracy/accuracy.h"

namespace soda::bench {

std::vector<Case> all_cases() {
  std::vector<Case> all;
  for (const auto theme :
       {free_cases, bounce_cases, friction_cases, stack_cases, masonry_cases, heap_cases, far_cases, joint_cases})
    for (Case& c : theme()) all.push_back(std::move(c));
  const auto number = [](const Case& c) { return std::stoi(c.id + 1); };
  std::sort(all.begin(), all.end(), [&](const Case& l, const Case& r) { return number(l) < number(r); });
  return all;
}

}  // namespace soda::bench
