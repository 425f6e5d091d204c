// Counts what was refused at the door and says so in the log, but not a thousand times.
#pragma once

#include <atomic>
#include <cstdint>
#include <string_view>

namespace soda::dds {

class Refusals {
 public:
  // From any thread. Logged: the first few, then those whose number is a power of two.
  void add(std::string_view where, std::string_view why);
  std::uint64_t count() const { return count_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> count_{0};
};

// Of this process.
Refusals& refusals();

}  // namespace soda::dds
