#include "server/physics/skyline.h"

#include <algorithm>

namespace soda::physics {
namespace {

// A pivot smaller than this share of its diagonal is rounding. (Those of a light body between heavy ones are 1e-10 and
// mean something.)
constexpr double kImplied = 1e-13;

}  // namespace

void Skyline::add_row(std::uint32_t first) {
  rows_.push_back({entries_.size(), first, 0});
  entries_.resize(entries_.size() + size() - first);
}

void Skyline::cut(std::uint32_t size) {
  if (size < rows_.size()) entries_.resize(rows_[size].begin);
  rows_.resize(size);
}

void Skyline::zero(std::uint32_t begin, std::uint32_t end) {
  if (begin == end) return;
  const std::size_t last = end < size() ? rows_[end].begin : entries_.size();
  std::fill(entries_.begin() + static_cast<std::ptrdiff_t>(rows_[begin].begin),
            entries_.begin() + static_cast<std::ptrdiff_t>(last), 0.0);
}

void Skyline::factor(std::uint32_t begin, std::uint32_t end) {
  for (std::uint32_t i = begin; i < end; ++i) {
    const std::uint32_t first = rows_[i].first;
    double* const row = &entries_[rows_[i].begin];  // by column, counted from `first`
    // Row i of L D, from left to right; then of L, with its pivot.
    for (std::uint32_t j = first; j < i; ++j) {
      const double* const other = &entries_[rows_[j].begin];
      const std::uint32_t other_first = rows_[j].first;
      double sum = row[j - first];
      for (std::uint32_t k = std::max(first, other_first); k < j; ++k) sum -= row[k - first] * other[k - other_first];
      row[j - first] = sum;
    }
    const double diagonal = row[i - first];
    double pivot = diagonal;
    for (std::uint32_t j = first; j < i; ++j) {
      const double l = row[j - first] * rows_[j].inverse_pivot;
      pivot -= l * row[j - first];
      row[j - first] = l;
    }
    rows_[i].inverse_pivot = pivot > kImplied * diagonal ? 1 / pivot : 0;
  }
}

void Skyline::solve(std::uint32_t begin, std::uint32_t end, std::span<double> x) const {
  for (std::uint32_t i = begin; i < end; ++i) {
    const std::uint32_t first = rows_[i].first;
    const double* const row = &entries_[rows_[i].begin];
    double sum = x[i - begin];
    for (std::uint32_t k = first; k < i; ++k) sum -= row[k - first] * x[k - begin];
    x[i - begin] = sum;
  }
  for (std::uint32_t i = begin; i < end; ++i) x[i - begin] *= rows_[i].inverse_pivot;
  for (std::uint32_t i = end; i-- > begin;) {
    const std::uint32_t first = rows_[i].first;
    const double* const row = &entries_[rows_[i].begin];
    for (std::uint32_t k = first; k < i; ++k) x[k - begin] -= row[k - first] * x[i - begin];
  }
}

}  // namespace soda::physics
