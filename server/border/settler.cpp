#include "server/border/settler.h"

#include <algorithm>
#include <numeric>

#include "common/state_hash.h"

namespace soda::border {

using State = KeptIsland::State;

// ---- what the timeline finds

void Settler::extended(Step step) {
  Exchange next(context_.neighbourhood, step, context_.links.size());
  if (!exchanges_.empty())
    for (const KeptIsland& island : exchanges_.back().kept)
      if (island.shared) {
        next.kept.push_back(island);
        next.kept.back().state = State::kUnconfirmed;
        next.kept.back().content = 0;
      }
  next.retry = !next.kept.empty();
  exchanges_.push_back(std::move(next));
  auto parts = std::exchange(later_parts_, {});
  for (auto& [direct, part] : parts) {
    if (part.step != step) {
      later_parts_.emplace_back(direct, std::move(part));
      continue;
    }
    if (direct) at(step).direct.insert(part.origin);
    at(step).parts.put(std::move(part));
  }
  std::erase_if(later_finals_, [&](const FinalPart& part) {
    if (part.step == step) at(step).note_final(part);
    return part.step <= step;
  });
}

bool Settler::finding(Step step, bool all) {
  Exchange& exchange = at(step);
  if (all) exchange.kept.clear();
  // An island that changes here may have been part of a larger one with others that are kept.
  exchange.part_due = exchange.part_stale = exchange.retry = true;
  exchange.reached_when_found = context_.reached_by(step);
  find_threats(step);
  return !threats_.empty();
}

void Settler::dropped(Step step, const timeline::Island& island) {
  std::erase_if(at(step).kept, [&](const KeptIsland& k) { return k.island.get() == &island; });
}

void Settler::keep(Step step, timeline::Found found) {
  Component component;
  component.set = std::move(found.own);
  for (const timeline::Record* const foreign : found.foreign)
    component.ports.push_back({foreign->body.id, foreign->place.owner, record_hash(foreign->body)});
  KeptIsland kept;
  kept.island = std::move(found.island);
  kept.shared = !component.ports.empty() || found.wide;
  kept.component = std::make_shared<const Component>(std::move(component));
  kept.boxes = std::move(found.boxes);
  // Others' wide bodies that touch here are theirs to solve: they only have to be told.
  kept.state = kept.component->set.bodies.empty() ? State::kUnconfirmed : State::kOpen;
  at(step).kept.push_back(std::move(kept));
  at(step).retry = true;
}

void Settler::find_threats(Step step) {
  threats_.clear();
  if (context_.settings.sync == Sync::kConservative) return;
  const double dt = context_.model.scene().dt, margin = context_.neighbourhood.half_cell();
  const timeline::Timeline& timeline = context_.timeline;
  for (std::size_t l = 0; l < context_.links.size(); ++l) {
    const Step seen = std::max(context_.links[l].upto(), timeline.oldest());
    if (seen >= step || context_.links[l].reached(step)) continue;
    const auto add = [&](const timeline::Record& record) {
      if (!record.body.asleep())
        threats_.add(physics::reach_box(record.body, context_.model), record.body.v(),
                     static_cast<double>(step - seen) * dt, margin);
    };
    for (const timeline::NearSet::Body& b : timeline.heard(l, seen)->bodies) add(*b.record);
    // What was handed over there is not among what is heard of.
    timeline.for_each_departed(seen, [&](const timeline::Record& record) {
      if (record.place.owner == context_.links[l].peer()) add(record);
    });
  }
  // A body that waits at one step waits at the following: where it was first seen says it all.
  threatening_.clear();
  for (Step seen = base_; seen < step; ++seen)
    for (const KeptIsland& island : at(seen).kept) {
      if (island.state != State::kOpen) continue;
      for (std::size_t i = 0; i < island.boxes.size(); ++i)
        if (threatening_.add(island.island->members[i]))
          threats_.add(island.boxes[i], island.component->set.bodies[i].v(), static_cast<double>(step - seen) * dt,
                       margin);
    }
}

bool Settler::is_time(Step step, std::size_t before) const {
  const std::size_t reached = context_.reached_by(step);
  return reached == context_.links.size() || step <= hurry_ || (reached > before && !context_.next_for_some(step));
}

bool Settler::is_worth_doing(Step step) {
  if (context_.all_have_reached(step)) return true;
  timeline::Timeline& timeline = context_.timeline;
  if (step < timeline.newest() && !is_time(step, at(step).reached_when_found)) return false;
  const std::span<const timeline::Slot> pending = timeline.pending(step);
  const auto known = deferred_.find(step);
  if (known != deferred_.end() && known->second == pending.size()) return false;
  find_threats(step);
  for (const timeline::Slot slot : pending) {
    const timeline::Record* const record = timeline.known(step, slot);
    if (!record) continue;
    if (timeline.own(*record)) {
      const Aabb box = physics::reach_box(record->body, context_.model);
      if (!must_wait({&box, 1})) return true;
    } else {
      for (const Link& link : context_.links)
        if (link.reached(step) && timeline.heard(link.index(), step)->find(slot)) return true;
    }
  }
  if (pending.empty()) return true;  // nothing moves: the step costs nothing
  deferred_[step] = pending.size();
  return false;
}

// ---- what others tell

void Settler::part_came(const Link& from, Part part) {
  const bool direct = part.origin == from.peer();
  if (part.step < base_) return;  // final here
  if (part.step >= base_ + static_cast<Step>(exchanges_.size())) {
    later_parts_.emplace_back(direct, std::move(part));
    return;
  }
  Exchange& exchange = at(part.step);
  if (direct) exchange.direct.insert(part.origin);
  if (exchange.parts.put(std::move(part))) exchange.retry = exchange.finals_due = true;
}

void Settler::final_part_came(const FinalPart& part) {
  if (part.step < base_) return;
  if (part.step >= base_ + static_cast<Step>(exchanges_.size()))
    later_finals_.push_back(part);
  else
    at(part.step).note_final(part);
}

void Settler::finals_due(Step first, Step last) {
  last = std::min(last, base_ + static_cast<Step>(exchanges_.size()) - 1);
  for (Step step = std::max(first, base_); step <= last; ++step) at(step).finals_due = true;
}

void Settler::retry_all() {
  bool open = false;
  for (Step step = base_; step < base_ + static_cast<Step>(exchanges_.size()); ++step) {
    Exchange& exchange = at(step);
    // Of what is shared nothing is told, or heard in full, before all have reached the step.
    const bool first_open = !open && exchange.open();
    open = open || first_open;
    if (context_.all_have_reached(step))
      exchange.retry = exchange.retry || std::exchange(exchange.postponed, false) || exchange.unsolved();
    else if (first_open)  // what waits later mostly waits for what waits here
      exchange.retry = exchange.retry || exchange.held();
  }
}

// ---- settling

BodySet Settler::solve(BodySet island) {
  physics::Stepper& stepper = context_.timeline.stepper();
  stepper.find_islands(island.bodies, island.contacts, ends_, islands_);
  all_.resize(islands_.size());
  std::iota(all_.begin(), all_.end(), 0u);
  stepper.solve(island.bodies, island.contacts, ends_, islands_, all_);
  return island;
}

bool Settler::try_settle(Step step, const std::function<void(const BodySet&)>& settle) {
  Exchange& exchange = at(step);
  if (!exchange.retry || !is_time(step, exchange.reached_when_tried)) return false;
  exchange.retry = false;
  exchange.reached_when_tried = context_.reached_by(step);
  const bool all_there = context_.all_have_reached(step);
  exchange.postponed = !all_there;
  if (all_there) exchange.refresh_part(context_.settings.me, context_.settings.epoch, step);
  bool threats_known = false, any = false;
  BodySet alone;
  for (KeptIsland& island : exchange.kept) {
    if (island.state == State::kOpen) {
      if (!std::exchange(threats_known, true)) find_threats(step);
      if (threats_.meet(island.boxes)) continue;
    }
    if (island.shared && !all_there) continue;
    if (island.shared) {
      any = try_shared(step, island, settle) || any;
    } else if (island.state == State::kOpen) {
      const BodySet& set = island.component->set;
      alone.bodies.insert(alone.bodies.end(), set.bodies.begin(), set.bodies.end());
      alone.contacts.insert(alone.contacts.end(), set.contacts.begin(), set.contacts.end());
      island.state = State::kSolved;
      any = true;
    }
  }
  if (!alone.bodies.empty()) {
    std::sort(alone.bodies.begin(), alone.bodies.end(),
              [](const BodyState& l, const BodyState& r) { return l.id < r.id; });
    std::sort(alone.contacts.begin(), alone.contacts.end(), record_before);
    settle(solve(std::move(alone)));
  }
  return any;
}

bool Settler::try_shared(Step step, KeptIsland& island, const std::function<void(const BodySet&)>& settle) {
  Exchange& exchange = at(step);
  MixedIslands::Closure closure = exchange.parts.close({context_.settings.me, island.index});
  pass_on(step, closure);
  std::optional<BodySet> whole;
  if (closure.missing.empty()) {
    if (island.state == State::kSolved && island.content == closure.content) return false;
    // A part may come before its world's bodies (passed on by others), or be that of a world which has fallen back.
    const bool all_there = std::all_of(closure.worlds.begin(), closure.worlds.end(), [&](WorldId w) {
      const Link* const link = context_.link_to(w);
      return !link || link->reached(step);
    });
    if (all_there) whole = exchange.parts.assemble(closure, closure.misfit);
  }
  if (!closure.misfit.empty() && context_.near_final(step) &&
      std::all_of(closure.worlds.begin(), closure.worlds.end(), [&](WorldId w) { return part_is_final(step, w); }))
    throw ProtocolError("step " + std::to_string(step) + ": " + closure.misfit);
  if (!whole) {
    if (island.state == State::kSolved) island.state = State::kOpen;
    return false;
  }
  std::vector<BodyId> own;
  for (KeptIsland& other : exchange.kept) {
    if (!other.shared || !std::binary_search(closure.components.begin(), closure.components.end(),
                                             MixedIslands::Key{context_.settings.me, other.index}))
      continue;
    other.state = State::kSolved;
    other.content = closure.content;
    other.worlds = closure.worlds;
    for (const BodyState& body : other.component->set.bodies) own.push_back(body.id);
  }
  if (own.empty()) return true;  // two foreign wide bodies that touch here: others solve it
  std::sort(own.begin(), own.end());
  const BodySet solved = solve(std::move(*whole));
  BodySet results;
  const auto is_own = [&](BodyId id) { return std::binary_search(own.begin(), own.end(), id); };
  for (const BodyState& body : solved.bodies)
    if (is_own(body.id)) results.bodies.push_back(body);
  for (const ContactRecord& record : solved.contacts)
    if (is_own(record.a)) results.contacts.push_back(record);
  settle(results);
  return true;
}

// ---- what is told

// What is used here of other worlds, and of this one without touching them, goes on to those that share the island, so
// that all its parts reach all its worlds.
void Settler::pass_on(Step step, const MixedIslands::Closure& closure) {
  if (closure.worlds.size() + closure.missing.size() <= 2) return;
  Exchange& exchange = at(step);
  const auto shares = [&](WorldId world) {
    return std::binary_search(closure.worlds.begin(), closure.worlds.end(), world) ||
           std::binary_search(closure.missing.begin(), closure.missing.end(), world);
  };
  const WorldId me = context_.settings.me;
  relays_.clear();
  for (const WorldId world : closure.worlds)
    if (world < me && exchange.parts.touches(me, world) && exchange.parts.touches(world, me)) relays_.push_back(world);
  for (const WorldId to : hearers(step).worlds) {
    Link* const link = context_.link_to(to);
    if (!link || !shares(to)) continue;
    for (const WorldId origin : closure.worlds) {
      if (origin == to) continue;
      const Part& part = *exchange.parts.find(origin);
      const auto known = exchange.passed.find({to, origin});
      const bool begun = known != exchange.passed.end() && known->second.revision == part.revision;
      if (begun && known->second.whole) continue;
      if (origin == me) {
        // Nothing of what is only assumed; and whoever gets some of it must also be told what becomes of it.
        const std::optional<Exchange::Told>& told = exchange.told[link->index()];
        if (!told || told->revision != part.revision.count) {
          exchange.own_due = true;
          continue;
        }
        if (told->whole) continue;
      }
      Part rest = left_to_pass(step, closure, origin, to, begun ? &known->second : nullptr);
      if (!rest.whole && rest.components.empty()) {
        context_.stats.parts_left += origin != me && !begun;
        continue;
      }
      Exchange::Passed& passed = exchange.passed[{to, origin}];
      if (!begun) passed = {part.revision, false, {}, false};
      passed.whole = rest.whole;
      passed.final = origin == me;  // which is told otherwise
      if (!rest.whole)
        for (const auto& component : rest.components) passed.components.push_back(component->set.bodies.front().id);
      exchange.finals_due = true;
      link->add(std::move(rest));
      ++context_.stats.parts_sent;
      context_.stats.parts_passed += origin != me;
    }
  }
}

// What of a part, or whether a whole one, `to` does not get without this world: of its origin, or of one with a lower
// number that touches bodies of both with one component, and so passes it on as soon as it has it. Only of who touches
// bodies of this world, and tells it its part itself, is that certain: what others pass on of a part may be old. So,
// where those between touch each other, each component comes once to each world that is two components away, and a
// chain of them passes each on along itself.
Part Settler::left_to_pass(Step step, const MixedIslands::Closure& closure, WorldId origin, WorldId to,
                           const Exchange::Passed* passed) const {
  const MixedIslands& parts = at(step).parts;
  const Part& part = *parts.find(origin);
  Part rest{origin, step, part.revision, false, {}};
  const auto some_relay = [&](const auto& passes_on) {
    return std::any_of(relays_.begin(), relays_.end(),
                       [&](WorldId between) { return between != origin && between != to && passes_on(between); });
  };
  if (part.whole && origin != context_.settings.me) {
    const bool otherwise = parts.touches(origin, to) || some_relay([&](WorldId between) {
                             return parts.touches(origin, between) && parts.touches_both(closure, between, origin, to);
                           });
    return otherwise ? rest : part;
  }
  using Key = MixedIslands::Key;
  for (auto key = std::lower_bound(closure.components.begin(), closure.components.end(), Key{origin, 0});
       key != closure.components.end() && key->origin == origin; ++key) {
    const auto& component = part.components[key->component];
    if (component->set.bodies.empty()) continue;  // of wide bodies alone: this world's part will be told whole
    const BodyId first = component->set.bodies.front().id;
    if (passed && std::find(passed->components.begin(), passed->components.end(), first) != passed->components.end())
      continue;
    if (parts.touches(*key, to) ||
        some_relay([&](WorldId between) { return parts.leads_over(closure, *key, between, to); }))
      continue;
    rest.components.push_back(component);
  }
  return rest;
}

Settler::Hearers Settler::hearers(Step step) const {
  Hearers to;
  std::set<WorldId>& worlds = to.worlds;
  std::vector<WorldId> reached;
  for (const KeptIsland& island : at(step).kept) {
    if (!island.shared) continue;
    for (const Port& port : island.component->ports) worlds.insert(port.owner);
    for (const BodyState& body : island.component->set.bodies) {
      if (!context_.neighbourhood.is_wide(body)) continue;
      to.whole = true;
      context_.neighbourhood.reached(body, step, reached);  // whoever it reaches must say what touches it there
      worlds.insert(reached.begin(), reached.end());
    }
  }
  context_.timeline.for_each_foreign_wide(step, [&](timeline::Slot, const timeline::Record& record) {
    to.whole = true;
    context_.neighbourhood.reached(record.body, step, reached);
    if (std::binary_search(reached.begin(), reached.end(), context_.settings.me)) worlds.insert(record.place.owner);
  });
  worlds.erase(context_.settings.me);
  return to;
}

void Settler::tell(Step step) {
  Exchange& exchange = at(step);
  if (std::exchange(exchange.part_due, false)) {
    exchange.refresh_part(context_.settings.me, context_.settings.epoch, step);
    const Hearers to = hearers(step);
    for (const WorldId world : to.worlds)
      if (!context_.link_to(world))
        throw ProtocolError("step " + std::to_string(step) + ": an island reaches world " + std::to_string(world) +
                            ", which is no neighbour");
    const Part& mine = *exchange.parts.find(context_.settings.me);
    for (std::size_t l = 0; l < context_.links.size(); ++l) {
      Link& link = context_.links[l];
      std::optional<Exchange::Told>& told = exchange.told[l];
      if (told ? told->revision == exchange.revisions && (told->whole || !to.whole) : !to.worlds.contains(link.peer()))
        continue;
      told = Exchange::Told{exchange.revisions, to.whole};
      Part part = mine;
      part.whole = to.whole;
      if (!part.whole)
        std::erase_if(part.components, [&](const auto& component) {
          return std::none_of(component->ports.begin(), component->ports.end(),
                              [&](const Port& port) { return port.owner == link.peer(); });
        });
      link.add(std::move(part));
      ++context_.stats.parts_sent;
    }
  }
  if (std::exchange(exchange.own_due, false))
    for (const KeptIsland& island : exchange.kept)
      if (island.shared) pass_on(step, exchange.parts.close({context_.settings.me, island.index}));
  if (!std::exchange(exchange.finals_due, false)) return;
  for (auto& [key, passed] : exchange.passed) {
    if (passed.final || exchange.parts.find(key.second)->revision != passed.revision ||
        !part_is_final(step, key.second))
      continue;
    passed.final = true;
    context_.link_to(key.first)->add(FinalPart{key.second, step, passed.revision});
  }
}

bool Settler::part_is_final(Step step, WorldId origin) const {
  if (origin == context_.settings.me) return true;
  const Exchange& exchange = at(step);
  const Part* const part = exchange.parts.find(origin);
  if (!part) return false;
  // Once final it stays so, whoever said it first: what rests on it may have become final in between.
  const auto told = exchange.finals.find(origin);
  if (told != exchange.finals.end() && told->second == part->revision) return true;
  if (!exchange.direct.contains(origin)) return false;
  const Link* const link = context_.link_to(origin);
  return link && link->near_final() >= step;
}

bool Settler::all_final(Step step) const {
  const Exchange& exchange = at(step);
  return !exchange.retry && !exchange.postponed &&
         std::all_of(exchange.kept.begin(), exchange.kept.end(), [&](const KeptIsland& island) {
           return island.state == State::kSolved && std::all_of(island.worlds.begin(), island.worlds.end(),
                                                                [&](WorldId w) { return part_is_final(step, w); });
         });
}

std::string Settler::why_not_final(Step step) const {
  const Exchange& exchange = at(step);
  const bool part_made = !exchange.part_stale && exchange.parts.find(context_.settings.me);
  std::string text = exchange.retry ? "islands to be tried; " : "";
  if (!part_made) text += "this world's part is not made yet; ";
  for (const KeptIsland& island : exchange.kept) {
    const MixedIslands::Closure closure = island.shared && part_made
                                              ? exchange.parts.close({context_.settings.me, island.index})
                                              : MixedIslands::Closure{};
    text += "island of";
    for (const timeline::Slot slot : island.island->own()) text += " " + std::to_string(context_.timeline.id_of(slot));
    text += " with";
    for (const timeline::Slot slot : island.island->foreign())
      text += " " + std::to_string(context_.timeline.id_of(slot));
    text += island.state == State::kSolved ? ": solved" : island.state == State::kOpen ? ": open" : ": unconfirmed";
    for (const WorldId world : closure.missing) text += ", lacks " + std::to_string(world);
    if (!closure.misfit.empty()) text += " (" + closure.misfit + ")";
    for (const WorldId world : closure.worlds)
      if (!part_is_final(step, world)) text += ", not final: part of " + std::to_string(world);
    text += "; ";
  }
  return text;
}

void Settler::count(Step step) {
  std::set<std::uint64_t> mixed;
  for (const KeptIsland& island : at(step).kept)
    if (island.worlds.size() > 1 && !island.component->set.bodies.empty()) mixed.insert(island.content);
  context_.stats.mixed_islands += mixed.size();
  const auto& told = at(step).told;
  context_.stats.syncs += std::any_of(told.begin(), told.end(), [](const auto& t) { return t.has_value(); });
}

void Settler::release_before(Step step) {
  while (base_ < step) {
    exchanges_.pop_front();
    ++base_;
  }
}

}  // namespace soda::border
