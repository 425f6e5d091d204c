// Keeps converted scenes by the content of what they were made from. A cache that cannot be used is no error.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace soda {

// What a conversion made: the bytes of a .scene file and the warnings.
struct Converted {
  std::string scene;
  std::vector<std::string> warnings;
};

// For one SDF file. Two kinds of files: `<hash of the SDF>.deps` lists what the SDF refers to, as found when it was
// last converted; `<hash of the SDF, that list and all content>.scene.zst` is the result. An entry is used only when
// every file in the list has the content that it had, so a changed mesh, a moved one or another folder with a file of
// the same name is always noticed.
class SdfCache {
 public:
  // `sdf` is the content of the file at `path`.
  SdfCache(const std::filesystem::path& path, const std::string& sdf);

  std::optional<Converted> find() const;
  // `files` are all other files that were read.
  void store(const Converted& converted, const std::vector<std::filesystem::path>& files) const;

  // The folder; empty where there is none (no home).
  static std::filesystem::path folder();

 private:
  std::string result_name(const std::vector<std::string>& names) const;

  std::filesystem::path base_;  // folder of the SDF file; names in the list are relative to it where they can be
  std::string sdf_hash_;
};

}  // namespace soda
