// The page's files, as the build made them, held in memory.
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace soda::viewer {

struct StaticFile {
  std::string bytes, type;  // type: as in Content-Type
};

class StaticFiles {
 public:
  // All files below `folder`. Throws std::runtime_error where there is no page.
  explicit StaticFiles(const std::filesystem::path& folder);
  // By the path of a URL, "/" being the page; null if there is none.
  const StaticFile* find(const std::string& path) const;

 private:
  std::map<std::string, StaticFile> files_;
};

// Where the build has put the page, seen from the running program: ../share/soda/viewer.
std::filesystem::path page_folder();

}  // namespace soda::viewer
