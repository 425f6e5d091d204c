// Follows a session to its end: hears reports, shows the table, looks after the daemons started here. `soda run` and
// `soda watch` share it.
#pragma once

#include <filesystem>
#include <string>

#include "client/cli/collector.h"
#include "client/cli/exit_code.h"
#include "client/cli/processes.h"
#include "client/cli/report_source.h"
#include "client/cli/table.h"
#include "common/stop_signals.h"

namespace soda::cli {

// What `soda run` and `soda watch` have in common.
struct FollowOptions {
  CollectorOptions files;
  std::filesystem::path stats;  // file to write; empty: none
  bool quiet = false;
  bool verbose = false;
  bool explain = false;        // tell how the scene was modelled, and what that cost
  std::uint32_t substeps = 0;  // that the scene fixes; 0: none
};

// Returns the command's exit code: 0, 1 if a daemon or the report failed, 2 if a daemon refused its scene or options,
// 128 + number of the signal that ended it. All daemons of `processes` have ended when it returns; the files are
// written, also of a run that did not come to its end.
int follow(ReportSource& source, Processes& processes, Table& table, StopSignals& signals, Collector& collector,
           const FollowOptions& options);

// For Processes: shows a daemon's line if it is a warning or worse, or if `verbose`.
void show_line(Table& table, const std::string& name, const std::string& line, bool verbose);

}  // namespace soda::cli
