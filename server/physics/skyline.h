// Symmetric systems with few entries off the diagonal, solved directly: of each row what lies between its first entry
// and the diagonal is kept, since elimination fills no more than that (A. Jennings, "A compact storage scheme for the
// solution of symmetric linear simultaneous equations", 1966). Eigen's sparse solvers take memory for each
// factorisation, and know nothing of rows that say the same twice, as closed chains of joints do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace soda::physics {

class Skyline {
 public:
  void clear() { rows_.clear(), entries_.clear(); }
  // The next row, whose entries before `first` are 0. A block that is solved by itself begins with a row whose `first`
  // is its own number, and no later row reaches back beyond that.
  void add_row(std::uint32_t first);
  std::uint32_t size() const { return static_cast<std::uint32_t>(rows_.size()); }
  void cut(std::uint32_t size);                       // takes all rows after the first `size` away
  void zero(std::uint32_t begin, std::uint32_t end);  // all entries of these rows
  // Entry (row, column), with first <= column <= row.
  double& at(std::uint32_t row, std::uint32_t column) {
    return entries_[rows_[row].begin + (column - rows_[row].first)];
  }
  // Makes L D L^T of rows begin to end, in place. A row that earlier ones imply is left out: its solution is 0.
  void factor(std::uint32_t begin, std::uint32_t end);
  // Solves for rows begin to end; `x` has one number for each of them, the right side and then the solution.
  void solve(std::uint32_t begin, std::uint32_t end, std::span<double> x) const;

 private:
  struct Row {
    std::size_t begin;    // in entries_
    std::uint32_t first;  // column
    double inverse_pivot;
  };
  std::vector<Row> rows_;
  std::vector<double> entries_;
};

}  // namespace soda::physics
