#include "server/border/neighbourhood.h"

#include <algorithm>
#include <span>
#include <utility>

#include "common/grid.h"
#include "server/physics/stepper.h"
#include "server/physics/tuning.h"

namespace soda::border {

Neighbourhood::Neighbourhood(const physics::Model& model, const Territories& territories, WorldId me)
    : model_(model),
      territories_(territories),
      range_(neighbour_range(model.scene(), territories.grid())),
      me_(me),
      since_(territories.worlds(), kNever),
      half_edge_(0.5 * territories.grid().edge) {
  territories_change(0);
}

void Neighbourhood::territories_change(Step step) {
  for (Step& since : since_)
    if (since >= step) since = kNever;
  territories_.find_neighbours(me_, range_, step, since_);
  since_[me_] = kNever;
  alone_ = std::all_of(since_.begin(), since_.end(), [](Step since) { return since == kNever; });
}

Step Neighbourhood::hops() const {
  if (hops_ < 0) {
    const Step most = territories_.diameter(range_);
    hops_ = std::max(most, std::min<Step>(2 * most, 6));
  }
  return hops_;
}

std::size_t Neighbourhood::cell_of(const BodyState& body) const {
  return territories_.grid().index(territories_.grid().cell_of(body.x()));
}

bool Neighbourhood::is_wide(const BodyState& body) const {
  if (alone_ || physics::reach_bound(body, model_.find(body.id)->reach, model_.scene().dt) <= half_edge_) return false;
  const Aabb box = physics::reach_box(body, model_);
  const Vec3 x = body.x();
  return (box.max - x).maxCoeff() > half_edge_ || (x - box.min).maxCoeff() > half_edge_;
}

timeline::Place Neighbourhood::place(const BodyState& body, Step step) const {
  if (alone_) return {me_, false, true};
  const std::size_t cell = cell_of(body);
  timeline::Place place;
  place.owner = territories_.owner(cell, step);
  place.wide = is_wide(body) && (place.owner == me_ || reaches_me(body, step));
  place.inside = !place.wide && territories_.sole(cell, step) != kNoWorld;
  return place;
}

// Of what has been given away with its cell, it may not be so.
bool Neighbourhood::reaches_me(const BodyState& body, Step step) const {
  std::vector<WorldId> worlds;
  reached_by_box(body, step, worlds);
  return std::find(worlds.begin(), worlds.end(), me_) != worlds.end();
}

bool Neighbourhood::place_changes(const BodyState& body, Step step) const {
  return territories_.change_at(step) && (territories_.changes_near(cell_of(body), step) || is_wide(body));
}

void Neighbourhood::reached_by_box(const BodyState& body, Step step, std::vector<WorldId>& worlds) const {
  const Grid& grid = territories_.grid();
  const Aabb box = physics::reach_box(body, model_);
  const Vec3 half = Vec3::Constant(half_edge_);
  const Cell low = grid.cell_of(box.min - half), high = grid.cell_of(box.max + half);
  const std::span<const WorldId> owners = territories_.owners(step);
  WorldId last = kNoWorld;
  for (std::int32_t z = low[2]; z <= high[2]; ++z)
    for (std::int32_t y = low[1]; y <= high[1]; ++y)
      for (std::int32_t x = low[0]; x <= high[0]; ++x) {
        const WorldId w = owners[grid.index({x, y, z})];
        if (std::exchange(last, w) == w) continue;
        if (std::find(worlds.begin(), worlds.end(), w) == worlds.end()) worlds.push_back(w);
      }
}

void Neighbourhood::reached(const BodyState& body, Step step, std::vector<WorldId>& worlds) const {
  worlds.clear();
  reached_by_box(body, step, worlds);
  std::erase(worlds, owner(body, step));
  std::sort(worlds.begin(), worlds.end());
}

void Neighbourhood::hearers(const BodyState& body, Step step, std::vector<WorldId>& worlds) const {
  worlds.clear();
  worlds.push_back(owner(body, step));
  reached_by_box(body, step, worlds);
  std::erase(worlds, me_);
  std::sort(worlds.begin(), worlds.end());
  worlds.erase(std::unique(worlds.begin(), worlds.end()), worlds.end());
}

}  // namespace soda::border
