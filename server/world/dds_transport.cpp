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
// Longest payload that goes as a datagram, bytes. Of UDP's 64 KiB not all, because some of these come at once from
// several neighbours, and what does not fit into the receiver's socket buffer is lost.
constexpr std::size_t kDatagram = 16 * 1024;

}  // namespace

struct DdsTransport::Link {
  WorldId id = 0;
  // Set on threads of DDS.
  std::atomic<bool> met_reader{false}, met_writer{false};  // ever
  std::atomic<int> readers{0};       // that are there; a replacement may be found before its predecessor is given up
  std::atomic<bool> just_met{true};  // nothing has been sent since
  bool reader_gone() const { return met_reader.load() && readers.load() <= 0; }
  // Of the daemon's thread.
  bool missed = false;     // a message was dropped, and nobody has been told yet
  bool long_ones = false;  // have been sent, and were not all acknowledged when last looked
  Clock::time_point retry_at{};
  wire::Border sample;
  // Last, so that no handler finds the rest gone.
  std::unique_ptr<dds::Writer<wire::Border>> datagrams;
  std::unique_ptr<dds::Writer<wire::Border>> writer;
  std::unique_ptr<dds::Reader<wire::Border>> reader;

  bool write() {
    // The first reliably: whoever has just been met may not have met all of this world's writers.
    if (!just_met.exchange(false) && sample.payload().size() <= kDatagram && may_be_datagram())
      return datagrams->write(sample);
    long_ones = true;
    return writer->write(sample);
  }
  bool may_be_datagram() {
    // Who has become a neighbour must have noticed.
    if (readers.load() <= 0 || !datagrams->matched()) return false;
    // Nor may it overtake what is under way: it would be taken for the end of a gap.
    if (long_ones) long_ones = !writer->wait_acknowledged(std::chrono::milliseconds(0));
    return !long_ones;
  }
};

DdsTransport::DdsTransport(dds::Participant& participant, WorldId me) : participant_(participant), me_(me) {}
DdsTransport::~DdsTransport() = default;

void DdsTransport::open(std::span<const WorldId> neighbours) {
  if (!datagrams_ && !neighbours.empty())
    datagrams_ = std::make_unique<dds::Reader<wire::Border>>(
        participant_, dds::border_datagram_topic(me_),
        [this](wire::Border&& sample, const dds::WriterKey&) {
          const WorldId from = sample.from();
          if (from < kMaxWorlds && opened_[from].load())
            came(from, std::move(sample));
          else
            dds::refusals().add("border topic of world " + std::to_string(me_),
                                "world " + std::to_string(from) + " is no neighbour");
        },
        [this](int change) {
          datagram_writers_ += change;
          inbox_.wake();
        });
  for (const WorldId id : neighbours) {
    opened_.at(id).store(true);
    Link& link = *links_.emplace_back(std::make_unique<Link>());
    link.id = id;
    link.sample.from(me_);
    link.sample.to(id);
    link.datagrams = std::make_unique<dds::Writer<wire::Border>>(participant_, dds::border_datagram_topic(id),
                                                                 [this](int) { inbox_.wake(); });
    link.writer = std::make_unique<dds::Writer<wire::Border>>(
        participant_, dds::border_topic(me_, id), [this, &link](int change) { readers_changed(link, change); });
    link.reader = std::make_unique<dds::Reader<wire::Border>>(
        participant_, dds::border_topic(id, me_),
        [this, id](wire::Border&& sample, const dds::WriterKey&) { came(id, std::move(sample)); },
        [this, &link](int change) { writers_changed(link, change); });
  }
}

bool DdsTransport::connected() const {
  return datagram_writers_.load() >= std::ssize(links_) &&
         std::all_of(links_.begin(), links_.end(), [](const auto& link) {
           return link->met_reader.load() && link->met_writer.load() && link->datagrams->matched();
         });
}

DdsTransport::Link* DdsTransport::find(WorldId neighbour) {
  for (const auto& link : links_)
    if (link->id == neighbour) return link.get();
  return nullptr;
}

void DdsTransport::readers_changed(Link& link, int change) {
  if (change > 0) link.just_met.store(true);
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

void DdsTransport::came(WorldId from, wire::Border&& sample) {
  if (sample.from() != from || sample.to() != me_) {
    dds::refusals().add("border topic of world " + std::to_string(from), "it is not of this pair");
    return;
  }
  Incoming incoming{Incoming::Kind::kMessage, from, std::vector<std::byte>(sample.payload().size())};
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
    if (link->write()) return;
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
