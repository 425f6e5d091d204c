// Asks for memory that will be written to soon, so that it is on its way while other work goes on.
#pragma once

#include <cstddef>

namespace soda {

inline void prefetch(const void* memory, std::size_t bytes) {
  constexpr std::size_t kCacheLine = 64;
  for (std::size_t at = 0; at < bytes; at += kCacheLine) __builtin_prefetch(static_cast<const char*>(memory) + at, 1);
}

}  // namespace soda
