#include "server/border/neighbourhood.h"

#include <algorithm>

#include "common/grid.h"
#include "server/physics/stepper.h"
#include "server/physics/tuning.h"

namespace soda::border {
Neighbourhood::Neighbourhood(const physics::Model& model, const TerritoryMap& map, WorldId me)
    : model_(model), map_(map), me_(me), half_edge_(0.5 * map.grid.edge) {
  const Grid& grid = map.grid;
  const int range = neighbour_range(model.scene(), grid);
  model_grew();

  // Cells near ours, axis by axis: dilating along each axis in turn gives the cube.
  std::vector<std::uint8_t> near(grid.cells(), 0);
  for (std::size_t i = 0; i < near.size(); ++i) near[i] = map.owner[i] == me, own_cells_ += near[i];
  const std::size_t stride[3] = {1, static_cast<std::size_t>(grid.size[0]),
                                 static_cast<std::size_t>(grid.size[0]) * grid.size[1]};
  std::vector<std::uint8_t> line;
  for (int axis = 0; axis < 3; ++axis) {
    const std::int32_t n = grid.size[axis];
    for (std::size_t i = 0; i < near.size(); ++i) {
      if (i / stride[axis] % n != 0) continue;  // first cell of a line along the axis
      line.assign(n, 0);
      for (std::int32_t k = 0; k < n; ++k)
        if (near[i + k * stride[axis]])
          for (std::int32_t d = std::max(0, k - range); d <= std::min(n - 1, k + range); ++d) line[d] = 1;
      for (std::int32_t k = 0; k < n; ++k) near[i + k * stride[axis]] = line[k];
    }
  }
  std::vector<std::uint8_t> is_neighbour(map.worlds, 0);
  for (std::size_t i = 0; i < near.size(); ++i)
    if (near[i]) is_neighbour[map.owner[i]] = 1;
  for (WorldId w = 0; w < map.worlds; ++w)
    if (is_neighbour[w] && w != me) neighbours_.push_back(w);

  sole_.assign(grid.cells(), kNoWorld);
  for (std::int32_t z = 0; z < grid.size[2]; ++z)
    for (std::int32_t y = 0; y < grid.size[1]; ++y)
      for (std::int32_t x = 0; x < grid.size[0]; ++x) {
        const WorldId owner = map.owner[grid.index({x, y, z})];
        bool sole = true;
        for (std::int32_t k = std::max(0, z - 1); sole && k <= std::min(grid.size[2] - 1, z + 1); ++k)
          for (std::int32_t j = std::max(0, y - 1); sole && j <= std::min(grid.size[1] - 1, y + 1); ++j)
            for (std::int32_t i = std::max(0, x - 1); sole && i <= std::min(grid.size[0] - 1, x + 1); ++i)
              sole = map.owner[grid.index({i, j, k})] == owner;
        if (sole) sole_[grid.index({x, y, z})] = owner;
      }
}

void Neighbourhood::model_grew() {
  for (const physics::BodyModel& m : model_.bodies().subspan(ordinary_below_.size())) {
    const double room = (half_edge_ - 2 * m.reach - physics::kContactMargin) / model_.scene().dt;
    ordinary_below_.push_back(room > 0 ? room * room : -1);
  }
}

timeline::Place Neighbourhood::place(const BodyState& body) const {
  if (neighbours_.empty()) return {me_, false, true};
  const std::size_t cell = map_.grid.index(map_.grid.cell_of(body.x()));
  timeline::Place place;
  place.owner = map_.owner[cell];
  const auto index = static_cast<std::size_t>(model_.find(body.id) - model_.bodies().data());
  if (!(body.v().squaredNorm() <= ordinary_below_[index])) {
    const Aabb box = physics::reach_box(body, model_);
    const Vec3 x = body.x();
    place.wide = (box.max - x).maxCoeff() > half_edge_ || (x - box.min).maxCoeff() > half_edge_;
  }
  place.inside = !place.wide && sole_[cell] != kNoWorld;
  return place;
}

void Neighbourhood::reached_by_box(const BodyState& body, std::vector<WorldId>& worlds) const {
  const Grid& grid = map_.grid;
  const Aabb box = physics::reach_box(body, model_);
  const Vec3 half = Vec3::Constant(0.5 * grid.edge);
  const Cell low = grid.cell_of(box.min - half), high = grid.cell_of(box.max + half);
  for (std::int32_t z = low[2]; z <= high[2]; ++z)
    for (std::int32_t y = low[1]; y <= high[1]; ++y)
      for (std::int32_t x = low[0]; x <= high[0]; ++x) {
        const WorldId w = map_.owner[grid.index({x, y, z})];
        if (std::find(worlds.begin(), worlds.end(), w) == worlds.end()) worlds.push_back(w);
      }
}

void Neighbourhood::reached(const BodyState& body, std::vector<WorldId>& worlds) const {
  worlds.clear();
  reached_by_box(body, worlds);
  std::erase(worlds, owner(body));
  std::sort(worlds.begin(), worlds.end());
}

void Neighbourhood::hearers(const BodyState& body, std::vector<WorldId>& worlds) const {
  worlds.clear();
  worlds.push_back(owner(body));
  reached_by_box(body, worlds);
  std::erase(worlds, me_);
  std::sort(worlds.begin(), worlds.end());
  worlds.erase(std::unique(worlds.begin(), worlds.end()), worlds.end());
}

}  // namespace soda::border
