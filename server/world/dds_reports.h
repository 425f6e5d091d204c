// Reports over DDS.
#pragma once

#include <atomic>
#include <functional>

#include "common/dds/participant.h"
#include "server/world/reports.h"

namespace soda::world {

class DdsReports final : public Reports {
 public:
  // `supervised`: somebody waits for this world's digests, and must have been met before the start. `with_states`,
  // `with_poses`: whole states, or poses, are to be reported. `give_up` ends the waiting for a slow reader.
  DdsReports(dds::Participant& participant, std::uint64_t instance, WorldId me, bool supervised, bool with_states,
             bool with_poses, std::function<bool()> give_up);

  bool listened_to() const override;
  void status(const wire::Status& sample) override;
  void digests(const wire::Digests& sample) override;
  void state(const wire::StateChunk& sample) override;
  void poses(const wire::Poses& sample) override;
  void transfer(const wire::Transfer& sample) override;
  bool wants_transforms() const override { return transforms_.matched(); }
  bool take_lack() override { return lack_.exchange(false); }
  void transforms(const wire::Transforms& sample) override;
  bool finish(std::chrono::milliseconds at_most) override;

 private:
  const bool supervised_;
  const std::function<bool()> give_up_;
  std::atomic<bool> lack_{false};
  dds::Writer<wire::Status> status_;
  dds::Writer<wire::Digests> digests_;
  dds::Writer<wire::Transfer> transfers_;
  dds::Writer<wire::Transforms> transforms_;
  dds::Reader<wire::Lack> lacks_;
  std::unique_ptr<dds::Writer<wire::StateChunk>> states_;
  std::unique_ptr<dds::Writer<wire::Poses>> poses_;
};

}  // namespace soda::world
