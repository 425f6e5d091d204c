#include "common/dds/shm_cleanup.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ctime>
#include <string>
#include <string_view>
#include <system_error>

namespace soda::dds {
namespace {

constexpr std::string_view kPrefix = "fastrtps_", kLock = "_el";

// "fastrtps_", 16 hexadecimal digits, "_el": a segment's lock, and not a port's.
bool is_segment_lock(const std::string& name) {
  constexpr std::size_t kDigits = 16;
  return name.size() == kPrefix.size() + kDigits + kLock.size() && name.starts_with(kPrefix) && name.ends_with(kLock) &&
         name.find_first_not_of("0123456789abcdef", kPrefix.size()) == kPrefix.size() + kDigits;
}

// Whether the file is ours, old enough, and held by nobody.
bool is_stale(const std::filesystem::path& lock, std::chrono::seconds min_age) {
  const int fd = ::open(lock.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (fd < 0) return false;
  struct stat info {};
  const bool stale = ::fstat(fd, &info) == 0 && info.st_uid == ::geteuid() &&
                     std::time(nullptr) - info.st_mtime >= min_age.count() && ::flock(fd, LOCK_EX | LOCK_NB) == 0;
  ::close(fd);
  return stale;
}

}  // namespace

std::size_t remove_stale_segments(const std::filesystem::path& directory, std::chrono::seconds min_age) {
  std::size_t removed = 0;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(directory, error)) {
    const std::string name = entry.path().filename().string();
    if (!is_segment_lock(name) || !is_stale(entry.path(), min_age)) continue;
    const std::string segment = name.substr(0, name.size() - kLock.size());
    std::error_code ignored;  // another run may be cleaning up, too
    std::filesystem::remove(directory / segment, ignored);
    if (std::filesystem::remove(entry.path(), ignored)) ++removed;
  }
  return removed;
}

}  // namespace soda::dds
