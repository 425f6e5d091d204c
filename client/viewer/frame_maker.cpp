#include "client/viewer/frame_maker.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "client/viewer/scene_model.h"

namespace soda::viewer {
namespace {

static_assert(view::FLAG_ASLEEP == wire::VIEW_ASLEEP && view::FLAG_NEAR == wire::VIEW_NEAR &&
              view::FLAG_MIXED == wire::VIEW_MIXED);

constexpr double kFarthest = 1e30;  // m: a float has it, and farther than anybody looks

double seconds_since(std::int64_t ns) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return 1e-9 * static_cast<double>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count() - ns);
}

}  // namespace

std::optional<view::Frame> FrameMaker::next(const buffer::View& view, const buffer::TransformBuffer& buffer,
                                            std::uint32_t listed) {
  if (view.step < 0) return std::nullopt;
  view::Frame frame;
  frame.set_whole(shown_.worlds.size() != view.worlds.size());
  if (frame.whole()) shown_.worlds.assign(view.worlds.size(), buffer::Poses());
  sent_.assign(listed, 0);
  flash_.assign(listed, 0);
  gone_.clear();
  bool flashes = false;
  buffer.for_each_redone(redone_, [&](const buffer::TransformBuffer::Redone& redone) {
    if (redone.body >= listed) return;
    flash_[redone.body] = 1;
    flashes = true;
  });
  redone_ = buffer.redone_count();
  for (WorldId world = 0; world < view.worlds.size(); ++world)
    buffer::Poses::for_each_difference(shown_.worlds[world], view.worlds[world],
                                       [&](std::uint32_t body, const buffer::Pose*, const buffer::Pose* now) {
                                         if (body >= listed) return;
                                         if (now)
                                           add(frame, body, *now, world);
                                         else
                                           gone_.push_back(body);
                                       });
  if (flashes)
    for (WorldId world = 0; world < view.worlds.size(); ++world)
      for (std::uint32_t body = 0; body < listed; ++body)
        if (flash_[body] && !sent_[body])
          if (const buffer::Pose* pose = view.worlds[world].get(body)) add(frame, body, *pose, world);
  for (const std::uint32_t body : gone_) {
    if (sent_[body]) continue;  // it has gone over to another world
    // Or another one has shown it, too, and still does.
    const auto other = std::find_if(view.worlds.begin(), view.worlds.end(),
                                    [&](const buffer::Poses& poses) { return poses.get(body) != nullptr; });
    if (other == view.worlds.end())
      append(*frame.mutable_gone(), body);
    else
      add(frame, body, *other->get(body), static_cast<WorldId>(other - view.worlds.begin()));
  }
  const bool news = frame.whole() || view.step != shown_.step || view.anticipated != shown_.anticipated ||
                    !frame.index().empty() || !frame.gone().empty();
  shown_ = view;
  if (!news) return std::nullopt;
  frame.set_number(++number_);
  frame.set_step(view.step);
  frame.set_anticipated(view.anticipated);
  frame.set_age(seconds_since(view.computed));
  return frame;
}

void FrameMaker::add(view::Frame& frame, std::uint32_t body, const buffer::Pose& pose, WorldId world) {
  sent_[body] = 1;
  append(*frame.mutable_index(), body);
  for (const double x : pose.position)
    append(*frame.mutable_position(), static_cast<float>(std::clamp(x, -kFarthest, kFarthest)));
  for (const float q : pose.orientation)
    append(*frame.mutable_orientation(), static_cast<std::int16_t>(std::lround(32767 * std::clamp(q, -1.0f, 1.0f))));
  const double speed = std::hypot(pose.linear[0], pose.linear[1], pose.linear[2]);
  append(*frame.mutable_speed(), static_cast<std::uint16_t>(std::min(65535.0, 100 * speed)));
  append(*frame.mutable_world(), static_cast<std::uint16_t>(world));
  append(*frame.mutable_flags(), static_cast<std::uint8_t>(pose.flags | (flash_[body] ? view::FLAG_REDONE : 0)));
}

}  // namespace soda::viewer
