#include "common/actions/action_proto.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <cmath>
#include <limits>
#include <utility>

#include "common/overloaded.h"
#include "common/scene/proto_geometry.h"
#include "common/scene/proto_scene.h"
#include "common/scene/proto_text.h"
#include "common/scene/scene_file.h"
#include "common/scene/validate.h"

namespace soda {
namespace {

namespace gp = google::protobuf;

constexpr double kMaxImpulse = 1e12;                         // N s
constexpr double kMinFrequency = 1e-3, kMaxFrequency = 1e3;  // Hz
constexpr double kMaxDampingRatio = 100;

std::string number_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

double in_range(double value, double low, double high, const char* field, const char* unit) {
  if (!(value >= low && value <= high))
    throw ActionError(std::string(field) + ": must be between " + number_text(low) + " and " + number_text(high) +
                      unit + ", is " + number_text(value));
  return value;
}

Vec3 no_longer(const pb::Vec3& message, double most, const char* field, const char* unit) {
  const Vec3 v = read_vec3(message, field);
  for (const double c : v)
    if (!std::isfinite(c)) throw ActionError(std::string(field) + ": must be finite");
  if (!(v.norm() <= most))
    throw ActionError(std::string(field) + ": must not be longer than " + number_text(most) + unit + ", is " +
                      number_text(v.norm()));
  return v;
}

BodyId body_id(std::uint64_t id, const char* field) {
  if (id == 0 || id > kMaxBodyId) throw ActionError(std::string(field) + ": must name a body");
  return id;
}

Action read(const pb::Push& m, const Scene&) {
  return Push{body_id(m.body(), "push.body"), no_longer(m.impulse(), kMaxImpulse, "push.impulse", " N s"),
              no_longer(m.point(), kMaxSize, "push.point", " m")};
}

Action read(const pb::SetVelocity& m, const Scene& scene) {
  return SetVelocity{body_id(m.body(), "velocity.body"),
                     no_longer(m.linear(), scene.max_speed, "velocity.linear", " m/s (the scene's largest speed)"),
                     no_longer(m.angular(), kMaxSpin, "velocity.angular", " rad/s")};
}

Action read(const pb::SetPose& m, const Scene&) {
  if (!m.has_pose()) throw ActionError("pose.pose: must be given");
  const Pose pose = read_pose(m.pose(), "pose.pose");
  (void)no_longer(m.pose().position(), kMaxCoordinate, "pose.pose.position", " m");
  return SetPose{body_id(m.body(), "pose.body"), pose.position, pose.orientation};
}

Action read(const pb::Grab& m, const Scene&) {
  Grab grab;
  grab.body = body_id(m.body(), "grab.body");
  grab.point = no_longer(m.point(), kMaxSize, "grab.point", " m");
  grab.target = no_longer(m.target(), kMaxCoordinate, "grab.target", " m");
  if (m.has_frequency())
    grab.frequency = in_range(m.frequency(), kMinFrequency, kMaxFrequency, "grab.frequency", " Hz");
  if (m.has_damping_ratio())
    grab.damping_ratio = in_range(m.damping_ratio(), 0, kMaxDampingRatio, "grab.damping_ratio", "");
  if (m.has_max_acceleration())
    grab.max_acceleration = in_range(m.max_acceleration(), 0, kMaxAcceleration, "grab.max_acceleration", " m/s^2");
  return grab;
}

Action read(const pb::MoveGrab& m, const Scene&) {
  if (m.grab() == 0) throw ActionError("move.grab: must be the number of a grab");
  return MoveGrab{m.grab(), no_longer(m.target(), kMaxCoordinate, "move.target", " m")};
}

Action read(const pb::Release& m, const Scene&) {
  if (m.grab() == 0) throw ActionError("release.grab: must be the number of a grab");
  return Release{m.grab()};
}

Action read(const pb::Spawn& m, const Scene& scene) {
  if (!m.has_body()) throw ActionError("spawn.body: must be given");
  if (m.body().static_()) throw ActionError("spawn.body.static: only dynamic bodies can be spawned");
  pb::Scene alone;
  alone.set_max_speed(scene.max_speed);
  *alone.mutable_geometry() = m.geometry();
  *alone.add_body() = m.body();
  try {
    return Spawn{std::make_shared<const Scene>(from_proto(alone, "spawn"))};
  } catch (const SceneError& e) {
    throw ActionError("spawn." + std::string(e.body.empty() ? "" : "body.") + e.field + ": " + e.reason);
  }
}

Action read(const pb::Remove& m, const Scene&) { return Remove{body_id(m.body(), "remove.body")}; }

template <class M>
Action known(const M& message, const char* field, const Scene& scene) {
  refuse_unknown(message, field);
  return read(message, scene);
}

Action read_kind(const pb::Action& m, const Scene& scene) {
  switch (m.kind_case()) {
    case pb::Action::kPush:
      return known(m.push(), "push", scene);
    case pb::Action::kVelocity:
      return known(m.velocity(), "velocity", scene);
    case pb::Action::kPose:
      return known(m.pose(), "pose", scene);
    case pb::Action::kGrab:
      return known(m.grab(), "grab", scene);
    case pb::Action::kMove:
      return known(m.move(), "move", scene);
    case pb::Action::kRelease:
      return known(m.release(), "release", scene);
    case pb::Action::kSpawn:
      return known(m.spawn(), "spawn", scene);
    case pb::Action::kRemove:
      return known(m.remove(), "remove", scene);
    case pb::Action::KIND_NOT_SET:
      break;
  }
  throw ActionError("says nothing that is to be done (push, velocity, pose, grab, move, release, spawn, remove)");
}

std::vector<WantedAction> read_all(const pb::ActionFile& file, const std::string& source, const Scene& scene) {
  std::vector<WantedAction> actions;
  for (int i = 0; i < file.action_size(); ++i) {
    const std::string where = source + ": action " + std::to_string(i + 1) + ": ";
    try {
      actions.push_back(from_proto(file.action(i), scene));
      if (!actions.back().step) throw ActionError("must say when: step or time");
    } catch (const ActionError& e) {
      throw ActionError(where + e.what());
    }
  }
  return actions;
}

}  // namespace

const char* name_of(const Action& action) {
  static const char* const names[] = {"push", "velocity", "pose", "grab", "move", "release", "spawn", "remove"};
  static_assert(std::size(names) == std::variant_size_v<Action>);
  return names[action.index()];
}

WantedAction from_proto(const pb::Action& message, const Scene& scene) {
  WantedAction wanted;
  try {
    refuse_unknown(message, "action");
    wanted.action = read_kind(message, scene);
  } catch (const FieldError& e) {
    throw ActionError(e.what());
  }
  if (message.spawn().body().has_id()) wanted.id = message.spawn().body().id();
  if (message.when_case() == pb::Action::kStep) {
    if (message.step() < 1 || message.step() > kMaxActionStep) throw ActionError("step: must be between 1 and 2^40");
    wanted.step = message.step();
  } else if (message.when_case() == pb::Action::kTime) {
    const double steps = std::ceil(message.time() / scene.dt * (1 - 1e-12));
    if (!(steps >= 0 && steps <= static_cast<double>(kMaxActionStep)))
      throw ActionError("time: must be from 0 to that of step 2^40, is " + number_text(message.time()));
    wanted.step = std::max<Step>(1, static_cast<Step>(steps));
  }
  return wanted;
}

pb::Action to_proto(const LoggedAction& logged) {
  pb::Action m;
  m.set_step(logged.step);
  std::visit(Overloaded{
                 [&](const Push& a) {
                   pb::Push* out = m.mutable_push();
                   out->set_body(a.body);
                   write_vec3(a.impulse, out->mutable_impulse());
                   write_vec3(a.point, out->mutable_point());
                 },
                 [&](const SetVelocity& a) {
                   pb::SetVelocity* out = m.mutable_velocity();
                   out->set_body(a.body);
                   write_vec3(a.linear, out->mutable_linear());
                   write_vec3(a.angular, out->mutable_angular());
                 },
                 [&](const SetPose& a) {
                   pb::SetPose* out = m.mutable_pose();
                   out->set_body(a.body);
                   write_pose({a.position, a.orientation}, out->mutable_pose());
                 },
                 [&](const Grab& a) {
                   pb::Grab* out = m.mutable_grab();
                   out->set_body(a.body);
                   write_vec3(a.point, out->mutable_point());
                   write_vec3(a.target, out->mutable_target());
                   out->set_frequency(a.frequency);
                   out->set_damping_ratio(a.damping_ratio);
                   out->set_max_acceleration(a.max_acceleration);
                 },
                 [&](const MoveGrab& a) {
                   m.mutable_move()->set_grab(a.grab);
                   write_vec3(a.target, m.mutable_move()->mutable_target());
                 },
                 [&](const Release& a) { m.mutable_release()->set_grab(a.grab); },
                 [&](const Spawn& a) {
                   const pb::Scene alone = to_proto(*a.body);
                   *m.mutable_spawn()->mutable_body() = alone.body(0);
                   *m.mutable_spawn()->mutable_geometry() = alone.geometry();
                 },
                 [&](const Remove& a) { m.mutable_remove()->set_body(a.body); },
             },
             logged.action);
  return m;
}

WantedAction decode_action(std::string_view bytes, const Scene& scene) {
  pb::Action message;
  gp::io::ArrayInputStream stream(bytes.data(), static_cast<int>(bytes.size()));
  gp::io::CodedInputStream coded(&stream);
  coded.SetRecursionLimit(kMaxNesting);
  if (!message.ParseFromCodedStream(&coded) || !coded.ConsumedEntireMessage())
    throw ActionError("not an action (soda.pb.Action)");
  return from_proto(message, scene);
}

std::string encode_action(const LoggedAction& logged) {
  return to_proto(logged).SerializeAsString();  // the same each time, as there are no maps in it
}

std::string encode_actions(const std::vector<LoggedAction>& log) {
  pb::ActionFile file;
  for (const LoggedAction& entry : log) *file.add_action() = to_proto(entry);
  return file.SerializeAsString();
}

std::vector<WantedAction> decode_actions(std::string_view bytes, const Scene& scene) {
  pb::ActionFile file;
  if (!file.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) throw ActionError("not a list of actions");
  return read_all(file, "the actions handed over", scene);
}

std::vector<WantedAction> actions_from_text(std::string_view text, const std::string& source, const Scene& scene) {
  if (text.size() >= std::size_t{1} << 31) throw ActionError(source + ": is larger than 2 GiB");
  pb::ActionFile file;
  if (const auto problem = read_text(text, file))
    throw ActionError(source + ":" + std::to_string(problem->line) + ": " + problem->reason);
  return read_all(file, source, scene);
}

std::vector<WantedAction> load_actions(const std::filesystem::path& path, const Scene& scene) {
  try {
    return actions_from_text(read_file(path), path.string(), scene);
  } catch (const SceneError& e) {
    throw ActionError(e.what());
  }
}

}  // namespace soda
