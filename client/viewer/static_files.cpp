#include "client/viewer/static_files.h"

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace soda::viewer {
namespace {

std::string type_of(const std::filesystem::path& path) {
  static const std::map<std::string, std::string> kTypes = {{".html", "text/html; charset=utf-8"},
                                                            {".js", "text/javascript; charset=utf-8"},
                                                            {".css", "text/css; charset=utf-8"},
                                                            {".json", "application/json"},
                                                            {".svg", "image/svg+xml"},
                                                            {".png", "image/png"},
                                                            {".ico", "image/x-icon"},
                                                            {".txt", "text/plain; charset=utf-8"}};
  const auto type = kTypes.find(path.extension().string());
  return type == kTypes.end() ? "application/octet-stream" : type->second;
}

}  // namespace

StaticFiles::StaticFiles(const std::filesystem::path& folder) {
  std::error_code error;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder, error)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream file(entry.path(), std::ios::binary);
    std::ostringstream bytes;
    bytes << file.rdbuf();
    files_["/" + entry.path().lexically_relative(folder).generic_string()] = {bytes.str(), type_of(entry.path())};
  }
  if (!find("/"))
    throw std::runtime_error("the viewer's page was not built (no index.html in " + folder.string() +
                             "): install Node.js 18 or later and build again");
}

const StaticFile* StaticFiles::find(const std::string& path) const {
  const auto file = files_.find(path == "/" ? "/index.html" : path);
  return file == files_.end() ? nullptr : &file->second;
}

std::filesystem::path page_folder() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path() / "share/soda/viewer";
}

}  // namespace soda::viewer
