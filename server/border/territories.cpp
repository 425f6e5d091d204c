#include "server/border/territories.h"

#include <algorithm>
#include <stdexcept>
#include <tuple>

namespace soda::border {
namespace {

// The cells within `range` of a marked one along each axis: dilating along each axis in turn gives the cube.
void dilate(const Grid& grid, int range, std::vector<std::uint8_t>& marked) {
  const std::size_t stride[3] = {1, static_cast<std::size_t>(grid.size[0]),
                                 static_cast<std::size_t>(grid.size[0]) * grid.size[1]};
  std::vector<std::uint8_t> line;
  for (int axis = 0; axis < 3; ++axis) {
    const std::int32_t n = grid.size[axis];
    for (std::size_t i = 0; i < marked.size(); ++i) {
      if (i / stride[axis] % n != 0) continue;  // first cell of a line along the axis
      line.assign(n, 0);
      for (std::int32_t k = 0; k < n; ++k)
        if (marked[i + k * stride[axis]])
          for (std::int32_t d = std::max(0, k - range); d <= std::min(n - 1, k + range); ++d) line[d] = 1;
      for (std::int32_t k = 0; k < n; ++k) marked[i + k * stride[axis]] = line[k];
    }
  }
}

bool earlier(const Transfer& l, const Transfer& r) {
  return std::tie(l.step, l.giver, l.number) < std::tie(r.step, r.giver, r.number);
}

}  // namespace

Territories::Territories(const TerritoryMap& initial, std::span<const Transfer> transfers)
    : grid_(initial.grid), worlds_(initial.worlds), known_(initial.worlds, 0) {
  Version& first = versions_.emplace_back();
  first.owner = initial.owner;
  first.sole.resize(first.owner.size());
  make_sole(first, {});
  for (const Transfer& transfer : transfers) add(transfer);
}

std::string Territories::fault(const Transfer& t) const {
  if (t.giver >= worlds_ || t.taker >= worlds_ || t.giver == t.taker) return "such worlds cannot be";
  if (t.number <= known_[t.giver]) return {};
  if (t.number != known_[t.giver] + 1) return "others of its giver have to come before it";
  if (t.step <= versions_.front().from) return "it would begin at a step that is past";
  if (t.cells.empty()) return "without cells";
  for (std::size_t i = 0; i < t.cells.size(); ++i) {
    if (t.cells[i] >= grid_.cells()) return "there is no cell " + std::to_string(t.cells[i]);
    if (i > 0 && t.cells[i] <= t.cells[i - 1]) return "its cells are out of order";
    if (owner(t.cells[i], t.step - 1) != t.giver) return "cell " + std::to_string(t.cells[i]) + " is not its giver's";
  }
  return {};
}

bool Territories::add(const Transfer& transfer) {
  if (const std::string why = fault(transfer); !why.empty())
    throw std::invalid_argument("transfer " + std::to_string(transfer.number) + " of world " +
                                std::to_string(transfer.giver) + ": " + why);
  if (transfer.number <= known_[transfer.giver]) return false;
  known_[transfer.giver] = transfer.number;
  transfers_.insert(std::upper_bound(transfers_.begin(), transfers_.end(), transfer, earlier), transfer);
  rebuild_from(transfer.step);
  return true;
}

bool Territories::keeps(WorldId world, std::size_t cell, Step step) const {
  return owner(cell, step) == world && std::all_of(versions_.begin(), versions_.end(), [&](const Version& v) {
           return v.from <= step || v.owner[cell] == world;
         });
}

Step Territories::diameter(int range) const {
  // Who is near whom: for each cell, those further on along the axes; whose own neighbours are the others.
  const std::vector<WorldId>& owner = versions_.front().owner;
  std::vector<std::vector<std::uint8_t>> near(worlds_, std::vector<std::uint8_t>(worlds_, 0));
  for (std::size_t i = 0; i < owner.size(); ++i) {
    const auto n = static_cast<std::int32_t>(i);
    const Cell c{n % grid_.size[0], n / grid_.size[0] % grid_.size[1], n / grid_.size[0] / grid_.size[1]};
    Cell low = c, high = c;
    for (int axis = 0; axis < 3; ++axis) high[axis] = std::min(c[axis] + range, grid_.size[axis] - 1);
    for (int axis = 0; axis < 2; ++axis) low[axis] = std::max(c[axis] - range, 0);
    for (std::int32_t z = c[2]; z <= high[2]; ++z)
      for (std::int32_t y = low[1]; y <= high[1]; ++y)
        for (std::int32_t x = low[0]; x <= high[0]; ++x) {
          const WorldId other = owner[grid_.index({x, y, z})];
          near[owner[i]][other] = near[other][owner[i]] = 1;
        }
  }
  std::vector<std::vector<WorldId>> neighbours(worlds_);
  for (WorldId a = 0; a < worlds_; ++a)
    for (WorldId b = 0; b < worlds_; ++b)
      if (near[a][b]) neighbours[a].push_back(b);
  Step most = 0;
  std::vector<Step> far(worlds_);
  std::vector<WorldId> queue;
  for (WorldId from = 0; from < worlds_; ++from) {
    far.assign(worlds_, -1);
    far[from] = 0;
    queue.assign(1, from);
    for (std::size_t at = 0; at < queue.size(); ++at)
      for (const WorldId to : neighbours[queue[at]])
        if (far[to] < 0) {
          far[to] = far[queue[at]] + 1;
          queue.push_back(to);
        }
    most = std::max(most, far[queue.back()]);
  }
  return most;
}

void Territories::release_before(Step step, Step memory) {
  while (versions_.size() > 1 && versions_[1].from <= step) versions_.erase(versions_.begin());
  std::erase_if(transfers_, [&](const Transfer& t) { return t.step < step - memory; });
}

// Makes the versions from this step on anew.
void Territories::rebuild_from(Step step) {
  versions_.erase(
      std::find_if(versions_.begin() + 1, versions_.end(), [&](const Version& v) { return v.from >= step; }),
      versions_.end());
  for (std::size_t i = 0; i < transfers_.size();) {
    const Step from = transfers_[i].step;
    std::size_t end = i;
    while (end < transfers_.size() && transfers_[end].step == from) ++end;
    if (from >= step) {
      Version next = versions_.back();
      next.from = from;
      next.near_changed.assign(grid_.cells(), 0);
      for (; i < end; ++i)
        for (const std::uint32_t cell : transfers_[i].cells) {
          next.owner.at(cell) = transfers_[i].taker;
          next.near_changed[cell] = 1;
        }
      dilate(grid_, 2, next.near_changed);
      make_sole(next, next.near_changed);
      versions_.push_back(std::move(next));
    }
    i = end;
  }
}

// Of the cells that are marked, or of all where nothing is.
void Territories::make_sole(Version& version, const std::vector<std::uint8_t>& where) const {
  for (std::int32_t z = 0; z < grid_.size[2]; ++z)
    for (std::int32_t y = 0; y < grid_.size[1]; ++y)
      for (std::int32_t x = 0; x < grid_.size[0]; ++x) {
        const std::size_t cell = grid_.index({x, y, z});
        if (!where.empty() && !where[cell]) continue;
        const WorldId owner = version.owner[cell];
        bool sole = true;
        for (std::int32_t k = std::max(0, z - 1); sole && k <= std::min(grid_.size[2] - 1, z + 1); ++k)
          for (std::int32_t j = std::max(0, y - 1); sole && j <= std::min(grid_.size[1] - 1, y + 1); ++j)
            for (std::int32_t i = std::max(0, x - 1); sole && i <= std::min(grid_.size[0] - 1, x + 1); ++i)
              sole = version.owner[grid_.index({i, j, k})] == owner;
        version.sole[cell] = sole ? owner : kNoWorld;
      }
}

std::size_t Territories::cells_of(WorldId world, Step step) const {
  const auto& owner = at(step).owner;
  return static_cast<std::size_t>(std::count(owner.begin(), owner.end(), world));
}

void Territories::find_neighbours(WorldId world, int range, Step from, std::vector<Step>& since) const {
  // Who gives cells away tells their new owner of what is in them, wherever else that one is.
  std::vector<std::uint8_t> near;
  for (std::size_t v = 0; v < versions_.size(); ++v) {
    if (versions_[v].from < from) continue;
    const auto &now = versions_[v].owner, &before = versions_[v == 0 ? 0 : v - 1].owner;
    near.assign(grid_.cells(), 0);
    for (std::size_t i = 0; i < near.size(); ++i) near[i] = now[i] == world || before[i] == world;
    dilate(grid_, range, near);
    for (std::size_t i = 0; i < near.size(); ++i)
      if (near[i])
        for (const WorldId other : {now[i], before[i]}) since[other] = std::min(since[other], versions_[v].from);
  }
}

}  // namespace soda::border
