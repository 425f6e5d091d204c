#include "common/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace soda {
namespace {

constexpr std::size_t kGather = std::size_t{1} << 18;  // bytes

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path path)
    : path_(std::move(path)), folder_(path_.has_parent_path() ? path_.parent_path() : std::filesystem::path(".")) {
  // In the same folder, because a name can only be given within one file system.
  temporary_ = (folder_ / ("." + path_.filename().string() + ".XXXXXX")).string();
  file_ = ::mkstemp(temporary_.data());
  if (file_ < 0) fail("cannot be written");
}

AtomicFile::~AtomicFile() {
  if (file_ < 0) return;
  ::close(file_);
  ::unlink(temporary_.c_str());
}

void AtomicFile::fail(const char* what) const {
  throw FileError(path_, std::string(what) + ": " + std::strerror(errno));
}

void AtomicFile::write(std::string_view bytes) {
  if (gathered_.size() + bytes.size() > kGather) write_out(std::exchange(gathered_, {}));
  if (bytes.size() > kGather)
    write_out(bytes);
  else
    gathered_ += bytes;
}

void AtomicFile::write_out(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(file_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail("cannot be written");
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
}

void AtomicFile::commit() {
  write_out(std::exchange(gathered_, {}));
  const mode_t mask = ::umask(0);  // mkstemp makes private files; these are shared like any other
  ::umask(mask);
  if (::fchmod(file_, 0666 & ~mask) != 0 || ::fsync(file_) != 0) fail("cannot be written");
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) fail("cannot be given its name");
  ::close(std::exchange(file_, -1));
  if (const int directory = ::open(folder_.c_str(), O_RDONLY | O_DIRECTORY); directory >= 0) {
    ::fsync(directory);
    ::close(directory);
  }
}

}  // namespace soda
