// Reports through an inherited pipe: no DDS at all (frames.h).
#pragma once

#include <functional>
#include <mutex>

#include "common/dds/frames.h"
#include "server/world/reports.h"

namespace soda::world {

class PipeReports final : public Reports {
 public:
  // `fd`: -1 for none; then only `on_status` hears anything.
  PipeReports(int fd, std::function<void(const wire::Status&)> on_status)
      : fd_(fd), out_(fd), on_status_(std::move(on_status)) {}

  void session(const wire::Session& sample) { write(sample); }
  bool listened_to() const override { return true; }
  void status(const wire::Status& sample) override {
    on_status_(sample);
    write(sample);
  }
  void digests(const wire::Digests& sample) override { write(sample); }
  void state(const wire::StateChunk& sample) override { write(sample); }
  void poses(const wire::Poses& sample) override { write(sample); }
  void transfer(const wire::Transfer&) override {}  // a world that is alone has nobody to give to
  // What the session service says; from its thread.
  void control(const wire::Control& sample) { write(sample); }
  void entry(const wire::LogEntry& sample) { write(sample); }
  bool wants_transforms() const override { return false; }
  bool take_lack() override { return false; }
  void transforms(const wire::Transforms&) override {}
  bool finish(std::chrono::milliseconds) override { return true; }  // what is in the pipe stays there

 private:
  void write(const dds::Report& report) {
    const std::lock_guard lock(mutex_);
    if (fd_ >= 0) out_.write(report);
  }

  std::mutex mutex_;
  int fd_;
  dds::FrameWriter out_;
  std::function<void(const wire::Status&)> on_status_;
};

}  // namespace soda::world
