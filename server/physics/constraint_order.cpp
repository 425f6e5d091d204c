#include "server/physics/constraint_order.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

// Blocks are numbered modulo 2^20 along each axis: two that far apart in one island would share their colours, which is
// as canonical.
std::uint64_t block_along(double x) {
  constexpr double kLimit = 1 << 30;
  const double f = std::floor(x);
  const std::int32_t i = f >= kLimit ? 1 << 30 : !(f > -kLimit) ? -(1 << 30) : static_cast<std::int32_t>(f);
  return static_cast<std::uint32_t>(i) & 0xfffffu;
}

constexpr std::uint32_t kColours = 64;  // the last one is shared by whatever finds all others taken

}  // namespace

std::uint64_t ConstraintOrder::block_of(const Vec3& a, const Vec3& b) const {
  for (int grid = 0; grid < kBlockGrids; ++grid) {
    // Scenes like round coordinates: no block ends at the origin, where bodies would change sides by rounding alone.
    constexpr double kOffOrigin = 0.0947;
    const double shift = static_cast<double>(grid) / kBlockGrids + kOffOrigin;
    std::uint64_t packed = static_cast<std::uint64_t>(grid);
    bool same = true;
    for (int axis = 2; axis >= 0; --axis) {
      const std::uint64_t at = block_along(a[axis] * inverse_edge_ + shift);
      same = same && block_along(b[axis] * inverse_edge_ + shift) == at;
      packed = packed << 20 | at;
    }
    if (same) return packed;
  }
  return std::uint64_t{kBlockGrids} << 60;
}

void ConstraintOrder::sort(std::span<std::uint32_t> contacts, std::span<const Ends> ends,
                           std::span<const Vec3> centres) {
  if (contacts.size() < 2) return;
  used_.resize(std::max(used_.size(), centres.size()));
  stamp_.resize(used_.size(), 0);
  keys_.resize(contacts.size());
  bool one_block = true;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const Ends& e = ends[contacts[i]];
    keys_[i] = {block_of(centres[e.a], centres[e.b == kStaticSlot ? e.a : e.b]), contacts[i], 0};
    one_block = one_block && keys_[i].block == keys_[0].block;
  }
  // Records come in canonical order of ids, and their positions keep it.
  if (!one_block)
    std::sort(keys_.begin(), keys_.end(), [](const Key& l, const Key& r) {
      return l.block != r.block ? l.block < r.block : l.contact < r.contact;
    });
  for (std::size_t first = 0; first < keys_.size();) {
    std::size_t end = first + 1;
    while (end < keys_.size() && keys_[end].block == keys_[first].block) ++end;
    colour(std::span(keys_).subspan(first, end - first), ends, contacts.subspan(first, end - first));
    first = end;
  }
}

void ConstraintOrder::colour(std::span<Key> block, std::span<const Ends> ends, std::span<std::uint32_t> contacts) {
  ++block_stamp_;
  const auto used_by = [&](std::uint32_t body) -> std::uint64_t& {
    if (stamp_[body] != block_stamp_) stamp_[body] = block_stamp_, used_[body] = 0;
    return used_[body];
  };
  std::uint32_t place[kColours + 1] = {};
  for (Key& key : block) {
    const Ends& e = ends[key.contact];
    std::uint64_t taken = used_by(e.a);
    if (e.b != kStaticSlot) taken |= used_by(e.b);
    key.colour = std::min(static_cast<std::uint32_t>(std::countr_one(taken)), kColours - 1);
    used_by(e.a) |= std::uint64_t{1} << key.colour;
    if (e.b != kStaticSlot) used_by(e.b) |= std::uint64_t{1} << key.colour;
    ++place[key.colour + 1];
  }
  for (std::uint32_t c = 0; c < kColours; ++c) place[c + 1] += place[c];
  for (const Key& key : block) contacts[place[key.colour]++] = key.contact;
}

}  // namespace soda::physics
