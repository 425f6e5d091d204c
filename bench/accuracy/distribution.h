// What distribution adds to the error: nothing, and the numbers that show it.
#pragma once

#include "bench/accuracy/accuracy.h"
#include "bench/harness.h"

namespace soda::bench {

// Runs each variant of the cases at 1/60 s with four sub-steps alone and on so many worlds (whose territories are dealt
// out cell by cell, over a network that loses and reorders), and compares the hashes of every step. Throws where one
// differs.
void compare_worlds(const std::vector<Case>& cases, const std::vector<unsigned>& worlds, Headline& headline);

// Thirty seeds, alone and on eight worlds: equal bits; of bunches of boxes that meet without gravity what momentum and
// energy do where bodies cross borders; of a room full of flying cubes their contacts and speed near borders and
// elsewhere.
void distribution(const Options& options, Headline& headline);

}  // namespace soda::bench
