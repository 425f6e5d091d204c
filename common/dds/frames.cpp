#include "common/dds/frames.h"

#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include "common/dds/cdr.h"

namespace soda::dds {
namespace {

constexpr std::size_t kHeader = 8;                        // bytes
constexpr std::size_t kMaxFrame = std::size_t{16} << 20;  // bytes; the largest report is a state chunk of 512 KiB
constexpr std::size_t kReadSize = 64 * 1024;              // a pipe's capacity

void write_all(int fd, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw std::system_error(errno, std::generic_category(), "writing a report");
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
}

template <std::size_t... Is>
std::string decode_as(std::size_t kind, std::span<const std::byte> bytes, Report& out, std::index_sequence<Is...>) {
  std::string refusal = "unknown kind";
  (void)((kind == Is && (refusal = decode(bytes, out.emplace<Is>()), true)) || ...);
  return refusal;
}

}  // namespace

void FrameWriter::write(const Report& report) {
  const std::vector<std::byte> body = std::visit([](const auto& sample) { return encode(sample); }, report);
  const std::uint32_t header[2] = {static_cast<std::uint32_t>(report.index()), static_cast<std::uint32_t>(body.size())};
  std::vector<std::byte> frame(kHeader + body.size());
  std::memcpy(frame.data(), header, kHeader);
  std::memcpy(frame.data() + kHeader, body.data(), body.size());
  write_all(fd_, frame);
}

std::optional<Report> FrameReader::take() {
  if (buffer_.size() - begin_ < kHeader) return std::nullopt;
  std::uint32_t header[2];
  std::memcpy(header, buffer_.data() + begin_, kHeader);
  if (header[1] > kMaxFrame) throw std::runtime_error("a report of impossible length");
  if (buffer_.size() - begin_ < kHeader + header[1]) return std::nullopt;
  Report report;
  const std::span body(buffer_.data() + begin_ + kHeader, header[1]);
  const std::string refusal =
      decode_as(header[0], body, report, std::make_index_sequence<std::variant_size_v<Report>>());
  if (!refusal.empty()) throw std::runtime_error("a report was refused: " + refusal);
  begin_ += kHeader + header[1];
  return report;
}

std::optional<Report> FrameReader::next(std::chrono::milliseconds at_most) {
  const auto until = std::chrono::steady_clock::now() + at_most;
  for (;;) {
    if (auto report = take()) return report;
    if (closed_) return std::nullopt;
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - std::chrono::steady_clock::now());
    pollfd wait{fd_, POLLIN, 0};
    const int ready = ::poll(&wait, 1, static_cast<int>(std::max<std::int64_t>(0, left.count())));
    if (ready <= 0) return std::nullopt;  // time is up, or a signal came: the caller looks after both
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(begin_));
    begin_ = 0;
    const std::size_t had = buffer_.size();
    buffer_.resize(had + kReadSize);
    const ssize_t n = ::read(fd_, buffer_.data() + had, kReadSize);
    buffer_.resize(had + static_cast<std::size_t>(std::max<ssize_t>(0, n)));
    if (n == 0 || (n < 0 && errno != EINTR && errno != EAGAIN)) closed_ = true;
  }
}

}  // namespace soda::dds
