#include "server/world/recorder.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>

#include "common/dds/checks.h"

namespace soda::world {
namespace {

constexpr std::size_t kBatchSteps = 256;
constexpr std::chrono::milliseconds kBatchAge{50};

static_assert(std::endian::native == std::endian::little, "states are sent as raw little-endian memory");

template <class T>
wire::Octets octets(std::span<const T> values) {
  wire::Octets bytes(values.size_bytes());
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

// As many of `rest` as fit into `room` bytes, which they are taken from.
template <class T>
std::span<const T> take(std::span<const T>& rest, std::size_t& room) {
  const auto taken = rest.first(std::min(rest.size(), room / sizeof(T)));
  rest = rest.subspan(taken.size());
  room -= taken.size_bytes();
  return taken;
}

}  // namespace

Recorder::Recorder(std::uint64_t instance, WorldId me, Step dump_first, Step dump_last, Step pose_every,
                   Reports& reports, ViewFeed& feed)
    : instance_(instance),
      me_(me),
      dump_first_(dump_first),
      dump_last_(dump_last),
      pose_every_(pose_every),
      reports_(reports),
      feed_(feed) {
  batch_.instance(instance);
  batch_.world(me);
}

void Recorder::finalised(Step step, const border::Produced& produced) {
  if (batch_.hashes().empty()) {
    batch_.first(step);
    batch_since_ = Clock::now();
  }
  batch_.bodies().push_back(static_cast<std::uint32_t>(produced.bodies()));
  batch_.hashes().push_back(produced.hash());
  if (batch_.hashes().size() >= kBatchSteps) flush();
  if (dump_first_ >= 0 && step >= dump_first_ && step <= dump_last_) report_state(step, produced.all());
  if (pose_every_ > 0 && step % pose_every_ == 0) report_poses(step, produced.all());
  feed_.finalised(step, produced);
}

void Recorder::flush_if_due(Clock::time_point now) {
  if (!batch_.hashes().empty() && now - batch_since_ >= kBatchAge) flush();
}

void Recorder::flush() {
  if (batch_.hashes().empty()) return;
  reports_.digests(batch_);
  batch_.bodies().clear();
  batch_.hashes().clear();
}

void Recorder::report_state(Step step, const BodySet& produced) {
  std::span<const BodyState> bodies(produced.bodies);
  std::span<const ContactRecord> contacts(produced.contacts);
  wire::StateChunk chunk;
  chunk.instance(instance_);
  chunk.world(me_);
  chunk.step(step);
  chunk.bodies_total(bodies.size());
  chunk.contacts_total(contacts.size());
  do {  // at least one, so that a world without bodies is heard of too
    std::size_t room = dds::kMaxChunkBytes;
    chunk.bodies(octets(take(bodies, room)));
    chunk.contacts(octets(take(contacts, room)));
    reports_.state(chunk);
  } while (!bodies.empty() || !contacts.empty());
}

void Recorder::report_poses(Step step, const BodySet& produced) {
  std::vector<std::pair<BodyId, Pose7>> moved;
  for (const BodyState& body : produced.bodies) {
    Pose7 pose;
    for (int i = 0; i < 3; ++i) pose[i] = static_cast<float>(body.position[i]);
    for (int i = 0; i < 4; ++i) pose[3 + i] = static_cast<float>(body.orientation[i]);
    auto& [when, last] = posed_[body.id];
    // A body that was elsewhere in between may have moved there and back.
    if (when != step - pose_every_ || last != pose) moved.emplace_back(body.id, pose);
    when = step;
    last = pose;
  }
  wire::Poses sample;
  sample.instance(instance_);
  sample.world(me_);
  sample.step(step);
  sample.total(static_cast<std::uint32_t>(moved.size()));
  for (std::size_t first = 0;; first += dds::kMaxPoses) {
    const std::size_t end = std::min(moved.size(), first + dds::kMaxPoses);
    sample.ids().clear();
    sample.values().clear();
    for (std::size_t i = first; i < end; ++i) {
      sample.ids().push_back(moved[i].first);
      sample.values().insert(sample.values().end(), moved[i].second.begin(), moved[i].second.end());
    }
    reports_.poses(sample);
    if (end == moved.size()) break;
  }
  std::erase_if(posed_, [&](const auto& entry) { return entry.second.first != step; });
}

}  // namespace soda::world
