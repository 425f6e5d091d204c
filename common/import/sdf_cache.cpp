#include "common/import/sdf_cache.h"

#include <xxhash.h>
#include <zstd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <set>

#include "common/import/sdf_document.h"
#include "common/scene/scene_file.h"

namespace soda {
namespace {

namespace fs = std::filesystem;

// To be raised whenever the same SDF gives another scene: it is part of every key.
constexpr const char* kConverter = "soda sdf converter 2\n";
constexpr std::size_t kMaxEntries = 200;
constexpr std::size_t kMaxUnpacked = std::size_t{4} << 30;  // bytes; what a damaged entry may make us allocate

std::string hash_of(const std::string& bytes) {
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
  char text[40];
  std::snprintf(text, sizeof text, "%016llx%016llx", static_cast<unsigned long long>(hash.high64),
                static_cast<unsigned long long>(hash.low64));
  return text;
}

std::string content_of(const fs::path& file) {
  try {
    return "has " + hash_of(read_file(file));
  } catch (const SceneError&) {
    return "missing";
  }
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t start = 0; start < text.size();) {
    std::size_t end = text.find('\n', start);
    if (end == std::string::npos) end = text.size();
    lines.push_back(text.substr(start, end - start));
    start = end + 1;
  }
  return lines;
}

// Warnings are lines of text; the scene follows after an empty line and checks itself.
std::string pack(const Converted& converted) {
  std::string plain;
  for (std::string line : converted.warnings) {
    std::replace(line.begin(), line.end(), '\n', ' ');
    plain += "warning " + line + "\n";
  }
  plain += "\n" + converted.scene;
  std::string packed(ZSTD_compressBound(plain.size()), '\0');
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), plain.data(), plain.size(), 3);
  if (ZSTD_isError(size)) return {};
  packed.resize(size);
  return packed;
}

std::optional<Converted> unpack(const std::string& packed) {
  const unsigned long long size = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN || size > kMaxUnpacked) return {};
  std::string plain(size, '\0');
  if (ZSTD_isError(ZSTD_decompress(plain.data(), plain.size(), packed.data(), packed.size()))) return {};
  Converted converted;
  std::size_t start = 0;
  for (const std::string prefix = "warning "; plain.compare(start, prefix.size(), prefix) == 0;) {
    const std::size_t end = plain.find('\n', start);
    if (end == std::string::npos) return {};
    converted.warnings.push_back(plain.substr(start + prefix.size(), end - start - prefix.size()));
    start = end + 1;
  }
  if (start >= plain.size() || plain[start] != '\n') return {};
  converted.scene = plain.substr(start + 1);
  return converted;
}

// The oldest entries go when there are too many.
void tidy(const fs::path& folder) {
  std::error_code error;
  std::vector<std::pair<fs::file_time_type, fs::path>> entries;
  for (const auto& entry : fs::directory_iterator(folder, error))
    entries.emplace_back(entry.last_write_time(error), entry.path());
  if (entries.size() <= kMaxEntries) return;
  std::sort(entries.begin(), entries.end());
  for (std::size_t i = 0; i + kMaxEntries < entries.size(); ++i) fs::remove(entries[i].second, error);
}

}  // namespace

fs::path SdfCache::folder() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache == '/')
    return fs::path(cache) / "soda" / "sdf";
  if (const char* home = std::getenv("HOME"); home && *home == '/') return fs::path(home) / ".cache" / "soda" / "sdf";
  return {};
}

SdfCache::SdfCache(const fs::path& path, const std::string& sdf)
    : base_(fs::absolute(path).parent_path()), sdf_hash_(hash_of(kConverter + resource_paths() + sdf)) {}

std::string SdfCache::result_name(const std::vector<std::string>& names) const {
  std::string all = sdf_hash_ + "\n";
  for (const std::string& name : names) all += name + " " + content_of(base_ / name) + "\n";
  return hash_of(all) + ".scene.zst";
}

std::optional<Converted> SdfCache::find() const {
  if (folder().empty()) return {};
  try {
    const std::vector<std::string> names = lines_of(read_file(folder() / (sdf_hash_ + ".deps")));
    return unpack(read_file(folder() / result_name(names)));
  } catch (const SceneError&) {
    return {};  // not there
  }
}

void SdfCache::store(const Converted& converted, const std::vector<fs::path>& files) const {
  if (folder().empty()) return;
  std::error_code error;
  fs::create_directories(folder(), error);
  if (error) return;
  std::set<std::string> names;  // in a fixed order, each once
  for (const fs::path& file : files) {
    const fs::path absolute = fs::absolute(file).lexically_normal(), relative = absolute.lexically_relative(base_);
    const bool below = !relative.empty() && *relative.begin() != "..";
    const std::string name = (below ? relative : absolute).string();
    if (name.find('\n') != std::string::npos) return;
    names.insert(name);
  }
  std::string list;
  for (const std::string& name : names) list += name + "\n";
  try {
    const std::string packed = pack(converted);
    if (packed.empty()) return;
    write_file(folder() / result_name({names.begin(), names.end()}), packed);
    write_file(folder() / (sdf_hash_ + ".deps"), list);
  } catch (const SceneError&) {
    return;  // a full disk, say: then there is no cache
  }
  tidy(folder());
}

}  // namespace soda
