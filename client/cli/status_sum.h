// What the worlds of a session report, added up.
#pragma once

#include <vector>

#include "common/dds/types.h"

namespace soda::cli {

// Of what adds up, the sum; of what is the longest or the newest, the largest; all else is as in no report.
wire::Status sum_of(const std::vector<wire::Status>& worlds);

}  // namespace soda::cli
