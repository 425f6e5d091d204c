// The clock that costs are told in.
#pragma once

#include <ctime>

namespace soda {

// CPU time that the calling thread has used, s.
inline double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace soda
