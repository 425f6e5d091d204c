// Shared memory that killed processes left behind: Fast DDS removes its segments (16 MiB each here) only on a clean
// end.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>

namespace soda::dds {

// Removes segments of Fast DDS that no process holds any more, and returns how many. A segment's owner holds a lock
// (flock) on the file NAME_el beside it for as long as it lives; what nobody holds and is older than `min_age` (so that
// nobody is about to take it) belongs to nobody. Files of other users and whatever else is in doubt stay.
std::size_t remove_stale_segments(const std::filesystem::path& directory = "/dev/shm",
                                  std::chrono::seconds min_age = std::chrono::minutes(1));

}  // namespace soda::dds
