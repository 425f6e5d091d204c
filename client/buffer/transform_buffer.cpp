#include "client/buffer/transform_buffer.h"

#include <algorithm>
#include <limits>

namespace soda::buffer {
namespace {

constexpr std::size_t kRedoneKept = 1 << 16;

}  // namespace

std::uint32_t BodyIndex::of(BodyId id) {
  const auto [at, added] = index_.try_emplace(id, size());
  if (added) ids_.push_back(id);
  return at->second;
}

std::optional<std::uint32_t> BodyIndex::find(BodyId id) const {
  const auto at = index_.find(id);
  return at == index_.end() ? std::nullopt : std::optional(at->second);
}

TransformBuffer::TransformBuffer(WorldId worlds) : worlds_(worlds) {}

bool TransformBuffer::add(const wire::Transforms& sample) {
  if (sample.world() >= worlds_.size()) return true;
  World& world = worlds_[sample.world()];
  const bool follows = world.number != 0 && sample.number() == world.number;
  const Step step = sample.step();
  if (sample.kind() == wire::VIEW_WHOLE) {
    // Who has followed loses nothing by it: another viewer has asked.
    if (!follows || step < world.first || step > world.last() + 1) {
      world.entries.clear();
      world.first = step;
    }
    Entry whole;
    change(whole.poses, sample);
    if (step > world.last()) world.entries.emplace_back();
    world.entries[static_cast<std::size_t>(step - world.first)] = std::move(whole);
  } else if (!follows) {
    world.number = 0;
    world.front = std::min(world.front, world.final_step);  // of the rest a repair may have begun
    return false;
  } else if (step > world.first && step <= world.last() + 1 && sample.kind() == wire::VIEW_STEP) {
    if (step > world.last()) world.entries.emplace_back();
    const auto at = static_cast<std::size_t>(step - world.first);
    world.entries[at].poses = world.entries[at - 1].poses;
    change(world.entries[at].poses, sample);
  } else if (step >= world.first && step <= world.last()) {  // else it was released
    change(world.entries[static_cast<std::size_t>(step - world.first)].poses, sample);
    for (const BodyId id : sample.ids()) redone_.push_back({bodies_.of(id), sample.world(), step});
    while (redone_.size() > kRedoneKept) {
      redone_.pop_front();
      ++redone_first_;
    }
  }
  if (step >= world.first && step <= world.last() && (!sample.ids().empty() || sample.kind() != wire::VIEW_AGAIN))
    world.entries[static_cast<std::size_t>(step - world.first)].computed = sample.computed();
  world.number = sample.number() + 1;
  world.front = sample.front();
  world.final_step = sample.final_step();
  release_before(released_);
  return true;
}

void TransformBuffer::change(Poses& poses, const wire::Transforms& sample) {
  items_.clear();
  for (std::size_t i = 0; i < sample.ids().size(); ++i) {
    Ref<Pose> pose(new Pose);
    pose->flags = sample.flags()[i];
    std::copy_n(&sample.positions()[3 * i], 3, pose->position.begin());
    std::copy_n(&sample.orientations()[4 * i], 4, pose->orientation.begin());
    std::copy_n(&sample.velocities()[6 * i], 3, pose->linear.begin());
    std::copy_n(&sample.velocities()[6 * i + 3], 3, pose->angular.begin());
    items_.emplace_back(bodies_.of(sample.ids()[i]), std::move(pose));
  }
  for (const BodyId id : sample.gone()) items_.emplace_back(bodies_.of(id), Ref<Pose>());
  poses.assign(items_);
}

Step TransformBuffer::oldest() const {
  Step step = 0;
  for (const World& world : worlds_)
    step = world.entries.empty() ? std::numeric_limits<Step>::max() : std::max(step, world.first);
  return step;
}

Step TransformBuffer::newest() const {
  Step step = std::numeric_limits<Step>::max();
  for (const World& world : worlds_) step = std::min(step, world.entries.empty() ? -1 : world.newest());
  return step;
}

Step TransformBuffer::final_step() const {
  Step step = std::numeric_limits<Step>::max();
  for (const World& world : worlds_) step = std::min(step, world.final_step);
  return step;
}

Step TransformBuffer::clock(WorldId world) const {
  const World& w = worlds_.at(world);
  return w.entries.empty() ? -1 : w.last();
}

View TransformBuffer::at(Step asked) const {
  View view;
  const Step first = oldest(), last = newest();
  if (last < first) return view;
  view.step = std::clamp(asked, first, last);
  view.anticipated = view.step > final_step();
  view.worlds.reserve(worlds_.size());
  for (const World& world : worlds_) {
    const Entry& entry = world.entries[static_cast<std::size_t>(view.step - world.first)];
    view.worlds.push_back(entry.poses);
    view.computed = std::max(view.computed, entry.computed);
  }
  return view;
}

void TransformBuffer::release_before(Step step) {
  released_ = std::max(released_, step);
  // Alike in all worlds: as far as the slowest goes.
  const Step keep = std::min(released_, newest());
  for (World& world : worlds_)
    while (world.first < keep && world.entries.size() > 1) {
      world.entries.pop_front();
      ++world.first;
    }
}

}  // namespace soda::buffer
