#include "client/export/glb_container.h"

#include <bit>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "common/atomic_file.h"

namespace soda::gltf {
namespace {

static_assert(std::endian::native == std::endian::little, "arrays are written as they are in memory");

// Numbers that the format gives names to (sections 3.6 and 4.4).
constexpr int kFloat = 5126, kUnsignedInt = 5125;                 // accessor.componentType
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;  // bufferView.target
constexpr std::uint32_t kMagic = 0x46546c67, kVersion = 2, kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
constexpr std::uint64_t kHeader = 12, kChunkHeader = 8;  // bytes
constexpr std::uint64_t kProgressEvery = std::uint64_t{1} << 22;

std::string words(std::initializer_list<std::uint32_t> values) {
  std::string bytes;
  for (const std::uint32_t value : values) bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  return bytes;
}

}  // namespace

std::size_t GlbContainer::append(const char* list, Json value) {
  json[list].push_back(std::move(value));
  return json[list].size() - 1;
}

std::uint64_t GlbContainer::add(View view, std::span<const std::byte> bytes) {
  Content& content = views_[static_cast<std::size_t>(view)];
  content.pieces.push_back(bytes);
  content.size += bytes.size();
  return content.size - bytes.size();
}

std::size_t GlbContainer::accessor(View view, std::uint64_t offset, std::size_t count, const char* type) {
  return append("accessors", {{"bufferView", static_cast<std::size_t>(view)},  // until add_views()
                              {"byteOffset", offset},
                              {"componentType", view == View::kIndices ? kUnsignedInt : kFloat},
                              {"count", count},
                              {"type", type}});
}

// bufferViews of what is there, and accessors that refer to them. Returns the length of the binary chunk.
std::uint64_t GlbContainer::add_views() {
  std::uint64_t size = 0;
  std::array<std::size_t, kViews> index{};
  for (std::size_t v = 0; v < kViews; ++v) {
    if (views_[v].size == 0) continue;
    Json view{{"buffer", 0}, {"byteOffset", size}, {"byteLength", views_[v].size}};
    const bool vertices =
        v == static_cast<std::size_t>(View::kPositions) || v == static_cast<std::size_t>(View::kNormals);
    if (vertices) view["byteStride"] = 3 * sizeof(float);
    if (vertices) view["target"] = kArrayBuffer;
    if (v == static_cast<std::size_t>(View::kIndices)) view["target"] = kElementArrayBuffer;
    size += views_[v].size;
    index[v] = append("bufferViews", std::move(view));
  }
  if (size == 0) return 0;
  for (Json& accessor : json["accessors"]) accessor["bufferView"] = index[accessor["bufferView"].get<std::size_t>()];
  append("buffers", {{"byteLength", size}});
  return size;
}

std::uint64_t GlbContainer::write(const std::filesystem::path& path, const Progress& progress) {
  const std::uint64_t binary = add_views();
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::uint64_t total = kHeader + kChunkHeader + text.size() + (binary > 0 ? kChunkHeader + binary : 0);
  if (total > std::numeric_limits<std::uint32_t>::max())
    throw std::invalid_argument(
        path.string() + ": would take " + std::to_string(total >> 20) +
        " MiB, a .glb can have 4096: leave out samples (--every) or export a part (--from, --to)");
  AtomicFile file(path);
  file.write(words(
      {kMagic, kVersion, static_cast<std::uint32_t>(total), static_cast<std::uint32_t>(text.size()), kJsonChunk}));
  file.write(text);
  if (binary > 0) file.write(words({static_cast<std::uint32_t>(binary), kBinaryChunk}));
  std::uint64_t done = 0, told = 0;
  for (const Content& content : views_)
    for (const auto piece : content.pieces) {
      file.write({reinterpret_cast<const char*>(piece.data()), piece.size()});
      done += piece.size();
      if (!progress || (done - told < kProgressEvery && done < binary)) continue;
      progress(done, binary);
      told = done;
    }
  file.commit();
  return total;
}

}  // namespace soda::gltf
