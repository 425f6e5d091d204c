#include "server/border/world_core.h"

#include <algorithm>
#include <cstring>
#include <deque>
#include <iterator>
#include <limits>
#include <set>
#include <utility>

#include "common/state_hash.h"
#include "server/border/link.h"
#include "server/border/mixed_islands.h"
#include "server/border/near_sets.h"
#include "server/border/neighbourhood.h"
#include "server/physics/stepper.h"

namespace soda::border {
namespace {

// Keeps the elements whose position `wanted` says yes to, in order; in runs, for they are large and most are kept.
template <typename T, typename Wanted>
void keep(std::vector<T>& all, Wanted&& wanted) {
  std::size_t to = 0;
  for (std::size_t from = 0; from < all.size();) {
    if (!wanted(from)) {
      ++from;
      continue;
    }
    std::size_t end = from + 1;
    while (end < all.size() && wanted(end)) ++end;
    if (to != from) std::memmove(&all[to], &all[from], (end - from) * sizeof(T));
    to += end - from;
    from = end;
  }
  all.resize(to);
}

}  // namespace

class WorldCore::Impl {
 public:
  Impl(const physics::Model& model, const TerritoryMap& map, const CoreSettings& settings, Observer& observer)
      : model_(model),
        map_(map),
        settings_(settings),
        observer_(observer),
        neighbourhood_(model, map, settings.me),
        stepper_(model),
        mixed_(neighbourhood_) {
    for (const WorldId n : neighbourhood_.neighbours())
      links_.emplace_back(settings.session, settings.me, settings.epoch, n);
    heard_.resize(links_.size());
    told_.resize(links_.size());
    BodySet own;
    for (const BodyState& body : model.initial_state().bodies)
      if (neighbourhood_.owner(body) == settings.me) own.bodies.push_back(body);
    take_state(std::move(own));
    finalise();  // state 0 is the scene
  }

  bool receive(std::span<const std::byte> bytes) {
    try {
      Message message = decode(bytes, model_);
      const Header& h = message.header;
      if (h.session != settings_.session)
        throw CodecError("border message of another session (scene, worlds or steps differ)");
      if (h.to != settings_.me) throw CodecError("border message for world " + std::to_string(h.to));
      Link* link = link_to(h.from);
      if (!link) throw CodecError("border message from world " + std::to_string(h.from) + ", which is no neighbour");
      check(message, settings_.me, map_.worlds);
      const std::uint64_t before = link->duplicates();
      link->receive(std::move(message), [&](Message& m) { deliver(*link, m); });
      stats_.duplicates += link->duplicates() - before;
      finalise();
      return true;
    } catch (const CodecError& error) {
      ++stats_.refused;
      refusal_ = error.what();
      return false;
    }
  }

  Progress work() {
    waiting_ = false;
    const Progress progress = advance();
    finalise();
    if (progress != Progress::kWorked) waiting_ = true;
    return progress;
  }

  std::vector<Outgoing> take_outgoing() {
    std::vector<Outgoing> out;
    std::vector<std::vector<std::byte>> messages;
    for (Link& link : links_) {
      messages.clear();
      const std::uint64_t resent = link.resent();
      link.collect(messages);
      stats_.messages_resent += link.resent() - resent;
      // A new final step alone is worth a message only when there is nothing else to do: else the next one carries it.
      if (link.has_content() || link.told_upto() != clock_ || (waiting_ && link.told_final() != final_))
        link.send(clock_, final_, messages);
      for (auto& bytes : messages) {
        ++stats_.messages_sent;
        stats_.bytes_sent += bytes.size();
        out.push_back({link.peer(), std::move(bytes)});
      }
    }
    return out;
  }

  void reconnect(WorldId neighbour) {
    if (Link* link = link_to(neighbour)) link->interrupted();
  }

  std::vector<WorldId> waiting_for() const {
    std::set<WorldId> worlds;
    if (stage_ == Stage::kGather || clock_ == settings_.last_step) {
      for (const Link& link : links_)
        if (clock_ == settings_.last_step ? link.final_step() < clock_ : link.upto() < clock_)
          worlds.insert(link.peer());
    } else {
      // Whoever's part is missing may have it from somebody else: all neighbours are asked.
      if (!open_.empty())
        for (const Link& link : links_) worlds.insert(link.peer());
    }
    return {worlds.begin(), worlds.end()};
  }

  Step clock_ = 0, final_ = -1, limit_ = std::numeric_limits<Step>::max();
  CoreStats stats_;
  std::string refusal_;
  std::size_t own_bodies_ = 0;

 private:
  friend class WorldCore;
  enum class Stage {
    kGather,  // waits for every neighbour's stream to reach the clock
    kLocal,   // contacts are found and parts are on their way: own islands are solved meanwhile
    kMixed,   // waits for the parts of others
  };

  Link* link_to(WorldId world) {
    for (Link& link : links_)
      if (link.peer() == world) return &link;
    return nullptr;
  }

  // ---- what comes in
  // -------------------------------------------------------------------------------------------------
  void deliver(const Link& link, Message& message) {
    const auto index = static_cast<std::size_t>(&link - links_.data());
    const Step upto = message.header.upto;
    if (upto < clock_ - 1 || upto > clock_ + 2) throw CodecError("stream: step " + std::to_string(upto) + " cannot be");
    for (Frame& frame : message.frames) {
      if (frame.step < clock_ || frame.step > upto)
        throw CodecError("frame: step " + std::to_string(frame.step) + " is final or not reached");
      heard_[index].hear(frame.step, std::move(frame.set));
    }
    for (Part& part : message.parts) {
      if (part.step > clock_ + 2) throw CodecError("part: step " + std::to_string(part.step) + " cannot be");
      if (part.step > clock_)
        later_parts_.push_back(std::move(part));
      else if (part.step == clock_)
        new_parts_ |= mixed_.add(std::move(part));
    }
  }

  // ---- the step
  // ------------------------------------------------------------------------------------------------------
  Progress advance() {
    switch (stage_) {
      case Stage::kGather:
        if (clock_ == settings_.last_step) return all_final() ? Progress::kDone : Progress::kWaiting;
        if (clock_ >= limit_) return Progress::kAtLimit;
        for (const Link& link : links_)
          if (link.upto() < clock_) return Progress::kWaiting;
        gather();
        find_islands();
        stage_ = Stage::kLocal;
        return Progress::kWorked;
      case Stage::kLocal:
        stepper_.solve(known_.bodies, known_.contacts, ends_, islands_, local_);
        stage_ = Stage::kMixed;
        return Progress::kWorked;
      case Stage::kMixed:
        solve_mixed();
        if (!open_.empty()) return Progress::kWaiting;
        complete();
        stage_ = Stage::kGather;
        return Progress::kWorked;
    }
    return Progress::kWaiting;
  }

  // Everything known at the clock: what was produced here and what was heard.
  void gather() {
    const BodySet& produced = states_.back().set;
    heard_now_.clear();
    for (HeardBodies& heard : heard_) {
      bool told = false;
      const BodySet& set = heard.at(clock_, told);
      if (told)
        for (const BodyState& body : set.bodies) stats_.arrived += neighbourhood_.owner(body) == settings_.me;
      heard_now_.bodies.insert(heard_now_.bodies.end(), set.bodies.begin(), set.bodies.end());
      heard_now_.contacts.insert(heard_now_.contacts.end(), set.contacts.begin(), set.contacts.end());
    }
    if (heard_now_.bodies.empty()) {
      known_.bodies = produced.bodies;
      return;
    }
    const auto lower_id = [](const BodyState& l, const BodyState& r) { return l.id < r.id; };
    std::sort(heard_now_.bodies.begin(), heard_now_.bodies.end(), lower_id);
    std::sort(heard_now_.contacts.begin(), heard_now_.contacts.end(), record_before);
    known_.bodies.resize(produced.bodies.size() + heard_now_.bodies.size());
    std::merge(produced.bodies.begin(), produced.bodies.end(), heard_now_.bodies.begin(), heard_now_.bodies.end(),
               known_.bodies.begin(), lower_id);
    for (std::size_t i = 1; i < known_.bodies.size(); ++i)
      if (known_.bodies[i].id == known_.bodies[i - 1].id)
        throw ProtocolError("body " + std::to_string(known_.bodies[i].id) + " was produced twice at step " +
                            std::to_string(clock_));
  }

  void find_islands() {
    const std::size_t n = known_.bodies.size();
    own_.resize(n);
    roles_.resize(n);
    std::set<WorldId> hearers_of_part;
    std::vector<std::uint8_t> wide_own(n, 0);
    std::vector<WorldId> worlds;
    own_bodies_ = 0;
    const std::vector<BodyState>& produced = states_.back().set.bodies;
    for (std::size_t i = 0, p = 0; i < n; ++i) {
      const BodyState& body = known_.bodies[i];
      const bool ours = p < produced.size() && produced[p].id == body.id;
      const auto [owner, wide, inside] = links_.empty() ? Neighbourhood::Place{settings_.me}
                                         : ours         ? places_[p]
                                                        : neighbourhood_.place(body);
      p += ours;
      own_[i] = owner == settings_.me;
      own_bodies_ += own_[i];
      roles_[i] = own_[i] ? physics::kRoleWanted : physics::kRoleNone;
      if (!wide) continue;
      roles_[i] |= physics::kRoleWide;
      neighbourhood_.reached(body, worlds);
      if (own_[i]) {
        // Whoever it reaches must say what touches it there.
        wide_own[i] = !worlds.empty();
        hearers_of_part.insert(worlds.begin(), worlds.end());
        stats_.wide_bodies += worlds.size();
      } else if (std::binary_search(worlds.begin(), worlds.end(), settings_.me)) {
        hearers_of_part.insert(owner);
      }
    }
    const physics::Stepper::Records previous[] = {states_.back().set.contacts, heard_now_.contacts};
    own_contacts_ = stepper_.find_contacts(known_.bodies, previous, roles_, known_.contacts);
    stepper_.find_islands(known_.bodies, known_.contacts, ends_, islands_);

    // Islands of our own alone, and components of islands that others share.
    local_.clear();
    Part part;
    part.origin = settings_.me;
    part.step = part.through = clock_;
    part.revision = {settings_.epoch, 0};
    part.final = true;
    for (std::uint32_t k = 0; k < islands_.size(); ++k) {
      const auto members = islands_.bodies_of(k);
      const bool foreign = std::any_of(members.begin(), members.end(), [&](std::uint32_t i) { return !own_[i]; });
      const bool wide = std::any_of(members.begin(), members.end(), [&](std::uint32_t i) { return wide_own[i]; });
      if (!foreign && !wide) {
        local_.push_back(k);
        continue;
      }
      if (foreign && islands_.contacts_of(k).empty()) continue;  // a near body that touches nothing of ours
      Component component;
      for (const std::uint32_t i : members) {
        const BodyState& body = known_.bodies[i];
        if (own_[i]) {
          component.set.bodies.push_back(body);
        } else {
          component.ports.push_back({body.id, neighbourhood_.owner(body), record_hash(body)});
          hearers_of_part.insert(component.ports.back().owner);
        }
      }
      for (const std::uint32_t c : islands_.contacts_of(k)) component.set.contacts.push_back(known_.contacts[c]);
      std::sort(component.set.contacts.begin(), component.set.contacts.end(), record_before);
      part.components.push_back(std::move(component));
    }
    // Every part of a step goes out before any is waited for.
    for (const WorldId world : hearers_of_part)
      if (Link* link = link_to(world)) {
        link->add(part);
        ++stats_.parts_sent;
      }
    if (!hearers_of_part.empty()) ++stats_.syncs;
    part_hearers_.assign(hearers_of_part.begin(), hearers_of_part.end());
    passed_on_.clear();
    open_.clear();
    for (std::uint32_t i = 0; i < part.components.size(); ++i) open_.push_back(i);
    mixed_.add(std::move(part));
    new_parts_ = true;
    unknown_contacts_.clear();
  }

  void solve_mixed() {
    if (!std::exchange(new_parts_, false)) return;
    for (std::size_t i = 0; i < open_.size();) {
      const MixedIslands::Closure closure = mixed_.close({settings_.me, open_[i]});
      pass_on(closure);
      if (!closure.missing.empty()) {
        ++i;
        continue;
      }
      // Several of our components may be of one island.
      std::erase_if(open_, [&](std::uint32_t c) {
        return std::binary_search(closure.components.begin(), closure.components.end(),
                                  MixedIslands::Key{settings_.me, c});
      });
      i = 0;
      solve_whole(mixed_.assemble(closure));
    }
  }

  // What is used here of other worlds goes on to those that share the island, so that all parts reach all its worlds.
  void pass_on(const MixedIslands::Closure& closure) {
    const auto shares = [&](WorldId world) {
      return std::binary_search(closure.worlds.begin(), closure.worlds.end(), world) ||
             std::binary_search(closure.missing.begin(), closure.missing.end(), world);
    };
    for (const WorldId origin : closure.worlds)
      for (const WorldId to : part_hearers_) {
        if (origin == settings_.me || origin == to || !shares(to) || !passed_on_.insert({origin, to}).second) continue;
        if (Link* link = link_to(to)) {
          link->add(*mixed_.find(origin));
          ++stats_.parts_sent;
        }
      }
  }

  void solve_whole(BodySet island) {
    if (island.bodies.empty()) return;  // two foreign wide bodies that touch here: others solve it
    stepper_.find_islands(island.bodies, island.contacts, mixed_ends_, mixed_islands_);
    mixed_all_.resize(mixed_islands_.size());
    for (std::uint32_t k = 0; k < mixed_all_.size(); ++k) mixed_all_[k] = k;
    stepper_.solve(island.bodies, island.contacts, mixed_ends_, mixed_islands_, mixed_all_);
    bool ours = false, others = false;
    auto known = known_.bodies.begin();
    std::vector<BodyId> own_ids;
    for (const BodyState& body : island.bodies) {
      known = std::lower_bound(known, known_.bodies.end(), body.id,
                               [](const BodyState& b, BodyId id) { return b.id < id; });
      const bool own = known != known_.bodies.end() && known->id == body.id &&
                       own_[static_cast<std::size_t>(known - known_.bodies.begin())];
      (own ? ours : others) = true;
      if (!own) continue;
      *known = body;
      own_ids.push_back(body.id);
    }
    stats_.mixed_islands += ours && others;
    for (const ContactRecord& record : island.contacts) {
      if (!std::binary_search(own_ids.begin(), own_ids.end(), record.a)) continue;
      const auto end = known_.contacts.begin() + static_cast<std::ptrdiff_t>(own_contacts_);
      const auto at = std::lower_bound(known_.contacts.begin(), end, record, record_before);
      if (at != end && !record_before(record, *at))
        *at = record;
      else
        unknown_contacts_.push_back(record);  // of an own wide body with one that is not near here
    }
  }

  // All islands of the step are solved: the own bodies' results are the next state.
  void complete() {
    BodySet next;
    if (!spare_.empty()) next = std::move(spare_.back()), spare_.pop_back();
    next.clear();
    next.bodies.swap(known_.bodies);
    next.contacts.swap(known_.contacts);
    if (!links_.empty()) {
      next.contacts.resize(own_contacts_);
      keep(next.bodies, [&](std::size_t i) { return own_[i] != 0; });
      if (!unknown_contacts_.empty()) {
        next.contacts.insert(next.contacts.end(), unknown_contacts_.begin(), unknown_contacts_.end());
        std::sort(next.contacts.begin(), next.contacts.end(), record_before);
      }
    }
    ++clock_;
    ++stats_.steps;
    mixed_.clear();
    std::erase_if(later_parts_, [&](Part& part) {
      if (part.step == clock_) mixed_.add(std::move(part));
      return part.step <= clock_;
    });
    stats_.clamped = stepper_.counters.clamped;
    stats_.non_finite = stepper_.counters.non_finite;
    take_state(std::move(next));
  }

  // `produced` is the state at the clock: keeps it until it is final, and tells the neighbours what concerns them.
  void take_state(BodySet produced) {
    const std::uint64_t hash = bodies_hash(produced.bodies);
    states_.push_back({std::move(produced), hash});
    const BodySet& state = states_.back().set;
    observer_.computed(clock_, state);
    if (links_.empty()) {
      own_bodies_ = state.bodies.size();
      return;
    }
    tell(state);
  }

  // Of a body that stays here others need the records with bodies that may be theirs, and of two wide bodies, which
  // whom they reach looks at too; those with its own kind and with the ground matter here alone.
  bool concerns_others(const BodySet& produced, const ContactRecord& record, bool wide) const {
    if (record.with_static()) return false;
    const auto at = std::lower_bound(produced.bodies.begin(), produced.bodies.end(), record.b,
                                     [](const BodyState& b, BodyId id) { return b.id < id; });
    if (at == produced.bodies.end() || at->id != record.b) return true;
    const Neighbourhood::Place& partner = places_[static_cast<std::size_t>(at - produced.bodies.begin())];
    return partner.owner != settings_.me || (wide && partner.wide);
  }

  void tell(const BodySet& state) {
    std::vector<BodySet> sets(links_.size());
    places_.resize(state.bodies.size());
    for (std::size_t i = 0; i < state.bodies.size(); ++i) places_[i] = neighbourhood_.place(state.bodies[i]);
    for (std::size_t i = 0; i < state.bodies.size(); ++i) {
      const BodyState& body = state.bodies[i];
      if (places_[i].inside && places_[i].owner == settings_.me) continue;
      neighbourhood_.hearers(body, hearers_);
      if (hearers_.empty()) continue;
      const auto records = std::equal_range(state.contacts.begin(), state.contacts.end(), ContactRecord{.a = body.id},
                                            [](const ContactRecord& l, const ContactRecord& r) { return l.a < r.a; });
      if (places_[i].owner != settings_.me) ++stats_.departed;
      for (std::size_t l = 0; l < links_.size(); ++l) {
        if (!std::binary_search(hearers_.begin(), hearers_.end(), links_[l].peer())) continue;
        sets[l].bodies.push_back(body);
        std::copy_if(records.first, records.second, std::back_inserter(sets[l].contacts), [&](const ContactRecord& c) {
          return places_[i].owner != settings_.me || concerns_others(state, c, places_[i].wide);
        });
      }
    }
    for (std::size_t l = 0; l < links_.size(); ++l) {
      if (!told_[l].must_tell(sets[l])) continue;
      ++stats_.frames_sent;
      stats_.frame_bodies_sent += sets[l].bodies.size();
      links_[l].add(Frame{clock_, {settings_.epoch, 0}, std::move(sets[l])});
    }
  }

  // ---- finality
  // ------------------------------------------------------------------------------------------------------ State 0 is
  // the scene. State t + 1 is final when it is computed, t is final, and so it is with every neighbour: then all that
  // the step was computed from was final.
  void finalise() {
    while (final_ < clock_ && (final_ < 0 || std::all_of(links_.begin(), links_.end(), [&](const Link& link) {
                                 return link.final_step() >= final_;
                               }))) {
      ++final_;
      const auto index = static_cast<std::size_t>(final_ - (clock_ + 1 - static_cast<Step>(states_.size())));
      observer_.finalised(final_, states_[index].set, states_[index].hash);
      // The newest final state stays: it may be what the next step starts from.
      for (std::size_t i = 0; i < index; ++i) {
        spare_.push_back(std::move(states_.front().set));
        states_.pop_front();
      }
    }
  }

  bool all_final() const {
    return final_ == settings_.last_step && std::all_of(links_.begin(), links_.end(), [&](const Link& link) {
             return link.final_step() >= settings_.last_step;
           });
  }

  const physics::Model& model_;
  const TerritoryMap& map_;
  const CoreSettings settings_;
  Observer& observer_;
  Neighbourhood neighbourhood_;
  physics::Stepper stepper_;
  MixedIslands mixed_;
  std::vector<Link> links_;
  std::vector<HeardBodies> heard_;  // these two by position in links_
  std::vector<ToldBodies> told_;
  Stage stage_ = Stage::kGather;
  bool waiting_ = false;
  bool new_parts_ = false;  // since islands were last tried

  struct State {
    BodySet set;
    std::uint64_t hash;
  };
  std::deque<State> states_;    // produced here, final_ .. clock_
  std::vector<BodySet> spare_;  // memory to be used again
  std::vector<Part> later_parts_;

  // The step at hand.
  BodySet heard_now_;  // from others
  BodySet known_;      // together with what was produced here; contacts as found at the clock; advanced in place
  std::size_t own_contacts_ = 0;              // the first so many of known_.contacts belong to own bodies
  std::vector<Neighbourhood::Place> places_;  // of the bodies of states_.back()
  std::vector<std::uint8_t> own_, roles_;
  std::vector<physics::Ends> ends_, mixed_ends_;
  physics::Islands islands_, mixed_islands_;
  std::vector<std::uint32_t> local_, mixed_all_;
  std::vector<std::uint32_t> open_;  // own components whose islands are not solved yet
  std::vector<WorldId> part_hearers_, hearers_;
  std::set<std::pair<WorldId, WorldId>> passed_on_;
  std::vector<ContactRecord> unknown_contacts_;
};

WorldCore::WorldCore(const physics::Model& model, const TerritoryMap& map, const CoreSettings& settings,
                     Observer& observer)
    : impl_(std::make_unique<Impl>(model, map, settings, observer)) {}
WorldCore::~WorldCore() = default;
bool WorldCore::receive(std::span<const std::byte> message) { return impl_->receive(message); }
const std::string& WorldCore::last_refusal() const { return impl_->refusal_; }
void WorldCore::reconnect(WorldId neighbour) { impl_->reconnect(neighbour); }
void WorldCore::set_limit(Step newest) { impl_->limit_ = newest; }
Progress WorldCore::work() { return impl_->work(); }
std::vector<Outgoing> WorldCore::take_outgoing() { return impl_->take_outgoing(); }
Step WorldCore::clock() const { return impl_->clock_; }
Step WorldCore::final_step() const { return impl_->final_; }
const std::vector<WorldId>& WorldCore::neighbours() const { return impl_->neighbourhood_.neighbours(); }
std::vector<WorldId> WorldCore::waiting_for() const { return impl_->waiting_for(); }
std::size_t WorldCore::own_bodies() const { return impl_->own_bodies_; }
std::size_t WorldCore::own_cells() const { return impl_->neighbourhood_.own_cells(); }
const CoreStats& WorldCore::stats() const { return impl_->stats_; }

}  // namespace soda::border
