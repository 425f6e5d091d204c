#include "bench/session_runs.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <regex>
#include <sstream>
#include <stdexcept>

#include "bench/harness.h"
#include "common/scene/scene_file.h"

namespace soda::bench {

SessionRuns::SessionRuns(const Scene& scene)
    : folder_(std::filesystem::temp_directory_path() / ("soda-bench-" + std::to_string(getpid()))) {
  std::filesystem::create_directories(folder_);
  save_scene(scene, folder_ / "bench.scene");
}

SessionRuns::~SessionRuns() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

SessionRun SessionRuns::run(const std::string& arguments, Step steps) const {
  const auto stats = folder_ / "stats.json";
  const std::string command = "'" + soda_program().string() + "' run '" + (folder_ / "bench.scene").string() + "' " +
                              arguments + " --steps " + std::to_string(steps) + " --pace max --quiet --stats '" +
                              stats.string() + "' > '" + (folder_ / "output").string() + "' 2>&1";
  if (std::system(command.c_str()) != 0) throw std::runtime_error("this failed: " + command);
  std::stringstream text;
  text << std::ifstream(stats).rdbuf();
  const std::string content = text.str();
  const auto number = [&](const std::string& key) {  // the first is the sum over the worlds
    std::smatch match;
    if (!std::regex_search(content, match, std::regex("\"" + key + "\": *([-+.0-9e]+)")))
      throw std::runtime_error("no " + key + " in the statistics of soda run");
    return std::stod(match[1]);
  };
  return {number("wall_seconds"), number("cpu_seconds"), number("waiting_seconds"), number("mixed_islands"),
          number("bytes_sent")};
}

SessionRun SessionRuns::per_step(const std::string& arguments, Step settled, Step steps) const {
  const SessionRun less = run(arguments, settled), more = run(arguments, settled + steps);
  const auto each = [&](double SessionRun::*of) { return (more.*of - less.*of) / static_cast<double>(steps); };
  return {each(&SessionRun::wall), each(&SessionRun::cpu), each(&SessionRun::waiting), each(&SessionRun::mixed_islands),
          each(&SessionRun::bytes_sent)};
}

}  // namespace soda::bench
