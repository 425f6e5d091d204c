// Where the command hears of a run: DDS, or the pipe of a single world. Both give the same reports.
#pragma once

#include <chrono>
#include <optional>

#include "common/dds/frames.h"

namespace soda::cli {

class ReportSource {
 public:
  virtual ~ReportSource() = default;
  // The next report, waiting for it as long as that.
  virtual std::optional<dds::Report> next(std::chrono::milliseconds at_most) = 0;
  // Whether nothing can come any more.
  virtual bool closed() const { return false; }
};

class PipeSource final : public ReportSource {
 public:
  explicit PipeSource(int fd) : frames_(fd) {}  // not owned
  std::optional<dds::Report> next(std::chrono::milliseconds at_most) override { return frames_.next(at_most); }
  bool closed() const override { return frames_.closed(); }

 private:
  dds::FrameReader frames_;
};

}  // namespace soda::cli
