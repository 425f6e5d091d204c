#include "common/scene_hash.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

namespace soda {

std::uint64_t scene_hash(std::string_view encoded_scene) {
  const std::uint64_t hash = XXH3_64bits(encoded_scene.data(), encoded_scene.size());
  return hash == 0 ? 1 : hash;
}

std::string to_hex(std::uint64_t hash) {
  std::string text(16, '0');
  for (std::size_t i = text.size(); i-- > 0; hash >>= 4) text[i] = "0123456789abcdef"[hash & 15];
  return text;
}

}  // namespace soda
