// A session that runs, for the gateway.
#pragma once

#include <chrono>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/buffer/session_client.h"
#include "client/viewer/scene_model.h"
#include "client/viewer/source.h"

namespace soda::viewer {

class LiveSource final : public Source {
 public:
  LiveSource(const dds::NetworkOptions& network, const std::string& session, buffer::Following following);

  News poll() override;
  bool ready() const override { return model_ != nullptr; }
  view::Welcome welcome() const override;
  std::uint32_t listed() const override { return static_cast<std::uint32_t>(bodies_.size()); }
  view::BodyList bodies(std::uint32_t first, std::uint32_t& meshes) const override;
  std::uint32_t transfers_known() const override { return static_cast<std::uint32_t>(transfers_.size()); }
  view::Transfers transfers(std::uint32_t first) const override;
  const buffer::TransformBuffer* buffer() const override { return client_.buffer(); }
  Step displayed() const override { return client_.displayed(); }
  view::Clocks clocks() const override;
  view::Worlds worlds() override;
  std::optional<End> ended() const override;
  // As SessionClient says.
  bool superseded() const { return client_.superseded(); }
  std::int64_t next() const { return client_.next(); }
  std::uint64_t ask(const view::Do& wanted) override;

 private:
  using Clock = std::chrono::steady_clock;
  struct Watched {  // of a world
    wire::Status before;
    Clock::time_point then{};
    bool silent = false;
    std::uint64_t repairs = 0;
    bool known = false;
  };
  void watch_worlds(News& news);
  void note_transfers();
  void note_speed();
  // Nothing is heard of it, and something should be: not so of one that is done, nor of a session that is over.
  bool silent(WorldId world, Clock::time_point now) const;
  view::WorldState state_of(WorldId world, Clock::time_point now);

  const std::string session_;
  buffer::SessionClient client_;
  std::unique_ptr<SceneModel> model_;
  std::vector<BodyId> bodies_;  // by index, as far as their looks are known, or have not become known for a while
  Clock::time_point stuck_{};   // since then the next one's are not
  std::size_t spawned_ = 0;     // bodies of the log that the model has
  std::vector<Watched> watched_;
  std::size_t heard_transfers_ = 0;                           // of the client's
  std::vector<view::Transfer> transfers_;                     // of these, those that the grid can have
  std::deque<std::pair<Clock::time_point, Step>> displayed_;  // of the last second
};

}  // namespace soda::viewer
