// The statistics of a run as JSON: one key per line, everything that the worlds reported last.
#pragma once

#include <filesystem>

#include "client/cli/collector.h"

namespace soda::cli {

// Throws ReportError.
void write_stats(const std::filesystem::path& path, const Collector& collector, bool complete);

}  // namespace soda::cli
