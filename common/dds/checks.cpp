#include "common/dds/checks.h"

#include <fastcdr/Cdr.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <stdexcept>

#include "common/actions/action.h"
#include "common/body_state.h"
#include "common/contact_record.h"
#include "common/grid.h"
#include "common/run_settings.h"
#include "common/version.h"

namespace soda::dds {
namespace {

using eprosima::fastcdr::Cdr;

template <class Field>
void skip_one(Cdr& cdr) {
  Field field{};
  cdr >> field;
}

template <class... Fields>
void skip(Cdr& cdr) {
  (skip_one<Fields>(cdr), ...);
}

// Passes over a sequence of `element` bytes each, aligned to their size.
template <class Element>
bool pass_sequence(Cdr& cdr) {
  std::uint32_t length = 0;
  cdr >> length;
  if (length == 0) return true;
  skip<Element>(cdr);  // takes care of the alignment
  return cdr.jump((std::size_t{length} - 1) * sizeof(Element));
}

bool ok_text(const std::string& text) { return text.size() <= kMaxText && text.find('\0') == std::string::npos; }
bool ok_step(std::int64_t step) { return step >= 0 && step <= kMaxStepNumber; }
bool finite(const auto& values) {
  return std::all_of(values.begin(), values.end(), [](auto v) { return std::isfinite(v); });
}
bool ok_seconds(double seconds) { return std::isfinite(seconds) && seconds >= 0; }

}  // namespace

template <class T>
bool lengths_fit(Cdr&) {
  return true;
}
template bool lengths_fit<wire::Session>(Cdr&);
template bool lengths_fit<wire::Join>(Cdr&);
template bool lengths_fit<wire::Admission>(Cdr&);
template bool lengths_fit<wire::Control>(Cdr&);
template bool lengths_fit<wire::Answer>(Cdr&);
template bool lengths_fit<wire::Status>(Cdr&);
template bool lengths_fit<wire::Lack>(Cdr&);

template <>
bool lengths_fit<wire::SceneChunk>(Cdr& cdr) {
  skip<std::uint64_t, std::uint32_t, std::uint32_t>(cdr);
  return pass_sequence<std::uint8_t>(cdr);
}

template <>
bool lengths_fit<wire::Request>(Cdr& cdr) {
  skip<std::uint64_t, std::uint64_t, std::uint64_t, std::uint8_t, double>(cdr);
  return pass_sequence<std::uint8_t>(cdr);
}

template <>
bool lengths_fit<wire::LogEntry>(Cdr& cdr) {
  skip<std::uint64_t, std::uint64_t>(cdr);
  return pass_sequence<std::uint8_t>(cdr);
}

template <>
bool lengths_fit<wire::Border>(Cdr& cdr) {
  skip<std::uint32_t, std::uint32_t>(cdr);
  return pass_sequence<std::uint8_t>(cdr);
}

template <>
bool lengths_fit<wire::Digests>(Cdr& cdr) {
  skip<std::uint64_t, std::uint32_t, std::int64_t>(cdr);
  return pass_sequence<std::uint32_t>(cdr) && pass_sequence<std::uint64_t>(cdr);
}

template <>
bool lengths_fit<wire::StateChunk>(Cdr& cdr) {
  skip<std::uint64_t, std::uint32_t, std::int64_t, std::uint64_t, std::uint64_t>(cdr);
  return pass_sequence<std::uint8_t>(cdr) && pass_sequence<std::uint8_t>(cdr);
}

template <>
bool lengths_fit<wire::Poses>(Cdr& cdr) {
  skip<std::uint64_t, std::uint32_t, std::int64_t, std::uint32_t>(cdr);
  return pass_sequence<std::uint64_t>(cdr) && pass_sequence<float>(cdr);
}

template <>
bool lengths_fit<wire::Transforms>(Cdr& cdr) {
  skip<std::uint64_t, std::uint32_t, std::uint64_t, std::uint8_t, std::int64_t, double, std::int64_t, std::int64_t,
       std::int64_t>(cdr);
  return pass_sequence<std::uint64_t>(cdr) && pass_sequence<double>(cdr) && pass_sequence<float>(cdr) &&
         pass_sequence<float>(cdr) && pass_sequence<std::uint8_t>(cdr) && pass_sequence<std::uint64_t>(cdr);
}

template <>
bool lengths_fit<wire::Transfer>(Cdr& cdr) {
  skip<std::uint64_t, std::uint32_t, std::uint32_t, std::int64_t, std::uint32_t>(cdr);
  return pass_sequence<std::uint32_t>(cdr);
}

std::string problem(const wire::Session& s) {
  if (s.protocol() != kProtocolVersion) return "";  // nothing else can be relied on: the receiver refuses it by version
  if (s.instance() == 0) return "no instance";
  if (!ok_text(s.version()) || !ok_text(s.scene_name())) return "overlong text";
  if (s.scene_bytes() == 0 || s.scene_bytes() > kMaxSceneBytes) return "impossible scene size";
  if (s.worlds() == 0 || s.worlds() > kMaxWorlds) return "impossible number of worlds";
  if (!ok_step(s.last_step())) return "impossible last step";
  if (s.sync() > wire::SYNC_ANTICIPATIVE) return "unknown sync mode";
  if (s.window() == 0 || s.window() > kLargestWindow) return "impossible window";
  if (s.lead() == 0 || s.lead() > kLargestLead) return "impossible input lead";
  if (!std::isfinite(s.dt()) || s.dt() <= 0) return "impossible dt";
  if (!ok_seconds(s.pace())) return "impossible pace";
  if (s.dump_first() < -1 || s.dump_last() < s.dump_first() || s.dump_last() > kMaxStepNumber)
    return "impossible dump range";
  return "";
}

std::string problem(const wire::SceneChunk& s) {
  if (s.count() == 0 || s.index() >= s.count() || s.count() > kMaxSceneBytes / kMaxChunkBytes + 1) return "bad index";
  if (s.bytes().empty() || s.bytes().size() > kMaxChunkBytes) return "bad length";
  return "";
}

std::string problem(const wire::Join& s) {
  if (s.protocol() != kProtocolVersion) return "";
  if (s.nonce() == 0) return "no nonce";
  if (!ok_text(s.version()) || !ok_text(s.host())) return "overlong text";
  return "";
}

std::string problem(const wire::Admission& s) { return ok_text(s.reason()) ? "" : "overlong text"; }

std::string problem(const wire::Control& s) {
  if (s.phase() > wire::PHASE_STOPPED) return "unknown phase";
  if (!ok_step(s.displayed()) || s.limit() < 0 || s.closed() < 0) return "impossible step";
  return ok_seconds(s.pace()) ? "" : "impossible pace";
}

std::string problem(const wire::Request& s) {
  if (s.client() == 0) return "no client";
  if (s.kind() > wire::REQUEST_SPEED) return "unknown kind";
  if (!ok_seconds(s.value()) || s.value() > kLargestPace) return "impossible value";
  if (s.action().size() > kMaxActionBytes) return "too long";
  return "";
}

std::string problem(const wire::Answer& s) {
  if (!ok_text(s.reason())) return "overlong text";
  return ok_step(s.step()) ? "" : "impossible step";
}

std::string problem(const wire::LogEntry& s) {
  if (s.number() == 0) return "no number";
  return s.action().size() <= kMaxActionBytes ? "" : "too long";
}

std::string problem(const wire::Border& s) {
  if (s.from() >= kMaxWorlds || s.to() >= kMaxWorlds) return "impossible world";
  if (s.payload().size() > kMaxBorderBytes) return "too long";
  return "";
}

std::string problem(const wire::Status& s) {
  if (s.world() >= kMaxWorlds) return "impossible world";
  if (s.state() > wire::STATE_DONE) return "unknown state";
  if (!ok_text(s.host())) return "overlong text";
  if (!ok_step(s.clock()) || !ok_step(s.final_step()) || s.final_step() > s.clock()) return "impossible step";
  if (!ok_step(s.repair_step())) return "impossible step";
  for (double seconds : {s.work_seconds(), s.waiting_seconds(), s.paced_seconds(), s.cpu_seconds(), s.repair_seconds()})
    if (!ok_seconds(seconds)) return "impossible time";
  for (const wire::ModelShare& share : s.shares())
    if (!ok_seconds(share.seconds())) return "impossible time";
  if (!ok_seconds(s.step_seconds()) || !(s.steps_on_time() >= 0)) return "impossible load";
  return "";
}

std::string problem(const wire::Digests& s) {
  if (s.world() >= kMaxWorlds) return "impossible world";
  if (!ok_step(s.first())) return "impossible step";
  if (s.bodies().empty() || s.bodies().size() != s.hashes().size() || s.bodies().size() > kMaxDigests)
    return "bad lengths";
  return "";
}

std::string problem(const wire::StateChunk& s) {
  if (s.world() >= kMaxWorlds) return "impossible world";
  if (!ok_step(s.step())) return "impossible step";
  if (s.bodies().size() + s.contacts().size() > kMaxChunkBytes) return "too long";
  if (s.bodies().size() % sizeof(BodyState) != 0 || s.contacts().size() % sizeof(ContactRecord) != 0)
    return "broken records";
  if (s.bodies().size() / sizeof(BodyState) > s.bodies_total() ||
      s.contacts().size() / sizeof(ContactRecord) > s.contacts_total())
    return "more records than announced";
  return "";
}

std::string problem(const wire::Poses& s) {
  if (s.world() >= kMaxWorlds) return "impossible world";
  if (!ok_step(s.step())) return "impossible step";
  if (s.ids().size() > kMaxPoses || s.ids().size() > s.total() || s.values().size() != 7 * s.ids().size())
    return "bad lengths";
  return finite(s.values()) ? "" : "a value that is not finite";
}

std::string problem(const wire::Transforms& s) {
  if (s.world() >= kMaxWorlds) return "impossible world";
  if (s.number() == 0) return "no number";
  if (s.kind() > wire::VIEW_AGAIN) return "unknown kind";
  if (!ok_step(s.step()) || !ok_step(s.front()) || !ok_step(s.final_step()) || !ok_seconds(s.time()))
    return "impossible step";
  const std::size_t n = s.ids().size();
  if (s.positions().size() != 3 * n || s.orientations().size() != 4 * n || s.velocities().size() != 6 * n ||
      s.flags().size() != n)
    return "bad lengths";
  return finite(s.positions()) && finite(s.orientations()) && finite(s.velocities()) ? ""
                                                                                     : "a value that is not finite";
}

std::string problem(const wire::Transfer& s) {
  if (s.world() >= kMaxWorlds || s.taker() >= kMaxWorlds || s.taker() == s.world()) return "impossible world";
  if (s.number() == 0) return "no number";
  if (!ok_step(s.step()) || s.step() == 0) return "impossible step";
  if (s.cells().empty() || s.cells().size() > kMaxTransferCells) return "impossible number of cells";
  if (std::adjacent_find(s.cells().begin(), s.cells().end(), std::greater_equal<>()) != s.cells().end())
    return "cells out of order";
  return s.cells().back() < kMaxCells ? "" : "impossible cell";
}

std::string problem(const wire::Lack& s) { return s.world() < kMaxWorlds ? "" : "impossible world"; }

bool good_session_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '-' ||
           c == '_';
  });
}

void check_session_name(const std::string& name) {
  if (!good_session_name(name))
    throw std::invalid_argument("--session: 1 to 64 letters, digits, dots, dashes and underscores, not '" + name + "'");
}

}  // namespace soda::dds
