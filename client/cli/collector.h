// Puts the reports of all worlds of a session together: the newest status of each, the digests of whole steps, whole
// states for a dump; and knows when all has been heard.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <vector>

#include "client/cli/run_recorder.h"
#include "common/dds/frames.h"
#include "common/dump.h"
#include "common/ids.h"

namespace soda::cli {

// The run cannot be reported as asked; what() says why.
struct ReportError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// "STEP BODIES HASH" for each step that is final in all worlds, in order. HASH is the sum of the worlds' digests.
class HashLog {
 public:
  explicit HashLog(const std::filesystem::path& path);  // throws ReportError
  void add(Step step, std::uint64_t bodies, std::uint64_t hash);
  void close();  // throws ReportError if anything could not be written

 private:
  std::filesystem::path path_;
  std::ofstream file_;
};

struct CollectorOptions {
  std::filesystem::path hash_log, dump, record;  // files to write; empty: none
  std::string encoded_scene;                     // for the recording
  std::vector<StepDigest> expected;              // of steps 0, 1, ..., to be compared with; empty: nothing is
};

class Collector {
 public:
  using Clock = std::chrono::steady_clock;

  // Opens the files at once. Throws ReportError.
  explicit Collector(const CollectorOptions& options);

  // Reports that name another session than the first heard of are left alone. Throws ReportError.
  void add(dds::Report report);
  // Everything up to the last step has been heard of all worlds, and all say that they are done.
  bool complete() const;
  // "step 17: ..." for the first step that is not as expected, or "".
  const std::string& difference() const { return difference_; }
  void tick();  // now and then, also where nothing is heard
  // Completes the files with what has been heard.
  void close();

  const std::optional<wire::Session>& session() const { return session_; }
  const std::vector<wire::Status>& worlds() const { return worlds_; }  // by world; state PREPARING until heard of
  // Time of a world's last status; none if it was not heard of.
  std::optional<Clock::time_point> heard(WorldId world) const { return heard_.at(world); }
  // Whether worlds have been heard of, and none for that long.
  bool silent_for(Clock::duration time) const;
  Step whole_steps() const { return next_whole_; }  // digests of steps 0 .. whole_steps() - 1 are complete
  std::uint64_t bodies() const { return bodies_; }  // of the newest whole step
  std::optional<Clock::time_point> began() const { return began_; }  // the first world started
  double wall_seconds() const;                                       // from then until the last news, of the run only

 private:
  struct Sum {
    std::uint32_t worlds = 0;  // that have reported
    std::uint64_t bodies = 0, hash = 0;
  };
  struct State {
    BodySet set;
    std::vector<bool> complete;  // by world
    std::map<WorldId, BodySet> parts;
  };

  void take(const wire::Session& session);
  void take(const wire::Status& status);
  void take(const wire::Digests& digests);
  void take(const wire::StateChunk& chunk);
  void take(const wire::Poses& poses);
  void take(const wire::LogEntry& entry);
  void take(const wire::Control& control);
  void whole(const StepDigest& digest);
  void write_states();

  const CollectorOptions options_;
  std::unique_ptr<HashLog> log_;
  std::optional<DumpWriter> dump_;
  std::unique_ptr<RunRecorder> recorder_;
  std::string difference_;
  std::deque<dds::Report> early_;  // heard before the session's description
  std::optional<wire::Session> session_;
  std::vector<wire::Status> worlds_;
  std::vector<std::optional<Clock::time_point>> heard_;
  std::vector<Step> next_;  // by world: the next digest expected
  std::deque<Sum> sums_;    // of steps next_whole_, ...
  Step next_whole_ = 0;
  std::uint64_t bodies_ = 0;
  std::map<Step, State> states_;
  Step next_state_ = 0;
  std::optional<Clock::time_point> began_, ended_;
};

}  // namespace soda::cli
