#include "client/cli/exit_code.h"

#include <cstdio>
#include <exception>
#include <stdexcept>

#include "client/cli/collector.h"
#include "common/actions/action_proto.h"
#include "common/recording/recording.h"
#include "common/scene/validate.h"

namespace soda::cli {
namespace {

template <class... Errors>
bool is_one_of(const std::exception& e) {
  return (... || (dynamic_cast<const Errors*>(&e) != nullptr));
}

}  // namespace

int guarded(const std::function<int()>& command, ExitCode otherwise) {
  try {
    return command();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "error: %s\n", e.what());
    const bool bad_input = is_one_of<std::invalid_argument, SceneError, ActionError, RecordingError, ReportError>(e);
    return bad_input ? kExitBadInput : otherwise;
  }
}

}  // namespace soda::cli
