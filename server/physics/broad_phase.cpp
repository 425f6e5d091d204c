#include "server/physics/broad_phase.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace soda::physics {
namespace {

std::int32_t cell_along(double x, double inverse_cell) {
  // Far out (or not finite) everything shares the last cell: slower there, never wrong.
  constexpr double kLimit = 1 << 30;
  const double f = std::floor(x * inverse_cell);
  return f >= kLimit ? 1 << 30 : !(f > -kLimit) ? -(1 << 30) : static_cast<std::int32_t>(f);
}

// A row is the line of cells of one (y, z); cells next to each other in a row lie in buckets next to each other.
std::uint64_t row_hash(std::int32_t y, std::int32_t z) {
  return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(y)) * 0x9e3779b97f4a7c15ull) ^
         (static_cast<std::uint64_t>(static_cast<std::uint32_t>(z)) * 0xc2b2ae3d27d4eb4full);
}

std::uint64_t mix(std::uint64_t h) {
  h ^= h >> 29;
  h *= 0xbf58476d1ce4e5b9ull;
  return h ^ (h >> 32);
}

bool wanted(std::uint8_t a, std::uint8_t b) {
  return ((a | b) & kRoleAwake) != 0 && (((a | b) & kRoleWanted) != 0 || (a & b & kRoleWide) != 0);
}

}  // namespace

BroadPhase::Rounded BroadPhase::rounded(const Aabb& box) {
  Rounded result{};
  for (int axis = 0; axis < 3; ++axis) {
    result.min[axis] = static_cast<float>(box.min[axis]);
    result.max[axis] = static_cast<float>(box.max[axis]);
  }
  return result;
}

bool BroadPhase::may_overlap(const Rounded& l, const Rounded& r) {
  const auto apart = (l.min > r.max) | (r.min > l.max);  // neither is it where one is not a number
  using Halves = long long __attribute__((vector_size(sizeof apart)));
  const auto halves = reinterpret_cast<Halves>(apart);
  return (halves[0] | halves[1]) == 0;
}

void BroadPhase::find(std::span<const Aabb> boxes, std::span<const std::uint8_t> roles, double cell, Pairs& pairs) {
  const std::size_t n = boxes.size();
  found_.clear();
  large_.clear();
  const double inverse = 1 / cell;
  const std::size_t table = std::bit_ceil(std::max<std::size_t>(16, 2 * n));
  const std::uint64_t mask = table - 1;

  // Counting sort of the bodies' centres by bucket.
  buckets_.assign(table + 1, 0);
  bucket_of_.resize(n);
  constexpr std::uint32_t kLarge = 0xffffffffu;
  const auto bucket = [&](std::int32_t x, std::int32_t y, std::int32_t z) {
    return (mix(row_hash(y, z)) + static_cast<std::uint32_t>(x)) & mask;
  };
  struct At {
    std::int32_t x, y, z;
  };
  const auto centre_cell = [&](const Aabb& b) {
    return At{cell_along(0.5 * (b.min.x() + b.max.x()), inverse), cell_along(0.5 * (b.min.y() + b.max.y()), inverse),
              cell_along(0.5 * (b.min.z() + b.max.z()), inverse)};
  };
  for (std::size_t i = 0; i < n; ++i) {
    const Aabb& b = boxes[i];
    if (!((b.max - b.min).maxCoeff() <= cell)) {  // also where it is not a number
      bucket_of_[i] = kLarge;
      large_.push_back(static_cast<std::uint32_t>(i));
      continue;
    }
    const At c = centre_cell(b);
    bucket_of_[i] = static_cast<std::uint32_t>(bucket(c.x, c.y, c.z));
    ++buckets_[bucket_of_[i] + 1];
  }
  for (std::size_t k = 0; k < table; ++k) buckets_[k + 1] += buckets_[k];
  entries_.resize(n - large_.size());
  rounded_.resize(entries_.size());
  for (std::size_t i = n; i-- > 0;) {  // backwards: ends with buckets_[k] = first entry, entries ascending by body
    if (bucket_of_[i] == kLarge) continue;
    const At c = centre_cell(boxes[i]);
    const std::uint32_t at = --buckets_[bucket_of_[i] + 1];
    entries_[at] = {c.x, c.y, c.z, static_cast<std::uint32_t>(i)};
    rounded_[at] = rounded(boxes[i]);
  }
  // buckets_[k + 1] now holds the first entry of bucket k, buckets_[k + 2] that of the next one.
  const auto first_of = [&](std::uint64_t k) { return buckets_[k + 1]; };
  const auto end_of = [&](std::uint64_t k) {
    return k + 1 < table ? buckets_[k + 2] : static_cast<std::uint32_t>(entries_.size());
  };

  const auto record = [&](std::uint32_t a, std::uint32_t b) {
    found_.push_back(a < b ? std::uint64_t{a} << 32 | b : std::uint64_t{b} << 32 | a);
  };
  // Of the cells x0 to x1 of a row the entries from number `from` on. They lie next to each other, but where the table
  // begins anew.
  const auto scan = [&](std::uint32_t e, std::int32_t x0, std::int32_t x1, std::int32_t y, std::int32_t z,
                        std::uint32_t from, auto&& skip) {
    const Entry& entry = entries_[e];
    const Rounded box = rounded_[e];
    const std::uint64_t k = bucket(x0, y, z);
    const auto width = static_cast<std::uint32_t>(x1 - x0);
    const auto look = [&](std::uint64_t first, std::uint64_t last) {
      for (std::uint32_t o = std::max(first_of(first), from), end = end_of(last); o < end; ++o) {
        if (!may_overlap(box, rounded_[o])) continue;
        // Buckets hold other cells, too.
        const Entry& other = entries_[o];
        const bool here = other.y == y && other.z == z && static_cast<std::uint32_t>(other.x - x0) <= width;
        if (here && boxes[entry.body].overlaps(boxes[other.body]) && !skip(o, other) &&
            wanted(roles[entry.body], roles[other.body]))
          record(entry.body, other.body);
      }
    };
    if (k + width <= mask) return look(k, k + width);
    look(k, mask);
    look(0, k + width - mask - 1);
  };
  const auto awake = [&](const Entry& e) { return (roles[e.body] & kRoleAwake) != 0; };
  const auto number_awake = static_cast<std::size_t>(std::count_if(entries_.begin(), entries_.end(), awake));
  if (2 * number_awake < entries_.size()) {
    // Mostly asleep: only those awake look around them, but all around. Two awake ones meet once.
    for (std::uint32_t e = 0; e < entries_.size(); ++e) {
      const Entry& entry = entries_[e];
      if (!awake(entry)) continue;
      for (std::int32_t z = entry.z - 1; z <= entry.z + 1; ++z)
        for (std::int32_t y = entry.y - 1; y <= entry.y + 1; ++y)
          scan(e, entry.x - 1, entry.x + 1, y, z, 0,
               [&](std::uint32_t o, const Entry& other) { return o == e || (o < e && awake(other)); });
    }
  } else {
    // Half of the neighbourhood: the own cell (later entries), the next in the row, and four rows of three.
    constexpr int kRows[4][2] = {{1, 0}, {-1, 1}, {0, 1}, {1, 1}};  // y, z
    const auto none = [](std::uint32_t, const Entry&) { return false; };
    for (std::uint32_t e = 0; e < entries_.size(); ++e) {
      const Entry& entry = entries_[e];
      scan(e, entry.x, entry.x, entry.y, entry.z, e + 1, none);
      scan(e, entry.x + 1, entry.x + 1, entry.y, entry.z, 0, none);
      for (const auto& row : kRows) scan(e, entry.x - 1, entry.x + 1, entry.y + row[0], entry.z + row[1], 0, none);
    }
  }
  for (std::uint32_t l : large_)
    for (std::uint32_t i = 0; i < n; ++i) {
      if (i == l || (bucket_of_[i] == kLarge && i < l)) continue;  // two large ones meet once
      if (wanted(roles[l], roles[i]) && boxes[l].overlaps(boxes[i])) record(l, i);
    }

  // Into canonical order: a counting sort by the lower index, then the few partners of each.
  pairs.offsets.assign(n + 1, 0);
  for (std::uint64_t p : found_) ++pairs.offsets[(p >> 32) + 1];
  for (std::size_t i = 0; i < n; ++i) pairs.offsets[i + 1] += pairs.offsets[i];
  pairs.partners.resize(found_.size());
  bucket_of_.assign(pairs.offsets.begin(), pairs.offsets.end());
  for (std::uint64_t p : found_) pairs.partners[bucket_of_[p >> 32]++] = static_cast<std::uint32_t>(p);
  for (std::size_t i = 0; i < n; ++i)
    std::sort(pairs.partners.begin() + pairs.offsets[i], pairs.partners.begin() + pairs.offsets[i + 1]);
}

// ---- static bodies --------------------------------------------------------------------------------------------------
namespace {

std::uint64_t cell_key(std::int32_t x, std::int32_t y, std::int32_t z) {
  return mix(row_hash(y, z) ^ (static_cast<std::uint64_t>(static_cast<std::uint32_t>(x)) * 0x165667b19e3779f9ull)) | 1;
}

}  // namespace

StaticGrid::StaticGrid(std::span<const Aabb> boxes, double cell) : boxes_(boxes.begin(), boxes.end()), cell_(cell) {
  constexpr double kMostCells = 64;  // a box over more cells than this goes to the list
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed;
  const double inverse = 1 / cell;
  for (std::uint32_t i = 0; i < boxes_.size(); ++i) {
    const Vec3 extent = (boxes_[i].max - boxes_[i].min) * inverse + Vec3::Ones();
    if (!(extent.prod() <= kMostCells)) {
      large_.push_back(i);
      continue;
    }
    std::int32_t low[3], high[3];
    for (int a = 0; a < 3; ++a)
      low[a] = cell_along(boxes_[i].min[a], inverse), high[a] = cell_along(boxes_[i].max[a], inverse);
    for (std::int32_t z = low[2]; z <= high[2]; ++z)
      for (std::int32_t y = low[1]; y <= high[1]; ++y)
        for (std::int32_t x = low[0]; x <= high[0]; ++x) keyed.emplace_back(cell_key(x, y, z), i);
  }
  std::sort(keyed.begin(), keyed.end());
  keyed.erase(std::unique(keyed.begin(), keyed.end()), keyed.end());
  slots_.resize(std::bit_ceil(std::max<std::size_t>(16, 2 * keyed.size())));
  for (std::size_t k = 0; k < keyed.size();) {
    std::size_t end = k;
    while (end < keyed.size() && keyed[end].first == keyed[k].first) members_.push_back(keyed[end++].second);
    std::size_t s = keyed[k].first & (slots_.size() - 1);
    while (slots_[s].key != 0) s = (s + 1) & (slots_.size() - 1);
    slots_[s] = {keyed[k].first, static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(end - k)};
    k = end;
  }
}

const StaticGrid::Slot* StaticGrid::slot(std::uint64_t key) const {
  for (std::size_t s = key & (slots_.size() - 1); slots_[s].key != 0; s = (s + 1) & (slots_.size() - 1))
    if (slots_[s].key == key) return &slots_[s];
  return nullptr;
}

void StaticGrid::find(const Aabb& box, std::vector<std::uint32_t>& out) const {
  out.clear();
  for (std::uint32_t i : large_)
    if (boxes_[i].overlaps(box)) out.push_back(i);
  if (!members_.empty()) {
    const double inverse = 1 / cell_;
    std::int32_t low[3], high[3];
    double cells = 1;
    for (int a = 0; a < 3; ++a) {
      low[a] = cell_along(box.min[a], inverse), high[a] = cell_along(box.max[a], inverse);
      cells *= high[a] - low[a] + 1.0;
    }
    if (cells > static_cast<double>(boxes_.size())) {
      // A very large or fast body: asking every static box is cheaper than visiting every cell.
      for (std::uint32_t i = 0; i < boxes_.size(); ++i)
        if (boxes_[i].overlaps(box)) out.push_back(i);
    } else {
      for (std::int32_t z = low[2]; z <= high[2]; ++z)
        for (std::int32_t y = low[1]; y <= high[1]; ++y)
          for (std::int32_t x = low[0]; x <= high[0]; ++x)
            if (const Slot* s = slot(cell_key(x, y, z)))
              for (std::uint32_t m = 0; m < s->count; ++m)
                if (boxes_[members_[s->first + m]].overlaps(box)) out.push_back(members_[s->first + m]);
    }
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

}  // namespace soda::physics
