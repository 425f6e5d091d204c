// Words in which a run is described on command lines, for `soda` and `soda-world` alike. All throw
// std::invalid_argument with a message for people.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "common/ids.h"

namespace soda {

constexpr Step kDefaultSteps = 600;  // 10 s at 60 Hz
constexpr Step kDefaultWindow = 48;  // K, as in the paper: steps beyond the final one that a world may compute
constexpr Step kLargestWindow = 4096;
// Input lead: steps after the displayed one that are closed for actions; one of now is for the first that is open.
constexpr Step kDefaultLead = 4;
constexpr Step kLargestLead = 4096;

// How worlds keep in step; the numbers go over the network (Session.sync).
enum class SyncMode : unsigned char {
  kSingle = 0,        // one world, no network: the reference
  kConservative = 1,  // nothing is assumed about neighbours
  kAnticipative = 2,  // worlds run ahead under assumptions, and repair
};
const std::vector<std::string>& sync_names();      // by number
const std::string& sync_name(unsigned char mode);  // "unknown" beyond them
SyncMode parse_sync(const std::string& name);

constexpr double kLargestPace = 1e6;  // multiple of real time

// "realtime": 1; "max": 0 (as fast as possible); else a multiple of real time.
double parse_pace(const std::string& text);

// "A" or "A:B", 0 <= A <= B.
std::pair<Step, Step> parse_steps(const std::string& text);

// "0,2,5", "0-3", "none": worlds, ascending.
std::vector<WorldId> parse_worlds(const std::string& text);

}  // namespace soda
