// Reports through a pipe: where there is no network, the one world tells the command the same samples that it would
// otherwise publish. A frame is {kind, length: 32 bits each, little-endian; `length` bytes of CDR}.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <variant>
#include <vector>

#include "idl/soda.h"

namespace soda::dds {

// What a world reports to whoever started it, over DDS or a pipe. The index is the kind in a frame.
using Report = std::variant<wire::Session, wire::Status, wire::Digests, wire::StateChunk, wire::Poses, wire::LogEntry,
                            wire::Control>;

class FrameWriter {
 public:
  explicit FrameWriter(int fd) : fd_(fd) {}  // not owned; blocking
  // Blocks until all is in the pipe. Throws std::system_error when the other end is gone (SIGPIPE must be ignored).
  void write(const Report& report);

 private:
  int fd_;
};

class FrameReader {
 public:
  explicit FrameReader(int fd) : fd_(fd) {}  // not owned
  // The next report, waiting for it as long as that; none when the time is up or the other end was closed.
  // Throws std::runtime_error for a frame that is refused.
  std::optional<Report> next(std::chrono::milliseconds at_most);
  bool closed() const { return closed_; }

 private:
  std::optional<Report> take();

  int fd_;
  bool closed_ = false;
  std::vector<std::byte> buffer_;  // what was read and not taken yet
  std::size_t begin_ = 0;          // of that, the first byte not taken
};

}  // namespace soda::dds
