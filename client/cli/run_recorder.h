// Keeps a run in a file while it is heard of: what was done to bodies, every step's digest, poses. A step's digest is
// written only after all actions at steps up to it.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/recording/recording.h"
#include "idl/soda.h"

namespace soda::cli {

class RunRecorder {
 public:
  // Creates the file at once. Throws RecordingError, as all below.
  RunRecorder(const std::filesystem::path& path, std::string encoded_scene);

  void take(const wire::Session& session);  // first of all
  void take(const wire::LogEntry& entry);
  void take(const wire::Control& control);
  void take(const wire::Poses& poses);
  void digest(Step step, const StepDigest& digest);  // of all worlds together, in order
  // All up to that step is in the file, or on its way there.
  bool has(Step last_step) const;
  // Writes to the file what has been gathered for some time, also where nothing new comes.
  void tick() { writer_.flush_if_due(); }
  void close(bool complete);

 private:
  struct Sample {
    std::vector<std::uint32_t> missing;  // poses that are to come, by world; all of them before the first was heard
    std::vector<bool> heard;
    pb::RecordedPoses poses;
  };
  void write();

  RecordingWriter writer_;
  std::string encoded_scene_;
  std::uint32_t worlds_ = 0;
  std::uint64_t logged_ = 0;  // entries written
  std::map<std::uint64_t, wire::LogEntry> entries_;
  std::vector<std::pair<Step, std::uint64_t>> closings_;  // steps closed, with so many entries
  Step covered_ = -1;                                     // all actions up to this step are written
  std::deque<StepDigest> digests_;
  Step next_step_ = 0;  // of the next digest
  std::map<Step, Sample> poses_;
  Step pose_every_ = 0, posed_ = -1;  // step of the last poses written
};

}  // namespace soda::cli
