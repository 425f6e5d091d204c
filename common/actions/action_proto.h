// Actions between Protobuf (idl/action.proto) and Action, in bytes and in files.
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "action.pb.h"
#include "common/actions/action.h"

namespace soda {

// What is wrong with an action; what() reads "push.impulse: must be finite".
struct ActionError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// An action as somebody wants it, not accepted yet.
struct WantedAction {
  Action action;
  std::optional<Step> step;  // none: the first that is open
  std::optional<BodyId> id;  // of a spawned body, where it is to be this one and no other
};

// All that can be seen without the session is checked: finite values, units, a spawned body's own soundness. `scene`
// has the settings (dt, largest speed) that apply. Throws ActionError.
WantedAction from_proto(const pb::Action& message, const Scene& scene);
pb::Action to_proto(const LoggedAction& logged);

// The bytes of one action. The same logged action has the same bytes.
WantedAction decode_action(std::string_view bytes, const Scene& scene);
std::string encode_action(const LoggedAction& logged);

// A pb.ActionFile in bytes, for programs that hand one to another.
std::string encode_actions(const std::vector<LoggedAction>& log);
std::vector<WantedAction> decode_actions(std::string_view bytes, const Scene& scene);

// A text file of actions (.txtpb of pb.ActionFile). Throws ActionError with file, number of the action and field.
std::vector<WantedAction> load_actions(const std::filesystem::path& path, const Scene& scene);
std::vector<WantedAction> actions_from_text(std::string_view text, const std::string& source, const Scene& scene);

}  // namespace soda
