// The command line of soda-world.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/dds/network_options.h"
#include "common/ids.h"
#include "common/run_settings.h"
#include "common/version.h"

namespace soda::world {

struct Options {
  std::string session = "soda";
  WorldId world = 0;
  std::uint64_t expect_scene = 0;  // hash; 0: any
  dds::NetworkOptions network;
  bool verbose = false;
  bool explain = false;  // measure what each way of solving islands costs

  // Of world 0, which tells the others.
  std::string scene;  // file
  WorldId worlds = 1;
  SyncMode sync = SyncMode::kAnticipative;
  Step steps = kDefaultSteps;
  double pace = 1;  // multiple of real time; 0: as fast as possible
  Step window = kDefaultWindow;
  bool balance = true;
  bool watched = false;
  Step lead = kDefaultLead;
  std::string actions;  // file
  int actions_fd = -1;  // of an encoded pb.ActionFile, instead
  Step pose_every = 0;  // steps whose poses are reported; 0: none
  Step dump_first = -1, dump_last = -1;

  // For those that start soda-world themselves.
  int scene_fd = -1;                          // an encoded scene instead of a file
  int report_fd = -1;                         // a pipe for the reports of --sync single
  int supervised_by = 0;                      // process whose end ends this one; 0: none
  std::uint32_t epoch = 0;                    // of this start; random if not given
  std::uint32_t protocol = kProtocolVersion;  // to be pretended, for tests
};

// The options, or the exit code with which to end (after --help or an error that was printed).
std::optional<Options> parse_options(int argc, char** argv, int& exit_code);

}  // namespace soda::world
