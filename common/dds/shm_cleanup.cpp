#include "common/dds/shm_cleanup.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <ctime>
#include <string>
#include <string_view>
#include <system_error>

namespace soda::dds {
namespace {

constexpr std::string_view kPrefix = "fastrtps_", kLock = "_el", kPort = "port";

bool all_of(std::string_view text, std::string_view characters) {
  return !text.empty() && text.find_first_not_of(characters) == std::string_view::npos;
}
// "fastrtps_" and 16 hexadecimal digits.
bool is_segment(std::string_view name) {
  return name.starts_with(kPrefix) && name.size() == kPrefix.size() + 16 &&
         all_of(name.substr(kPrefix.size()), "0123456789abcdef");
}
// "fastrtps_port" and a number. One without a lock file was never read, or its reader has left it.
bool is_port(std::string_view name) {
  return name.starts_with(kPrefix) && name.substr(kPrefix.size()).starts_with(kPort) &&
         all_of(name.substr(kPrefix.size() + kPort.size()), "0123456789");
}

// Whether the file is ours, old enough, and its lock held by nobody.
bool is_stale(const std::filesystem::path& file, const std::filesystem::path& lock, std::chrono::seconds min_age) {
  struct stat info {};
  if (::lstat(file.c_str(), &info) != 0 || !S_ISREG(info.st_mode) || info.st_uid != ::geteuid() ||
      std::time(nullptr) - info.st_mtime < min_age.count())
    return false;
  const int fd = ::open(lock.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (fd < 0) return errno == ENOENT;
  const bool stale = ::fstat(fd, &info) == 0 && info.st_uid == ::geteuid() &&
                     std::time(nullptr) - info.st_mtime >= min_age.count() && ::flock(fd, LOCK_EX | LOCK_NB) == 0;
  ::close(fd);
  return stale;
}

}  // namespace

std::size_t remove_stale_shm(const std::filesystem::path& directory, std::chrono::seconds min_age) {
  std::size_t removed = 0;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(directory, error)) {
    const std::string name = entry.path().filename().string();
    const std::filesystem::path lock = directory / (name + std::string(kLock));
    std::error_code ignored;  // another process may be cleaning up, too
    // A segment is made before its lock: one without belongs to somebody who is just starting, or is not one of ours.
    if (is_segment(name) ? !std::filesystem::exists(lock, ignored) : !is_port(name)) continue;
    if (!is_stale(entry.path(), lock, min_age)) continue;
    if (std::filesystem::remove(entry.path(), ignored)) ++removed;
    std::filesystem::remove(lock, ignored);
    if (is_port(name)) std::filesystem::remove(directory / ("sem." + name + "_mutex"), ignored);
  }
  return removed;
}

}  // namespace soda::dds
