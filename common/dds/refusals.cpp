#include "common/dds/refusals.h"

#include <spdlog/spdlog.h>

#include <bit>

namespace soda::dds {

void Refusals::add(std::string_view where, std::string_view why) {
  constexpr std::uint64_t kLogAll = 8;
  const std::uint64_t n = count_.fetch_add(1, std::memory_order_relaxed) + 1;
  if (n <= kLogAll || std::has_single_bit(n)) spdlog::warn("refused a sample from {}: {} (refusal {})", where, why, n);
}

Refusals& refusals() {
  static Refusals all;
  return all;
}

}  // namespace soda::dds
