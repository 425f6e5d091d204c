// Makes the frames of one page: what is different from the frame before.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "client/buffer/transform_buffer.h"
#include "viewer.pb.h"

namespace soda::viewer {

class FrameMaker {
 public:
  // The next frame has everything.
  void begin_anew() { shown_ = {}; }
  // So does it, and is of another buffer.
  void begin_another() { shown_ = {}, redone_ = 0; }

  // Of bodies with an index below `listed`. Nothing where it would say nothing new.
  std::optional<view::Frame> next(const buffer::View& view, const buffer::TransformBuffer& buffer,
                                  std::uint32_t listed);
  std::uint32_t number() const { return number_; }  // of the newest

 private:
  void add(view::Frame& frame, std::uint32_t body, const buffer::Pose& pose, WorldId world);

  buffer::View shown_;
  std::uint64_t redone_ = 0;  // number of the first that no frame has told of
  std::uint32_t number_ = 0;
  std::vector<std::uint8_t> sent_, flash_;  // by body, of the frame in the making
  std::vector<std::uint32_t> gone_;
};

}  // namespace soda::viewer
