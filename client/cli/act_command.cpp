#include "client/cli/act_command.h"

#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "action.pb.h"
#include "client/cli/exit_code.h"
#include "client/cli/requester.h"
#include "common/dds/checks.h"
#include "common/run_settings.h"

namespace soda::cli {
namespace {

constexpr std::chrono::seconds kPatience{10};

using Triple = std::array<double, 3>;

// Where a request goes, and what every command that makes one has in common.
struct Target {
  std::string session = "soda";
  dds::NetworkOptions network;
};

void add_target(CLI::App& command, Target& target) {
  command.add_option("--session", target.session, "name of the session")->capture_default_str();
  dds::add_network_options(command, target.network);
}

// Throws std::invalid_argument for a name that no session has.
int ask(const Target& target, wire::Request request, const std::function<void(const wire::Answer&)>& say) {
  dds::check_session_name(target.session);
  try {
    const auto answer = Requester(target.network, target.session).ask(std::move(request), kPatience);
    if (!answer) {
      std::fprintf(stderr,
                   "error: nobody answers in session '%s': is it running under that name (soda run --session), with a "
                   "network, in this domain?\n",
                   target.session.c_str());
      return kExitNobody;
    }
    if (!answer->accepted()) {
      std::fprintf(stderr, "refused: %s\n", answer->reason().c_str());
      return kExitFailed;
    }
    say(*answer);
    return kExitOk;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "error: %s\n", e.what());
    return kExitFailed;
  }
}

int act(const Target& target, const pb::Action& action) {
  wire::Request request;
  request.kind(wire::REQUEST_ACTION);
  const std::string bytes = action.SerializeAsString();
  request.action().assign(bytes.begin(), bytes.end());
  return ask(target, std::move(request), [](const wire::Answer& answer) {
    std::printf("action %llu, at step %lld", static_cast<unsigned long long>(answer.logged()),
                static_cast<long long>(answer.step()));
    if (answer.body() != 0) std::printf(": body %llu", static_cast<unsigned long long>(answer.body()));
    std::puts("");
  });
}

void set(pb::Vec3* out, const Triple& v) { out->set_x(v[0]), out->set_y(v[1]), out->set_z(v[2]); }

// One kind of action: its options are stored in the message itself when the command runs.
class ActionCommand {
 public:
  ActionCommand(CLI::App& parent, int& exit_code, const char* name, const char* text)
      : command_(*parent.add_subcommand(name, text)), state_(std::make_shared<State>()) {
    add_target(command_, state_->target);
    command_.callback([state = state_, &exit_code] {
      for (const auto& apply : state->apply) apply(state->action);
      exit_code = guarded([&] { return act(state->target, state->action); });
    });
  }

  using Apply = std::function<void(pb::Action&)>;
  template <class T>
  CLI::Option* add(const char* name, const char* text, bool required,
                   std::function<void(pb::Action&, const T&)> apply) {
    auto value = std::make_shared<T>();
    CLI::Option* option = command_.add_option(name, *value, text);
    if (required) option->required();
    state_->apply.push_back([=](pb::Action& action) {
      if (option->count() > 0) apply(action, *value);
    });
    return option;
  }

 private:
  struct State {
    Target target;
    pb::Action action;
    std::vector<Apply> apply;
  };
  CLI::App& command_;
  std::shared_ptr<State> state_;
};

void add_spawn(CLI::App& act, int& exit_code) {
  ActionCommand spawn(act, exit_code, "spawn", "add a dynamic body");
  spawn.add<Triple>("--box", "edge lengths, m", false, [](pb::Action& a, const Triple& v) {
    set(a.mutable_spawn()->mutable_body()->add_shape()->mutable_box()->mutable_size(), v);
  });
  spawn.add<double>("--sphere", "radius, m", false, [](pb::Action& a, const double& r) {
    a.mutable_spawn()->mutable_body()->add_shape()->mutable_sphere()->set_radius(r);
  });
  spawn.add<Triple>("--at", "where, m", true, [](pb::Action& a, const Triple& v) {
    set(a.mutable_spawn()->mutable_body()->mutable_pose()->mutable_position(), v);
  });
  spawn.add<Triple>("--velocity", "m/s", false, [](pb::Action& a, const Triple& v) {
    set(a.mutable_spawn()->mutable_body()->mutable_linear_velocity(), v);
  });
  spawn.add<double>("--density", "kg/m^3; 1000 if not given", false,
                    [](pb::Action& a, const double& d) { a.mutable_spawn()->mutable_body()->set_density(d); });
  spawn.add<std::string>("--name", "for people", false, [](pb::Action& a, const std::string& name) {
    a.mutable_spawn()->mutable_body()->set_name(name);
  });
}

}  // namespace

void add_act_command(CLI::App& app, int& exit_code) {
  CLI::App* group = app.add_subcommand("act", "do something to bodies of a session that runs");
  group->require_subcommand(1);
  const char* const kBody = "id of the body";
  {
    ActionCommand c(*group, exit_code, "push", "an impulse, which changes a body's velocity at once");
    c.add<std::uint64_t>("body", kBody, true, [](auto& a, const auto& id) { a.mutable_push()->set_body(id); });
    c.add<Triple>("--impulse", "N s, world axes", true,
                  [](auto& a, const auto& v) { set(a.mutable_push()->mutable_impulse(), v); });
    c.add<Triple>("--point", "where it acts: m from the centre of mass, in the body's axes; there if not given", false,
                  [](auto& a, const auto& v) { set(a.mutable_push()->mutable_point(), v); });
  }
  {
    ActionCommand c(*group, exit_code, "velocity", "set a body's velocities");
    c.add<std::uint64_t>("body", kBody, true, [](auto& a, const auto& id) { a.mutable_velocity()->set_body(id); });
    c.add<Triple>("--linear", "m/s; 0 if not given", false,
                  [](auto& a, const auto& v) { set(a.mutable_velocity()->mutable_linear(), v); });
    c.add<Triple>("--angular", "rad/s, world axes; 0 if not given", false,
                  [](auto& a, const auto& v) { set(a.mutable_velocity()->mutable_angular(), v); });
  }
  {
    ActionCommand c(*group, exit_code, "pose", "put a body elsewhere, at rest");
    c.add<std::uint64_t>("body", kBody, true, [](auto& a, const auto& id) { a.mutable_pose()->set_body(id); });
    c.add<Triple>("--position", "m, of the centre of mass", true,
                  [](auto& a, const auto& v) { set(a.mutable_pose()->mutable_pose()->mutable_position(), v); });
    c.add<std::array<double, 4>>("--orientation", "quaternion x y z w; not turned if not given", false,
                                 [](auto& a, const auto& q) {
                                   auto* out = a.mutable_pose()->mutable_pose()->mutable_orientation();
                                   out->set_x(q[0]), out->set_y(q[1]), out->set_z(q[2]), out->set_w(q[3]);
                                 });
  }
  {
    ActionCommand c(*group, exit_code, "grab", "tie a body to a place by a spring, until it is released");
    c.add<std::uint64_t>("body", kBody, true, [](auto& a, const auto& id) { a.mutable_grab()->set_body(id); });
    c.add<Triple>("--target", "m", true, [](auto& a, const auto& v) { set(a.mutable_grab()->mutable_target(), v); });
    c.add<Triple>("--point", "of the body: m from the centre of mass, in its axes; there if not given", false,
                  [](auto& a, const auto& v) { set(a.mutable_grab()->mutable_point(), v); });
    c.add<double>("--frequency", "Hz", false, [](auto& a, const auto& f) { a.mutable_grab()->set_frequency(f); });
  }
  {
    ActionCommand c(*group, exit_code, "move", "another place for what was grabbed");
    c.add<std::uint64_t>("grab", "number of the grab, as it was answered", true,
                         [](auto& a, const auto& n) { a.mutable_move()->set_grab(n); });
    c.add<Triple>("--target", "m", true, [](auto& a, const auto& v) { set(a.mutable_move()->mutable_target(), v); });
  }
  {
    ActionCommand c(*group, exit_code, "release", "let go of what was grabbed");
    c.add<std::uint64_t>("grab", "number of the grab, as it was answered", true,
                         [](auto& a, const auto& n) { a.mutable_release()->set_grab(n); });
  }
  add_spawn(*group, exit_code);
  {
    ActionCommand c(*group, exit_code, "remove", "take a body away");
    c.add<std::uint64_t>("body", kBody, true, [](auto& a, const auto& id) { a.mutable_remove()->set_body(id); });
  }
}

void add_pace_commands(CLI::App& app, int& exit_code) {
  const auto add = [&](const char* name, const char* text, std::uint8_t kind) {
    auto target = std::make_shared<Target>();
    auto value = std::make_shared<std::string>();
    CLI::App* command = app.add_subcommand(name, text);
    add_target(*command, *target);
    if (kind == wire::REQUEST_STEP)
      command->add_option("steps", *value, "how many")->check(CLI::Range(1, 1000000))->default_str("1");
    if (kind == wire::REQUEST_SPEED)
      command->add_option("pace", *value, "'realtime', 'max', or a multiple of real time")->required();
    command->callback([=, &exit_code] {
      exit_code = guarded([&] {
        wire::Request request;
        request.kind(kind);
        if (kind == wire::REQUEST_STEP) request.value(value->empty() ? 1 : std::stod(*value));
        if (kind == wire::REQUEST_SPEED) request.value(parse_pace(*value));
        return ask(*target, std::move(request), [&](const wire::Answer& answer) {
          std::printf("%s: displayed step %lld\n", name, static_cast<long long>(answer.step()));
        });
      });
    });
  };
  add("pause", "hold the displayed step of a session", wire::REQUEST_PAUSE);
  add("resume", "let a paused session go on", wire::REQUEST_RESUME);
  add("step", "some steps more of a paused session", wire::REQUEST_STEP);
  add("speed", "another pace for a session", wire::REQUEST_SPEED);
}

}  // namespace soda::cli
