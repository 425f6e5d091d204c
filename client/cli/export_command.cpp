#include "client/cli/export_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "client/cli/exit_code.h"
#include "client/export/glb.h"
#include "common/stop_signals.h"

namespace soda::cli {
namespace {

struct ExportOptions {
  std::string recording, output;
  gltf::Range range;
  bool quiet = false;
};

struct Stopped {};

// A line on a terminal that is written over; nothing in a log file. Throws Stopped once a signal has come.
class ProgressLine {
 public:
  ProgressLine(bool quiet, const StopSignals& signals)
      : shown_(!quiet && isatty(STDERR_FILENO) == 1), signals_(signals) {}
  ~ProgressLine() { clear(); }

  void tell(const std::string& text) {
    if (!shown_ || text == last_) return;
    std::fprintf(stderr, "\r\x1b[2K%s", text.c_str());
    std::fflush(stderr);
    last_ = text;
  }
  void clear() {
    if (!last_.empty()) std::fputs("\r\x1b[2K", stderr);
    last_.clear();
  }
  gltf::Progress of(const std::string& what) {
    return [this, what](std::size_t done, std::size_t total) {
      if (signals_.received() != 0) throw Stopped{};
      tell(what + " " + std::to_string(100 * done / total) + " %");
    };
  }

 private:
  bool shown_;
  const StopSignals& signals_;
  std::string last_;
};

void export_recording(const ExportOptions& o, StopSignals& signals) {
  const std::filesystem::path output(o.output);
  if (output.extension() != ".glb") throw std::invalid_argument(o.output + ": has not the extension .glb");
  if (std::filesystem::weakly_canonical(output) == std::filesystem::weakly_canonical(o.recording))
    throw std::invalid_argument(o.output + ": is named twice, for different things");
  ProgressLine line(o.quiet, signals);
  // Loading knows no signals; nothing has been written yet that would have to be taken away.
  signals.on_stop([&] { std::_Exit(128 + signals.received()); });
  line.tell("loading " + o.recording);
  Recording recording = load_recording(o.recording, true);
  signals.on_stop(nullptr);
  const gltf::Tracks tracks = gltf::tracks_of(recording, o.recording, o.range, line.of("reading poses"));
  const gltf::GlbSummary made = gltf::write_glb(tracks, recording.scene, output, line.of("writing " + o.output));
  line.clear();
  std::printf("%s: steps %lld to %lld (%.6g s), %zu bodies, %zu of them moving, %zu shapes, %zu keys, %.1f MB\n",
              o.output.c_str(), static_cast<long long>(tracks.first), static_cast<long long>(tracks.last()),
              made.seconds, made.bodies, made.animated, made.meshes, made.keys, 1e-6 * static_cast<double>(made.bytes));
  const Step end = static_cast<Step>(recording.digests.size()) - 1;
  if (!recording.cut.empty())
    std::printf("note: %s is not whole (%s): exported up to its step %lld at most\n", o.recording.c_str(),
                recording.cut.c_str(), static_cast<long long>(end));
  else if (o.range.to && *o.range.to > end)
    std::printf("note: %s ends at step %lld\n", o.recording.c_str(), static_cast<long long>(end));
}

int run(const ExportOptions& o) {
  StopSignals signals;
  try {
    export_recording(o, signals);
    return kExitOk;
  } catch (const Stopped&) {
    return 128 + signals.received();
  }
}

}  // namespace

void add_export_command(CLI::App& app, int& exit_code) {
  auto o = std::make_shared<ExportOptions>();
  CLI::App* command = app.add_subcommand("export", "write a recorded run as an animated scene (binary glTF 2.0)");
  command->add_option("recording", o->recording, "file of `soda run --record`")->required();
  command->add_option("output", o->output, "file to write, .glb: for Blender, three.js and the like")->required();
  command->add_option("--from", o->range.from, "first step; begins at the recorded sample at or before it")
      ->check(CLI::Range(Step{0}, kMaxActionStep))
      ->capture_default_str();
  command->add_option("--to", o->range.to, "last step; the recording's end if not given")
      ->check(CLI::Range(Step{0}, kMaxActionStep));
  command->add_option("--every", o->range.every, "take samples that are at least so many steps apart")
      ->check(CLI::Range(Step{1}, kMaxActionStep))
      ->capture_default_str();
  command->add_flag("--quiet,-q", o->quiet, "no progress");
  command->footer("Exit codes: 0 written, 2 bad input or the file cannot be written.");
  // Whatever goes wrong is the fault of a file.
  command->callback([o, &exit_code] { exit_code = guarded([&] { return run(*o); }, kExitBadInput); });
}

}  // namespace soda::cli
