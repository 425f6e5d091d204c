// Shared memory that processes left behind: Fast DDS removes its segments (16 MiB each here) only on a clean end, and
// its ports not always then.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>

namespace soda::dds {

// Removes segments and ports of Fast DDS that no process holds any more, and returns how many. Their owner holds a lock
// (flock) on the file NAME_el beside them for as long as it lives; what nobody holds and is older than `min_age` (so
// that nobody is about to take it) belongs to nobody. Files of other users and whatever else is in doubt stay.
std::size_t remove_stale_shm(const std::filesystem::path& directory = "/dev/shm",
                             std::chrono::seconds min_age = std::chrono::minutes(1));

}  // namespace soda::dds
