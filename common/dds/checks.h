// What a sample must be like to be let in. The limits are generous: they keep nonsense from costing memory or crashing
// anything. Whether a sample makes sense in a session (which world, which step) its receiver decides.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/ids.h"
#include "idl/soda.h"

namespace eprosima::fastcdr {
class Cdr;
}

namespace soda::dds {

using soda::kMaxWorlds;
constexpr std::int64_t kMaxStepNumber = std::int64_t{1} << 40;  // 500 years at 60 Hz
constexpr std::size_t kMaxChunkBytes = 512 * 1024;              // of a scene or a state in one sample
constexpr std::size_t kMaxBorderBytes = 256 * 1024 * 1024;      // of one border message
constexpr std::uint64_t kMaxSceneBytes = std::uint64_t{1} << 32;
constexpr std::size_t kMaxPoses = 16384;          // in one sample
constexpr std::size_t kMaxDigests = 65536;        // steps in one sample
constexpr std::size_t kMaxTransferCells = 65536;  // in one transfer; the balancer gives at most 4,096
constexpr std::size_t kMaxText = 1024;            // bytes of any string

// Whether the lengths of the sample's sequences fit into what follows them. Run before the sample is taken apart,
// because Fast CDR allocates what a length says before it looks for the elements. True for types without sequences.
template <class T>
bool lengths_fit(eprosima::fastcdr::Cdr& cdr);

// What is wrong with the sample's values, or "".
std::string problem(const wire::Session& s);
std::string problem(const wire::SceneChunk& s);
std::string problem(const wire::Join& s);
std::string problem(const wire::Admission& s);
std::string problem(const wire::Control& s);
std::string problem(const wire::Border& s);
std::string problem(const wire::Request& s);
std::string problem(const wire::Answer& s);
std::string problem(const wire::LogEntry& s);
std::string problem(const wire::Status& s);
std::string problem(const wire::Digests& s);
std::string problem(const wire::StateChunk& s);
std::string problem(const wire::Poses& s);
std::string problem(const wire::Transforms& s);
std::string problem(const wire::Transfer& s);
std::string problem(const wire::Lack& s);

// Whether a name may be a session's: 1 to 64 letters, digits, dots, dashes and underscores. (It becomes a DDS
// partition, in which * and ? would match others.)
bool good_session_name(const std::string& name);
// Throws std::invalid_argument, in the words of the option --session, unless it is one.
void check_session_name(const std::string& name);

}  // namespace soda::dds
