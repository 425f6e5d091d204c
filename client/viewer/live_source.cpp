#include "client/viewer/live_source.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "common/run_settings.h"

namespace soda::viewer {
namespace {

using namespace std::chrono_literals;

constexpr auto kShapePatience = 1s;  // for news of how a body looks

double seconds(std::chrono::steady_clock::duration d) { return std::chrono::duration<double>(d).count(); }

const char* state_name(std::uint8_t state) {
  switch (state) {
    case wire::STATE_PREPARING:
      return "preparing";
    case wire::STATE_READY:
      return "ready";
    case wire::STATE_RUNNING:
      return "running";
    default:
      return "done";
  }
}

}  // namespace

LiveSource::LiveSource(const dds::NetworkOptions& network, const std::string& session, buffer::Following following)
    : session_(session), client_(network, session, std::move(following)) {}

News LiveSource::poll() {
  client_.poll(0ms);
  News news;
  if (!model_ && client_.scene() && client_.buffer()) {
    model_ = std::make_unique<SceneModel>(*client_.scene(), client_.session()->worlds());
    watched_.resize(client_.session()->worlds());
  }
  if (model_) {
    const auto& spawned = client_.spawned();
    for (; spawned_ < spawned.size(); ++spawned_) model_->add(spawned[spawned_].id, *spawned[spawned_].shape);
    const buffer::BodyIndex& heard = client_.buffer()->bodies();
    const auto now = Clock::now();
    if (bodies_.size() == heard.size() || model_->has(heard.id(listed()))) stuck_ = now;
    while (bodies_.size() < heard.size() && (model_->has(heard.id(listed())) || now - stuck_ > kShapePatience))
      bodies_.push_back(heard.id(listed()));
    watch_worlds(news);
    note_transfers();
  }
  note_speed();
  for (const wire::Answer& answer : client_.take_answers()) {
    view::Answer told;
    told.set_accepted(answer.accepted());
    told.set_reason(answer.reason());
    told.set_step(answer.step());
    told.set_body(answer.body());
    told.set_logged(answer.logged());
    news.answers.emplace_back(answer.number(), std::move(told));
  }
  return news;
}

void LiveSource::watch_worlds(News& news) {
  const auto now = Clock::now();
  for (WorldId w = 0; w < watched_.size(); ++w) {
    const buffer::SessionClient::World& world = client_.worlds()[w];
    if (!world.status) continue;
    Watched& watched = watched_[w];
    if (!std::exchange(watched.known, true)) {
      watched.repairs = world.status->repairs();
      watched.before = *world.status;
      watched.then = now;
    }
    const bool silent = this->silent(w, now);
    if (std::exchange(watched.silent, silent) != silent)
      news.events.push_back("world " + std::to_string(w) +
                            (silent ? " has fallen silent: it hangs, or is gone" : " is heard of again"));
    if (world.status->repairs() == watched.repairs) continue;
    watched.repairs = world.status->repairs();
    view::Rollback rollback;
    rollback.set_world(w);
    rollback.set_step(world.status->repair_step());
    rollback.set_steps(world.status->repair_steps());
    rollback.set_bodies(world.status->repair_bodies());
    rollback.set_milliseconds(1000 * world.status->repair_seconds());
    news.rollbacks.push_back(rollback);
  }
}

void LiveSource::note_transfers() {
  const std::vector<wire::Transfer>& heard = client_.transfers();
  for (; heard_transfers_ < heard.size(); ++heard_transfers_) {
    const wire::Transfer& from = heard[heard_transfers_];
    if (from.cells().back() >= model_->cells()) {  // ascending
      spdlog::warn("transfer {} of world {} is left alone: there is no cell {}", from.number(), from.world(),
                   from.cells().back());
      continue;
    }
    view::Transfer& to = transfers_.emplace_back();
    to.set_step(from.step());
    to.set_giver(from.world());
    to.set_taker(from.taker());
    to.mutable_cell()->Assign(from.cells().begin(), from.cells().end());
  }
}

bool LiveSource::silent(WorldId w, Clock::time_point now) const {
  const buffer::SessionClient::World& world = client_.worlds()[w];
  const bool done = world.status && world.status->state() == wire::STATE_DONE;
  return world.silent(now) && !done && client_.ended().empty();
}

void LiveSource::note_speed() {
  if (!client_.control() || !client_.ended().empty()) return;
  const auto now = Clock::now();
  displayed_.emplace_back(now, displayed());
  while (displayed_.size() > 2 && now - displayed_.front().first > 1s) displayed_.pop_front();
}

view::Welcome LiveSource::welcome() const {
  const wire::Session& session = *client_.session();
  view::Welcome welcome;
  model_->fill(welcome);
  welcome.set_session(session_);
  welcome.set_worlds(session.worlds());
  welcome.set_last_step(session.last_step());
  welcome.set_window(session.window());
  welcome.set_lead(session.lead());
  return welcome;
}

view::BodyList LiveSource::bodies(std::uint32_t first, std::uint32_t& meshes) const {
  view::BodyList list;
  list.set_first(first);
  for (; meshes < model_->meshes(); ++meshes) model_->add_mesh(meshes, *list.add_meshes());
  for (std::uint32_t i = first; i < listed(); ++i) model_->list(bodies_[i], list);
  return list;
}

view::Transfers LiveSource::transfers(std::uint32_t first) const {
  view::Transfers told;
  for (std::size_t i = first; i < transfers_.size(); ++i) *told.add_transfer() = transfers_[i];
  return told;
}

view::Clocks LiveSource::clocks() const {
  view::Clocks clocks;
  clocks.set_displayed(displayed());
  const auto& control = client_.control();
  clocks.set_gathering(!control || control->phase() == wire::PHASE_GATHERING);
  if (control) {
    clocks.set_pace(control->pace());
    clocks.set_paused(control->paused());
  }
  if (displayed_.size() > 1 && client_.session()) {
    const double passed = seconds(displayed_.back().first - displayed_.front().first);
    const auto steps = static_cast<double>(displayed_.back().second - displayed_.front().second);
    if (passed > 0) clocks.set_speed(steps * client_.session()->dt() / passed);
  }
  const buffer::TransformBuffer* buffer = client_.buffer();
  if (!buffer) return clocks;
  if (buffer->oldest() <= buffer->newest()) {
    clocks.set_oldest(buffer->oldest());
    clocks.set_newest(buffer->newest());
  }
  const auto now = Clock::now();
  Step final_step = client_.session()->last_step();
  for (WorldId w = 0; w < client_.worlds().size(); ++w) {
    const auto& status = client_.worlds()[w].status;
    view::WorldClock& clock = *clocks.add_world();
    // Transforms are the newer news, where they are followed.
    clock.set_clock(std::max<Step>(buffer->clock(w), status ? status->clock() : 0));
    clock.set_front(buffer->front(w) >= 0 ? buffer->front(w) : status ? status->front() : 0);
    clock.set_final(std::max<Step>(buffer->final_step(w), status ? status->final_step() : 0));
    clock.set_silent(silent(w, now));
    final_step = std::min<Step>(final_step, clock.final());
  }
  clocks.set_final(final_step);
  return clocks;
}

view::Worlds LiveSource::worlds() {
  view::Worlds worlds;
  const auto now = Clock::now();
  for (WorldId w = 0; w < watched_.size(); ++w) *worlds.add_world() = state_of(w, now);
  return worlds;
}

view::WorldState LiveSource::state_of(WorldId w, Clock::time_point now) {
  view::WorldState state;
  state.set_waiting_for(-1);
  const buffer::SessionClient::World& world = client_.worlds()[w];
  if (!world.status) {
    state.set_state("unknown");
    return state;
  }
  const wire::Status& s = *world.status;
  Watched& watched = watched_[w];
  state.set_state(watched.silent ? "silent" : state_name(s.state()));
  state.set_host(s.host());
  state.set_pid(s.pid());
  state.set_bodies(s.bodies());
  state.set_cells(s.cells());
  state.set_neighbours(s.neighbours());
  if (s.waiting_for() != kNoWorld) state.set_waiting_for(static_cast<std::int32_t>(s.waiting_for()));
  state.set_syncs(s.syncs());
  state.set_mixed_islands(s.mixed_islands());
  state.set_rollbacks(s.rollbacks());
  state.set_bodies_redone(s.bodies_redone());
  state.set_refused(s.refused());
  state.set_lead(s.clock() - s.final_step());
  state.set_memory(s.peak_memory());
  const double passed = seconds(now - watched.then);
  if (passed > 0) {
    const auto rate = [&](auto after, auto before) {
      return (static_cast<double>(after) - static_cast<double>(before)) / passed;
    };
    state.set_steps_per_second(rate(s.steps(), watched.before.steps()));
    state.set_load(std::clamp(rate(s.work_seconds(), watched.before.work_seconds()), 0.0, 1.0));
    state.set_waiting(std::clamp(rate(s.waiting_seconds(), watched.before.waiting_seconds()), 0.0, 1.0));
    state.set_bytes_per_second(rate(s.bytes_sent(), watched.before.bytes_sent()));
    state.set_cpu(rate(s.cpu_seconds(), watched.before.cpu_seconds()));
  }
  watched.before = s;
  watched.then = now;
  return state;
}

std::optional<End> LiveSource::ended() const {
  if (client_.other_protocol() != 0)
    return End{"session '" + session_ + "' speaks version " + std::to_string(client_.other_protocol()) +
                   " of the protocol, this viewer another: use the same build everywhere",
               true};
  if (client_.ended().empty()) return std::nullopt;
  return End{client_.ended(), client_.failed()};
}

std::uint64_t LiveSource::ask(const view::Do& wanted) {
  wire::Request request;
  switch (wanted.what_case()) {
    case view::Do::kAction: {
      request.kind(wire::REQUEST_ACTION);
      const std::string bytes = wanted.action().SerializeAsString();
      request.action().assign(bytes.begin(), bytes.end());
      break;
    }
    case view::Do::kPause:
      request.kind(wire::REQUEST_PAUSE);
      break;
    case view::Do::kResume:
      request.kind(wire::REQUEST_RESUME);
      break;
    case view::Do::kSteps:
      request.kind(wire::REQUEST_STEP);
      request.value(std::clamp(static_cast<double>(wanted.steps()), 0.0, kLargestPace));
      break;
    case view::Do::kSpeed:
      request.kind(wire::REQUEST_SPEED);
      request.value(wanted.speed() >= 0 ? std::min(wanted.speed(), kLargestPace) : 0);  // not a number, too
      break;
    default:
      return 0;
  }
  return client_.ask(std::move(request));
}

}  // namespace soda::viewer
