// Recordings in files.
//
// Layout, everything little-endian: 8 bytes "SODArec\n", u32 version, u32 0, u64 scene hash; then blocks: u32 length,
// u32 length once decompressed, u64 XXH3 of what follows; `length` bytes of zstd, which hold a soda.pb.RecordedBlock.
// What was written is with the system once a second, so that a process that is killed loses no more; a file that ends
// in the middle of a block is good up to there.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/actions/action_proto.h"
#include "common/ids.h"
#include "common/scene/scene.h"
#include "recording.pb.h"

namespace soda {

// what() names the file.
struct RecordingError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct StepDigest {
  std::uint64_t bodies = 0, hash = 0;
  bool operator==(const StepDigest&) const = default;
};

class RecordingWriter {
 public:
  // Creates the file at once, so that it is said early where it cannot be. Throws RecordingError, as all below.
  explicit RecordingWriter(std::filesystem::path path);
  // First of all, once.
  void begin(std::uint64_t scene_hash, const std::string& encoded_scene, const pb::RecordedSettings& settings);
  void add_action(ActionNumber number, std::string_view encoded);
  void add_digest(Step step, const StepDigest& digest);  // steps in order
  void add_poses(pb::RecordedPoses poses);
  // Writes what has been gathered, if that is old or much.
  void flush_if_due();
  void close(bool complete);

 private:
  pb::RecordedItem& next() { return *block_.add_item(); }
  void flush();

  std::filesystem::path path_;
  std::ofstream file_;
  pb::RecordedBlock block_;
  std::size_t items_ = 0;  // of the block, about
  std::chrono::steady_clock::time_point flushed_ = std::chrono::steady_clock::now();
};

// What is needed to run it again, and to compare.
struct Recording {
  std::uint64_t scene_hash = 0;
  pb::RecordedSettings settings;
  std::string encoded_scene;
  Scene scene;
  std::vector<LoggedAction> actions;
  std::vector<StepDigest> digests;       // of steps 0, 1, ...
  std::vector<pb::RecordedPoses> poses;  // good, in order, none after the last digest
  bool complete = false;                 // the run came to its end
  std::string cut;                       // why the file is not whole, or ""
  bool damaged = false;                  // since somebody has changed it, or a disk
};

// Throws RecordingError, which names `file`, unless each body has a place and a unit quaternion.
void check_poses(const pb::RecordedPoses& poses, const std::string& file);

// Throws RecordingError for what is not a recording, of another version, or so short that there is no step in it.
// Damage further on is told in `cut`; everything before it is good.
Recording load_recording(const std::filesystem::path& path, bool with_poses);

}  // namespace soda
