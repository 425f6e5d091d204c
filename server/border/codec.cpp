#include "server/border/codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <string>
#include <type_traits>

#include "server/physics/tuning.h"

namespace soda::border {
namespace {

static_assert(std::endian::native == std::endian::little, "the wire format is this machine's");

constexpr std::uint32_t kMagic = 0x41444f53;  // "SODA"
constexpr std::size_t kRecordHead = sizeof(ContactRecord) - kMaxContactPoints * sizeof(ContactPoint);

void put_bytes(std::vector<std::byte>& out, const void* data, std::size_t size) {
  const auto* const bytes = static_cast<const std::byte*>(data);
  out.insert(out.end(), bytes, bytes + size);
}

template <typename T>
void put(std::vector<std::byte>& out, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  put_bytes(out, &value, sizeof value);
}

class Reader {
 public:
  explicit Reader(std::span<const std::byte>& in) : in_(in) {}

  template <typename T>
  T get(const char* field) {
    T value;
    get_bytes(&value, sizeof(T), field);
    return value;
  }
  void get_bytes(void* to, std::size_t size, const char* field) {
    if (in_.size() < size) throw CodecError(std::string(field) + ": cut short");
    if (size == 0) return;  // `to` may be null then
    std::memcpy(to, in_.data(), size);
    in_ = in_.subspan(size);
  }
  // A count of things that take at least `least` bytes each: refused before memory is taken for them.
  std::size_t count(std::size_t least, const char* field) {
    const auto n = get<std::uint32_t>(field);
    if (n > in_.size() / least) throw CodecError(std::string(field) + ": more than the message holds");
    return n;
  }
  bool empty() const { return in_.empty(); }

 private:
  std::span<const std::byte>& in_;
};

bool finite(const double* p, int n) {
  double sum = 0;
  for (int i = 0; i < n; ++i) sum += p[i] * 0.0;
  return sum == 0;
}

bool unit(const double* q) {
  const double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return std::abs(square - 1) < 1e-6;
}

std::string name(BodyId id) { return "body " + std::to_string(id); }

void check(const BodyState& body, const physics::Model& model) {
  if (!model.find(body.id)) throw CodecError(name(body.id) + ": not in the scene");
  if (!finite(body.position, 13)) throw CodecError(name(body.id) + ": not finite");
  if (!unit(body.orientation)) throw CodecError(name(body.id) + ": orientation is not a unit quaternion");
  if (body.flags & ~std::uint32_t{kAsleep | 7u * kDriveReversed | 7u * kStiffness | kInHeap})
    throw CodecError(name(body.id) + ": unknown flags");
  if (body.stiffness() > physics::kMostSubstepLevel) throw CodecError(name(body.id) + ": stiffer than anything is");
}

void check(const ContactRecord& record, const physics::Model& model) {
  if (!model.find(record.a)) throw CodecError("contact of " + name(record.a) + ": not in the scene");
  if (record.with_static() ? !model.find_static(record.b & ~kStaticBit) : !model.find(record.b))
    throw CodecError("contact of " + name(record.a) + ": partner not in the scene");
  if (!record.with_static() && record.b <= record.a)
    throw CodecError("contact of " + name(record.a) + ": does not belong to the lower id");
  if (is_joint(record)) {
    if (!model.find_joint(record)) throw CodecError("joint of " + name(record.a) + ": not in the scene");
    if (record.count != 1) throw CodecError("joint of " + name(record.a) + ": not one point");
  } else {
    const physics::BodyModel& a = *model.find(record.a);
    const physics::BodyModel* const b = record.with_static() ? nullptr : model.find(record.b);
    if (record.b == (kStaticBit | kWorldBody))
      throw CodecError("contact of " + name(record.a) + ": the world is not to be touched");
    if (record.part >> 20 >= a.children || (b && (record.part >> 8 & 0xfff) >= b->children))
      throw CodecError("contact of " + name(record.a) + ": part is of no shape");
    if (a.kinematic && (!b || b->kinematic))
      throw CodecError("contact of " + name(record.a) + ": neither body can be pushed");
  }
  constexpr int kHeadDoubles = (static_cast<int>(kRecordHead) - 24) / 8;
  if (!finite(record.normal, kHeadDoubles)) throw CodecError("contact of " + name(record.a) + ": not finite");
  if (!unit(record.orientation_a) || !unit(record.orientation_b))
    throw CodecError("contact of " + name(record.a) + ": orientation is not a unit quaternion");
  for (std::uint32_t i = 0; i < record.count; ++i)
    if (!finite(record.points[i].arm_a, 7)) throw CodecError("contact of " + name(record.a) + ": point not finite");
}

void put_frame(std::vector<std::byte>& out, const Frame& frame) {
  put(out, frame.step);
  put(out, frame.revision);
  encode_set(frame.set, out);
}

void get_set(std::span<const std::byte>& bytes, const physics::Model& model, BodySet& set) {
  Reader in(bytes);
  const std::size_t bodies = in.count(sizeof(BodyState), "bodies");
  const std::size_t contacts = in.count(kRecordHead, "contacts");
  set.bodies.resize(bodies);
  in.get_bytes(set.bodies.data(), bodies * sizeof(BodyState), "bodies");
  for (std::size_t i = 0; i < bodies; ++i) {
    check(set.bodies[i], model);
    if (i > 0 && set.bodies[i].id <= set.bodies[i - 1].id) throw CodecError(name(set.bodies[i].id) + ": out of order");
  }
  set.contacts.assign(contacts, {});
  for (std::size_t i = 0; i < contacts; ++i) {
    ContactRecord& record = set.contacts[i];
    in.get_bytes(&record, kRecordHead, "contact record");
    if (record.count < 1 || record.count > kMaxContactPoints)
      throw CodecError("contact of " + name(record.a) + ": number of points");
    in.get_bytes(record.points, record.count * sizeof(ContactPoint), "contact points");
    check(record, model);
    if (i > 0 && !record_before(set.contacts[i - 1], record))
      throw CodecError("contact of " + name(record.a) + ": out of order");
  }
}

void get_frame(Reader& in, std::span<const std::byte>& rest, const physics::Model& model, Frame& frame) {
  frame.step = in.get<Step>("frame step");
  frame.revision = in.get<Revision>("frame revision");
  get_set(rest, model, frame.set);
}

void put_part(std::vector<std::byte>& out, const Part& part) {
  put(out, part.origin);
  put(out, part.step);
  put(out, part.revision);
  put(out, static_cast<std::uint8_t>(part.whole));
  put(out, static_cast<std::uint32_t>(part.components.size()));
  for (const auto& component : part.components) {
    encode_set(component->set, out);
    put(out, static_cast<std::uint32_t>(component->ports.size()));
    for (const Port& port : component->ports) {
      put(out, port.body);
      put(out, port.owner);
      put(out, port.record);
    }
  }
}

Part get_part(Reader& in, std::span<const std::byte>& rest, const physics::Model& model) {
  Part part;
  part.origin = in.get<WorldId>("part origin");
  part.step = in.get<Step>("part step");
  part.revision = in.get<Revision>("part revision");
  part.whole = in.get<std::uint8_t>("part whole") != 0;
  part.components.resize(in.count(12, "part components"));
  for (auto& kept : part.components) {
    Component component;
    component.set = decode_set(rest, model);
    component.ports.resize(in.count(20, "ports"));
    for (Port& port : component.ports) {
      port.body = in.get<BodyId>("port body");
      port.owner = in.get<WorldId>("port owner");
      port.record = in.get<std::uint64_t>("port record");
      if (!model.find(port.body)) throw CodecError("port: " + name(port.body) + " is not in the scene");
    }
    kept = std::make_shared<const Component>(std::move(component));
  }
  return part;
}

void put_cells(std::vector<std::byte>& out, const std::vector<std::uint32_t>& cells) {
  put(out, static_cast<std::uint32_t>(cells.size()));
  put_bytes(out, cells.data(), cells.size() * sizeof(std::uint32_t));
}

std::vector<std::uint32_t> get_cells(Reader& in) {
  std::vector<std::uint32_t> cells(in.count(sizeof(std::uint32_t), "cells"));
  in.get_bytes(cells.data(), cells.size() * sizeof(std::uint32_t), "cells");
  if (cells.empty()) throw CodecError("cells: none");
  if (std::adjacent_find(cells.begin(), cells.end(), std::greater_equal()) != cells.end())
    throw CodecError("cells: out of order");
  return cells;
}

void put_territory(std::vector<std::byte>& out, const Message& message) {
  put(out, static_cast<std::uint32_t>(message.transfers.size()));
  put(out, static_cast<std::uint32_t>(message.offers.size()));
  put(out, static_cast<std::uint32_t>(message.answers.size()));
  put(out, static_cast<std::uint8_t>(message.load.has_value()));
  for (const Transfer& t : message.transfers) {
    put(out, t.giver);
    put(out, t.number);
    put(out, t.step);
    put(out, t.taker);
    put_cells(out, t.cells);
  }
  for (const Offer& offer : message.offers) {
    put(out, offer.number);
    put(out, offer.cost);
    put_cells(out, offer.cells);
  }
  for (const Answer& answer : message.answers) {
    put(out, answer.number);
    put(out, static_cast<std::uint8_t>(answer.accepted));
  }
  if (message.load)
    for (const double value : {message.load->work, message.load->expected, message.load->coming, message.load->on_time})
      put(out, value);
}

void get_territory(Reader& in, Message& message) {
  const std::size_t transfers = in.count(24, "transfers"), offers = in.count(16, "offers"),
                    answers = in.count(5, "answers");
  const bool has_load = in.get<std::uint8_t>("load") != 0;
  for (std::size_t i = 0; i < transfers; ++i) {
    Transfer& t = message.transfers.emplace_back();
    t.giver = in.get<WorldId>("giver");
    t.number = in.get<std::uint32_t>("transfer number");
    t.step = in.get<Step>("transfer step");
    t.taker = in.get<WorldId>("taker");
    t.cells = get_cells(in);
  }
  for (std::size_t i = 0; i < offers; ++i) {
    Offer& offer = message.offers.emplace_back();
    offer.number = in.get<std::uint32_t>("offer number");
    offer.cost = in.get<double>("offered cost");
    if (!(offer.cost >= 0) || std::isinf(offer.cost)) throw CodecError("offer: its cost cannot be");
    offer.cells = get_cells(in);
  }
  for (std::size_t i = 0; i < answers; ++i) {
    const auto number = in.get<std::uint32_t>("answer number");
    message.answers.push_back({number, in.get<std::uint8_t>("answer") != 0});
  }
  if (!has_load) return;
  Load& load = message.load.emplace();
  load.work = in.get<double>("load");
  load.expected = in.get<double>("expected load");
  load.coming = in.get<double>("load to come");
  load.on_time = in.get<double>("steps on time");
  if (!(load.work >= 0 && load.expected >= 0 && load.coming >= 0 && load.on_time >= 0) ||
      std::isinf(load.work + load.expected + load.coming))
    throw CodecError("load: cannot be");
}

Header get_header(Reader& in) {
  if (in.get<std::uint32_t>("magic") != kMagic) throw CodecError("not a SODA border message");
  if (const auto version = in.get<std::uint32_t>("version"); version != kCodecVersion)
    throw CodecError("border message of version " + std::to_string(version) + ", this is " +
                     std::to_string(kCodecVersion));
  Header h;
  h.session = in.get<std::uint64_t>("session");
  h.from = in.get<WorldId>("from");
  h.to = in.get<WorldId>("to");
  h.epoch = in.get<std::uint32_t>("epoch");
  h.to_epoch = in.get<std::uint32_t>("to_epoch");
  h.sequence = in.get<std::uint64_t>("sequence");
  h.ack = in.get<std::uint64_t>("ack");
  const auto ask = in.get<std::uint8_t>("ask");
  if (ask > static_cast<std::uint8_t>(Ask::kAgain)) throw CodecError("ask: no such question");
  h.ask = static_cast<Ask>(ask);
  h.sent = in.get<std::uint64_t>("sent");
  h.upto = in.get<Step>("upto");
  h.final_step = in.get<Step>("final");
  h.near_final = in.get<Step>("near final");
  h.durable = in.get<Step>("durable");
  h.logged = in.get<ActionNumber>("logged");
  return h;
}

// Every contact is between bodies that are there; in a frame its partner may be elsewhere.
void check_ends(const BodySet& set, const std::vector<Port>& ports, bool owner_only) {
  const auto there = [&](BodyId id) {
    return std::binary_search(set.bodies.begin(), set.bodies.end(), BodyState{.id = id},
                              [](const BodyState& l, const BodyState& r) { return l.id < r.id; }) ||
           std::any_of(ports.begin(), ports.end(), [&](const Port& p) { return p.body == id; });
  };
  for (const ContactRecord& c : set.contacts)
    if (!there(c.a) || (!owner_only && !c.with_static() && !there(c.b)))
      throw CodecError("contact of " + name(c.a) + ": its body is not in the set");
}

}  // namespace

void check(const Message& message, WorldId me, WorldId worlds) {
  for (const Frame& frame : message.frames) check_ends(frame.set, {}, true);
  for (const Part& part : message.parts) {
    if (part.origin >= worlds || part.origin == me)
      throw CodecError("part: origin " + std::to_string(part.origin) + " cannot be");
    for (const auto& component : part.components) {
      if (!part.whole && component->set.bodies.empty()) throw CodecError("part: of its components one has no bodies");
      for (const Port& port : component->ports)
        if (port.owner >= worlds) throw CodecError("port: no world " + std::to_string(port.owner));
      check_ends(component->set, component->ports, false);
    }
  }
  for (const FinalPart& part : message.finals)
    if (part.origin >= worlds || part.origin == me)
      throw CodecError("final part: origin " + std::to_string(part.origin) + " cannot be");
}

void encode_set(const BodySet& set, std::vector<std::byte>& out) {
  put(out, static_cast<std::uint32_t>(set.bodies.size()));
  put(out, static_cast<std::uint32_t>(set.contacts.size()));
  put_bytes(out, set.bodies.data(), set.bodies.size() * sizeof(BodyState));
  for (const ContactRecord& record : set.contacts)
    put_bytes(out, &record, kRecordHead + record.count * sizeof(ContactPoint));
}

BodySet decode_set(std::span<const std::byte>& bytes, const physics::Model& model) {
  BodySet set;
  get_set(bytes, model, set);
  return set;
}

std::vector<std::byte> encode(const Message& message) {
  std::vector<std::byte> out;
  encode(message, out);
  return out;
}

void encode(const Message& message, std::vector<std::byte>& out) {
  out.clear();
  const Header& h = message.header;
  put(out, kMagic);
  put(out, kCodecVersion);
  put(out, h.session);
  put(out, h.from);
  put(out, h.to);
  put(out, h.epoch);
  put(out, h.to_epoch);
  put(out, h.sequence);
  put(out, h.ack);
  put(out, static_cast<std::uint8_t>(h.ask));
  put(out, h.sent);
  put(out, h.upto);
  put(out, h.final_step);
  put(out, h.near_final);
  put(out, h.durable);
  put(out, h.logged);
  put(out, static_cast<std::uint32_t>(message.frames.size()));
  put(out, static_cast<std::uint32_t>(message.parts.size()));
  put(out, static_cast<std::uint32_t>(message.finals.size()));
  for (const Frame& frame : message.frames) put_frame(out, frame);
  for (const Part& part : message.parts) put_part(out, part);
  for (const FinalPart& part : message.finals) {
    put(out, part.origin);
    put(out, part.step);
    put(out, part.revision);
  }
  put_territory(out, message);
}

Header decode_header(std::span<const std::byte> bytes) {
  Reader in(bytes);
  return get_header(in);
}

Message& Decoder::decode(std::span<const std::byte> bytes, const physics::Model& model) {
  for (Frame& frame : message_.frames) spare_.push_back(std::move(frame.set));
  message_.clear();
  std::span<const std::byte> rest = bytes;
  Reader in(rest);
  message_.header = get_header(in);
  const std::size_t frames = in.count(24, "frames"), parts = in.count(24, "parts"),
                    finals = in.count(20, "final parts");
  for (std::size_t i = 0; i < frames; ++i) {
    Frame& frame = message_.frames.emplace_back();
    if (!spare_.empty()) {
      frame.set = std::move(spare_.back());
      spare_.pop_back();
    }
    get_frame(in, rest, model, frame);
  }
  for (std::size_t i = 0; i < parts; ++i) message_.parts.push_back(get_part(in, rest, model));
  for (std::size_t i = 0; i < finals; ++i) {
    FinalPart part;
    part.origin = in.get<WorldId>("final part origin");
    part.step = in.get<Step>("final part step");
    part.revision = in.get<Revision>("final part revision");
    message_.finals.push_back(part);
  }
  get_territory(in, message_);
  if (!in.empty()) throw CodecError("border message: more bytes than it says");
  return message_;
}

Message decode(std::span<const std::byte> bytes, const physics::Model& model) {
  Decoder decoder;
  return std::move(decoder.decode(bytes, model));
}

}  // namespace soda::border
