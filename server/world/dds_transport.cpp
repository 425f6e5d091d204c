#include "server/world/dds_transport.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

namespace soda::world {
namespace {

// After a write that failed: a stopped or dead reader has left the history full, and every further attempt would cost
// the loop another wait. Longer than a heartbeat, so that a reader that lives has had the time to acknowledge.
constexpr std::chrono::milliseconds kRetryAfter{150};

}  // namespace

struct DdsTransport::Link {
  WorldId id = 0;
  // Set on threads of DDS.
  std::atomic<bool> met_reader{false}, met_writer{false};  // ever
  std::atomic<int> readers{0};  // that are there; a replacement may be found before its predecessor is given up
  bool reader_gone() const { return met_reader.load() && readers.load() <= 0; }
  // Of the daemon's thread.
  bool missed = false;  // a message was dropped, and nobody has been told yet
  Clock::time_point retry_at{};
  wire::Border sample;
  // Last, so that no handler finds the rest gone.
  std::unique_ptr<dds::Writer<wire::Border>> writer;
  std::unique_ptr<dds::Reader<wire::Border>> reader;
};

DdsTransport::DdsTransport(dds::Participant& participant, WorldId me) : participant_(participant), me_(me) {}
DdsTransport::~DdsTransport() = default;

void DdsTransport::open(std::span<const WorldId> neighbours) {
  for (const WorldId id : neighbours) {
    Link& link = *links_.emplace_back(std::make_unique<Link>());
    link.id = id;
    link.sample.from(me_);
    link.sample.to(id);
    link.writer = std::make_unique<dds::Writer<wire::Border>>(
        participant_, dds::border_topic(me_, id), [this, &link](int change) { readers_changed(link, change); });
    link.reader = std::make_unique<dds::Reader<wire::Border>>(
        participant_, dds::border_topic(id, me_),
        [this, &link](wire::Border&& sample, const dds::WriterKey&) { came(link, std::move(sample)); },
        [this, &link](int change) { writers_changed(link, change); });
  }
}

bool DdsTransport::connected() const {
  return std::all_of(links_.begin(), links_.end(),
                     [](const auto& link) { return link->met_reader.load() && link->met_writer.load(); });
}

DdsTransport::Link* DdsTransport::find(WorldId neighbour) {
  for (const auto& link : links_)
    if (link->id == neighbour) return link.get();
  return nullptr;
}

void DdsTransport::readers_changed(Link& link, int change) {
  const int left = link.readers.fetch_add(change) + change;
  if (change < 0) {
    if (left <= 0) spdlog::info("lost world {}", link.id);
    return;
  }
  const bool again = link.met_reader.exchange(true);
  if (again) {
    spdlog::info("world {} is back", link.id);
    inbox_.push({Incoming::Kind::kInterrupted, link.id, {}});
  } else {
    inbox_.wake();
  }
}

void DdsTransport::writers_changed(Link& link, int change) {
  if (change < 0) return;
  const bool again = link.met_writer.exchange(true);
  if (again)
    inbox_.push({Incoming::Kind::kInterrupted, link.id, {}});
  else
    inbox_.wake();
}

void DdsTransport::came(const Link& link, wire::Border&& sample) {
  if (sample.from() != link.id || sample.to() != me_) {
    dds::refusals().add("border topic of world " + std::to_string(link.id), "it is not of this pair");
    return;
  }
  Incoming incoming{Incoming::Kind::kMessage, link.id, std::vector<std::byte>(sample.payload().size())};
  std::memcpy(incoming.bytes.data(), sample.payload().data(), incoming.bytes.size());
  inbox_.push(std::move(incoming));
}

void DdsTransport::send(WorldId to, std::vector<std::byte> bytes) {
  Link* link = find(to);
  if (link == nullptr) {
    spdlog::error("a message for world {}, which is no neighbour, was dropped", to);
    return;
  }
  // Before the first meeting DDS keeps samples for the reader to come. After a parting the core sends again anyway.
  const bool try_now = !link->reader_gone() && Clock::now() >= link->retry_at;
  if (try_now) {
    const auto* first = reinterpret_cast<const std::uint8_t*>(bytes.data());
    link->sample.payload().assign(first, first + bytes.size());
    if (link->writer->write(link->sample)) return;
    link->retry_at = Clock::now() + kRetryAfter;
    spdlog::debug("world {} does not take what it is sent", to);
  }
  link->missed = true;
  any_missed_ = true;
}

std::optional<Incoming> DdsTransport::receive() {
  if (auto incoming = inbox_.pop()) return incoming;
  if (!any_missed_) return std::nullopt;
  const auto now = Clock::now();
  any_missed_ = false;
  for (const auto& link : links_) {
    if (!link->missed) continue;
    if (!link->reader_gone() && now >= link->retry_at) {
      link->missed = false;
      any_missed_ = true;  // there may be others: look again next time
      return Incoming{Incoming::Kind::kInterrupted, link->id, {}};
    }
    any_missed_ = true;
  }
  return std::nullopt;
}

void DdsTransport::wait(std::chrono::steady_clock::duration at_most) {
  if (any_missed_) at_most = std::min<std::chrono::steady_clock::duration>(at_most, kRetryAfter);
  inbox_.wait(at_most);
}

void DdsTransport::flush(std::chrono::steady_clock::duration at_most) {
  const auto until = Clock::now() + at_most;
  for (const auto& link : links_) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now());
    if (link->reader_gone()) continue;
    if (left.count() <= 0 || !link->writer->wait_acknowledged(left))
      spdlog::warn("world {} has not acknowledged everything that it was sent", link->id);
  }
}

}  // namespace soda::world
