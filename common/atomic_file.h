// A file that is there whole or not at all: readers, and crashes, see what was there before or what is there now.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace soda {

// what() names the file and the reason.
struct FileError : std::runtime_error {
  FileError(std::filesystem::path path_, std::string reason_)
      : std::runtime_error(path_.string() + ": " + reason_), path(std::move(path_)), reason(std::move(reason_)) {}
  std::filesystem::path path;
  std::string reason;
};

// Writes to a file beside the wanted one, which then takes its name. Without commit(), nothing is left.
class AtomicFile {
 public:
  // Throws FileError, as all below.
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(std::string_view bytes);
  // All that was written is on the disk when it returns, under the file's name.
  void commit();

 private:
  void write_out(std::string_view bytes);
  [[noreturn]] void fail(const char* what) const;

  std::filesystem::path path_, folder_;
  std::string temporary_;
  std::string gathered_;  // not written yet, so that small pieces are cheap
  int file_ = -1;
};

}  // namespace soda
