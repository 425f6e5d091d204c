// Whole runs of `soda run`, and what they say of themselves.
#pragma once

#include <filesystem>
#include <string>

#include "common/ids.h"
#include "common/scene/scene.h"

namespace soda::bench {

struct SessionRun {
  double wall = 0, cpu = 0, waiting = 0;     // s; the last two summed over all worlds
  double mixed_islands = 0, bytes_sent = 0;  // summed over steps and worlds
};

// A scene in a file, to be run again and again as fast as possible; the file goes with the object.
class SessionRuns {
 public:
  explicit SessionRuns(const Scene& scene);
  ~SessionRuns();
  SessionRuns(const SessionRuns&) = delete;
  SessionRuns& operator=(const SessionRuns&) = delete;

  // Throws std::runtime_error where the run fails.
  SessionRun run(const std::string& arguments, Step steps) const;
  // Of one step: what `steps` more than `settled` take, so that the start does not count.
  SessionRun per_step(const std::string& arguments, Step settled, Step steps) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace soda::bench
