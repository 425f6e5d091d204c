// The commands of soda-bench, one file each.
#pragma once

#include "bench/harness.h"

namespace soda::bench {

void step(const Options& options, Headline& headline);      // our step against stock Bullet
void worlds(const Options& options, Headline& headline);    // one world against two
void response(const Options& options, Headline& headline);  // from a push until it shows
void rollback(const Options& options, Headline& headline);  // repairing, computing ahead, and the window's memory
void viewer(const Options& options, Headline& headline);    // what watching costs
void latency(const Options& options, Headline& headline);   // what users notice
void accuracy(const Options& options, Headline& headline);  // errors against cost, beside stock Bullet

void sync_groups(const Options& options, Headline& headline);  // worlds that hang together, by the number of bodies
void granularity(const Options& options, Headline& headline);  // the same, by the number of worlds
void resilience(const Options& options, Headline& headline);   // steps on time after the load has grown
void worst_case(const Options& options, Headline& headline);   // one island that reaches through all worlds
void scaling(const Options& options, Headline& headline);      // speed-up and efficiency on 1 to 1,024 worlds

}  // namespace soda::bench
