// Two worlds whose machines are slow in turn: what anticipation is for. Part of `soda-bench latency`.
#pragma once

#include "bench/harness.h"

namespace soda::bench {

void load_peaks(const Options& options, Headline& headline);

}  // namespace soda::bench
