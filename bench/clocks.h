// The clock that costs are told in.
#pragma once

#include <ctime>

namespace soda::bench {

inline double cpu_seconds() {  // of this thread
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace soda::bench
