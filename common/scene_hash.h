// The name of a scene among processes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace soda {

// XXH3 of the bytes of encode_scene(); never 0, which means "any scene" where one is asked for.
std::uint64_t scene_hash(std::string_view encoded_scene);

// 16 hexadecimal digits, as hashes are written everywhere.
std::string to_hex(std::uint64_t hash);

}  // namespace soda
