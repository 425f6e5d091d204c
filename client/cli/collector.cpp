#include "client/cli/collector.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <utility>

#include "common/scene_hash.h"

namespace soda::cli {
namespace {

constexpr std::size_t kEarlyAtMost = 100000;  // reports

template <class T>
void append(std::vector<T>& to, const wire::Octets& raw) {
  const std::size_t had = to.size();
  to.resize(had + raw.size() / sizeof(T));
  if (!raw.empty()) std::memcpy(to.data() + had, raw.data(), raw.size());
}

std::uint64_t instance_of(const dds::Report& report) {
  return std::visit([](const auto& sample) { return sample.instance(); }, report);
}

}  // namespace

HashLog::HashLog(const std::filesystem::path& path) : path_(path), file_(path) {
  if (!file_) throw ReportError(path.string() + ": cannot be written");
}

void HashLog::add(Step step, std::uint64_t bodies, std::uint64_t hash) {
  char line[80];
  std::snprintf(line, sizeof line, "%" PRId64 " %" PRIu64 " %016" PRIx64 "\n", step, bodies, hash);
  file_ << line;
}

void HashLog::close() {
  file_.close();
  if (!file_) throw ReportError(path_.string() + ": cannot be written");
}

Collector::Collector(const CollectorOptions& options) : options_(options) {
  if (!options.hash_log.empty()) log_ = std::make_unique<HashLog>(options.hash_log);
  if (!options.record.empty()) recorder_ = std::make_unique<RunRecorder>(options.record, options.encoded_scene);
  // The dump's header needs the scene's hash, but that the file cannot be written is said before the run.
  if (!options.dump.empty() && !std::ofstream(options.dump, std::ios::binary))
    throw ReportError(options.dump.string() + ": cannot be written");
}

void Collector::add(dds::Report report) {
  if (!session_) {
    if (const auto* session = std::get_if<wire::Session>(&report)) {
      take(*session);
      for (; !early_.empty(); early_.pop_front()) add(std::move(early_.front()));
    } else if (early_.size() < kEarlyAtMost) {
      early_.push_back(std::move(report));
    }
    return;
  }
  if (instance_of(report) != session_->instance()) return;
  std::visit(
      [this](const auto& sample) {
        using T = std::decay_t<decltype(sample)>;
        if constexpr (std::is_same_v<T, wire::LogEntry> || std::is_same_v<T, wire::Control>)
          take(sample);
        else if constexpr (!std::is_same_v<T, wire::Session>)
          if (sample.world() < worlds_.size()) take(sample);
      },
      report);
}

void Collector::take(const wire::Session& session) {
  session_ = session;
  worlds_.resize(session.worlds());
  for (std::size_t i = 0; i < worlds_.size(); ++i) worlds_[i].world(static_cast<WorldId>(i));
  heard_.resize(session.worlds());
  next_.resize(session.worlds());
  if (recorder_) recorder_->take(session);
  if (options_.dump.empty()) return;
  if (session.dump_first() < 0) throw ReportError("this session reports no states; world 0 needs --dump-steps");
  dump_.emplace(options_.dump, DumpHeader{session.scene_hash(), session.dump_first(), session.dump_last()});
  next_state_ = session.dump_first();
}

void Collector::take(const wire::Status& status) {
  const auto now = Clock::now();
  if (status.state() >= wire::STATE_RUNNING) {
    if (!began_) began_ = now;
    if (worlds_[status.world()].state() < wire::STATE_DONE) ended_ = now;
  }
  worlds_[status.world()] = status;
  heard_[status.world()] = now;
}

void Collector::take(const wire::Digests& digests) {
  Step& next = next_[digests.world()];
  if (digests.first() < next) return;  // told again
  if (digests.first() > next)
    throw ReportError("the digests of world " + std::to_string(digests.world()) + " for steps " + std::to_string(next) +
                      " to " + std::to_string(digests.first() - 1) + " were not heard");
  for (std::size_t i = 0; i < digests.hashes().size(); ++i, ++next) {
    const auto at = static_cast<std::size_t>(next - next_whole_);
    if (at >= sums_.size()) sums_.resize(at + 1);
    ++sums_[at].worlds;
    sums_[at].bodies += digests.bodies()[i];
    sums_[at].hash += digests.hashes()[i];
  }
  for (; !sums_.empty() && sums_.front().worlds == worlds_.size(); sums_.pop_front(), ++next_whole_) {
    bodies_ = sums_.front().bodies;
    whole({sums_.front().bodies, sums_.front().hash});
  }
}

// All worlds' digests of step next_whole_ are there.
void Collector::whole(const StepDigest& digest) {
  if (log_) log_->add(next_whole_, digest.bodies, digest.hash);
  if (recorder_) recorder_->digest(next_whole_, digest);
  const auto step = static_cast<std::size_t>(next_whole_);
  if (!difference_.empty() || step >= options_.expected.size() || options_.expected[step] == digest) return;
  char text[160];
  std::snprintf(text, sizeof text,
                "step %zu: %" PRIu64 " bodies %016" PRIx64 ", expected %" PRIu64 " bodies %016" PRIx64, step,
                digest.bodies, digest.hash, options_.expected[step].bodies, options_.expected[step].hash);
  difference_ = text;
}

void Collector::take(const wire::Poses& poses) {
  if (recorder_) recorder_->take(poses);
}

void Collector::take(const wire::LogEntry& entry) {
  if (recorder_) recorder_->take(entry);
}

void Collector::take(const wire::Control& control) {
  if (recorder_) recorder_->take(control);
}

void Collector::take(const wire::StateChunk& chunk) {
  if (!dump_ || chunk.step() < next_state_ || chunk.step() > session_->dump_last()) return;
  State& state = states_[chunk.step()];
  state.complete.resize(worlds_.size());
  if (state.complete[chunk.world()]) return;  // told again
  BodySet& part = state.parts[chunk.world()];
  append(part.bodies, chunk.bodies());
  append(part.contacts, chunk.contacts());
  if (part.bodies.size() < chunk.bodies_total() || part.contacts.size() < chunk.contacts_total()) return;
  state.complete[chunk.world()] = true;
  write_states();
}

void Collector::write_states() {
  for (auto first = states_.begin(); first != states_.end() && first->first == next_state_; first = states_.begin()) {
    State& state = first->second;
    if (!std::all_of(state.complete.begin(), state.complete.end(), [](bool c) { return c; })) return;
    for (auto& [world, part] : state.parts) {
      state.set.bodies.insert(state.set.bodies.end(), part.bodies.begin(), part.bodies.end());
      state.set.contacts.insert(state.set.contacts.end(), part.contacts.begin(), part.contacts.end());
    }
    std::sort(state.set.bodies.begin(), state.set.bodies.end(),
              [](const BodyState& a, const BodyState& b) { return a.id < b.id; });
    std::sort(state.set.contacts.begin(), state.set.contacts.end(), record_before);
    dump_->add(next_state_++, state.set);
    states_.erase(first);
  }
}

bool Collector::complete() const {
  if (!session_ || next_whole_ <= session_->last_step()) return false;
  if (recorder_ && !recorder_->has(session_->last_step())) return false;
  if (dump_ && next_state_ <= session_->dump_last()) return false;
  return std::all_of(worlds_.begin(), worlds_.end(),
                     [](const wire::Status& status) { return status.state() == wire::STATE_DONE; });
}

bool Collector::silent_for(Clock::duration time) const {
  const auto newest = std::max_element(heard_.begin(), heard_.end());
  return newest != heard_.end() && *newest && Clock::now() - **newest > time;
}

void Collector::tick() {
  if (recorder_) recorder_->tick();
}

void Collector::close() {
  if (log_) log_->close();
  if (dump_) dump_->close();
  if (recorder_) recorder_->close(complete());
}

double Collector::wall_seconds() const {
  if (!began_ || !ended_) return 0;
  return std::chrono::duration<double>(*ended_ - *began_).count();
}

}  // namespace soda::cli
