// What `soda run --explain` tells: how the bodies of a run were modelled, how many, and what that cost.
#pragma once

#include "client/cli/collector.h"

namespace soda::cli {

// To standard output, as a table; sums over all worlds, per step of the run. Nothing where no world was heard of.
// `substeps`: that the scene fixes; 0: none.
void print_explanation(const Collector& collector, std::uint32_t substeps);

}  // namespace soda::cli
