// A recording, for the gateway: plays the poses that it has, in a loop of its own clock, without any physics.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/viewer/scene_model.h"
#include "client/viewer/source.h"
#include "common/recording/recording.h"

namespace soda::viewer {

class ReplaySource final : public Source {
 public:
  // Loads all of it. Throws RecordingError where that cannot be, or it has no poses.
  explicit ReplaySource(const std::filesystem::path& path);
  const std::string& cut() const { return cut_; }  // why the file is not whole, or ""

  News poll() override;
  bool ready() const override { return true; }
  view::Welcome welcome() const override;
  std::uint32_t listed() const override { return buffer_.bodies().size(); }
  view::BodyList bodies(std::uint32_t first, std::uint32_t& meshes) const override;
  std::uint32_t transfers_known() const override { return 0; }  // it has no territories
  view::Transfers transfers(std::uint32_t) const override { return {}; }
  const buffer::TransformBuffer* buffer() const override { return &buffer_; }
  Step displayed() const override;
  view::Clocks clocks() const override;
  view::Worlds worlds() override { return {}; }
  std::optional<End> ended() const override { return std::nullopt; }
  std::uint64_t ask(const view::Do& wanted) override;

 private:
  using Clock = std::chrono::steady_clock;
  void fill(const Recording& recording);

  const std::string name_;
  std::string cut_;
  std::unique_ptr<SceneModel> model_;
  buffer::TransformBuffer buffer_{1};
  double dt_ = 0;
  Step first_ = 0, last_ = 0;  // sampled
  double at_ = 0;              // steps, displayed, with fraction
  double speed_ = 1;           // multiple of real time
  bool paused_ = false;
  mutable bool seen_ = false;  // by some page: it begins with the first
  Clock::time_point then_ = Clock::now();
  std::uint64_t asked_ = 0;
  std::vector<std::pair<std::uint64_t, view::Answer>> answers_;
};

}  // namespace soda::viewer
