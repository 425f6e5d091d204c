// The outer form of a .glb file: arrays in memory become accessors of the JSON and, one after the other, the binary
// chunk, without being copied. Knows nothing of bodies.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>
#include <vector>

#include "client/export/tracks.h"

namespace soda::gltf {

using Json = nlohmann::json;

// Kinds of arrays, each of which has one bufferView.
enum class View { kPositions, kNormals, kIndices, kTimes, kVectors, kRotations };
constexpr std::size_t kViews = 6;

class GlbContainer {
 public:
  // The document; lists in it are there only if something is in them, as the format wants it.
  Json json;

  // Appends to a list of the document; returns the index.
  std::size_t append(const char* list, Json value);

  // The bytes, of a length that is a multiple of four, must stay until write(). Returns their offset in the view.
  std::uint64_t add(View view, std::span<const std::byte> bytes);
  // `count` elements (SCALAR, VEC3, VEC4) of a view, from an offset on. Returns the accessor's index.
  std::size_t accessor(View view, std::uint64_t offset, std::size_t count, const char* type);
  // Both at once, of the whole of an array: `components` numbers make up an element.
  template <class T>
  std::size_t array(View view, std::span<const T> numbers, std::size_t components) {
    static constexpr std::array<const char*, 5> kTypes{"", "SCALAR", "", "VEC3", "VEC4"};
    return accessor(view, add(view, std::as_bytes(numbers)), numbers.size() / components, kTypes.at(components));
  }

  // Completes the document and writes the file; returns its length in bytes. As write_glb.
  std::uint64_t write(const std::filesystem::path& path, const Progress& progress);

 private:
  struct Content {
    std::vector<std::span<const std::byte>> pieces;
    std::uint64_t size = 0;  // bytes
  };
  std::uint64_t add_views();

  std::array<Content, kViews> views_;
};

}  // namespace soda::gltf
