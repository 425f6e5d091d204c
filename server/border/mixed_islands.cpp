#include "server/border/mixed_islands.h"

#include <algorithm>
#include <cstring>
#include <set>
#include <string>

#include "common/state_hash.h"

namespace soda::border {
namespace {

bool contains(const std::vector<WorldId>& worlds, WorldId world) {
  return std::find(worlds.begin(), worlds.end(), world) != worlds.end();
}

}  // namespace

std::uint64_t component_hash(const Component& component) {
  std::uint64_t hash = full_hash(component.set);
  for (const Port& port : component.ports)
    for (const std::uint64_t word : {port.body, std::uint64_t{port.owner}, port.record})
      hash = (hash ^ word) * 0x9e3779b97f4a7c15u + (hash >> 31);
  return hash;
}

void MixedIslands::Indexed::add(std::shared_ptr<const Component> component) {
  const auto i = static_cast<std::uint32_t>(part.components.size());
  hashes.push_back(component_hash(*component));
  for (const BodyState& body : component->set.bodies) holder.emplace_back(body.id, i);
  std::vector<WorldId>& of = touched.emplace_back();
  for (const Port& port : component->ports) {
    port_users.emplace_back(port.body, i);
    if (!contains(of, port.owner)) of.push_back(port.owner);
  }
  touched_by_any.insert(touched_by_any.end(), of.begin(), of.end());
  part.components.push_back(std::move(component));
}

void MixedIslands::Indexed::sort() {
  std::sort(holder.begin(), holder.end());
  std::sort(port_users.begin(), port_users.end());
  std::sort(touched_by_any.begin(), touched_by_any.end());
  touched_by_any.erase(std::unique(touched_by_any.begin(), touched_by_any.end()), touched_by_any.end());
}

std::optional<std::uint32_t> MixedIslands::Indexed::component_of(BodyId body) const {
  const auto at = std::lower_bound(holder.begin(), holder.end(), std::pair(body, 0u));
  if (at == holder.end() || at->first != body) return std::nullopt;
  return at->second;
}

bool MixedIslands::put(Part part) {
  const auto old = parts_.find(part.origin);
  const Part* const known = old == parts_.end() ? nullptr : &old->second.part;
  if (known && (part.revision < known->revision || (part.revision == known->revision && known->whole))) return false;
  const bool more = known && part.revision == known->revision && !part.whole;  // of what is there
  Indexed fresh;
  Indexed& into = more ? old->second : fresh;
  auto components = std::exchange(part.components, {});
  if (more) {
    std::erase_if(components, [&](const auto& c) { return into.component_of(c->set.bodies.front().id).has_value(); });
    if (components.empty()) return false;
  } else {
    into.part = std::move(part);
  }
  for (auto& component : components) into.add(std::move(component));
  into.sort();
  if (!more) parts_.insert_or_assign(fresh.part.origin, std::move(fresh));
  return true;
}

const Part* MixedIslands::find(WorldId origin) const {
  const auto it = parts_.find(origin);
  return it == parts_.end() ? nullptr : &it->second.part;
}

MixedIslands::Closure MixedIslands::close(Key from) const {
  std::set<Key> seen{from};
  std::set<WorldId> used{from.origin}, missing;
  std::vector<Key> todo{from};
  Closure closure;
  const auto misfit = [&](WorldId world, std::string why) {
    missing.insert(world);
    if (closure.misfit.empty()) closure.misfit = std::move(why);
  };
  const auto visit = [&](Key key) {
    if (seen.insert(key).second) todo.push_back(key);
  };
  const auto part_of = [&](WorldId world) -> const Indexed* {
    const auto it = parts_.find(world);
    if (it == parts_.end()) {
      missing.insert(world);
      return nullptr;
    }
    used.insert(world);
    return &it->second;
  };
  std::vector<WorldId> reached;
  while (!todo.empty()) {
    const Key key = todo.back();
    todo.pop_back();
    const Indexed& origin = parts_.at(key.origin);
    const Component& component = *origin.part.components[key.component];
    closure.content += origin.hashes[key.component];
    for (const Port& port : component.ports) {
      const Indexed* part = part_of(port.owner);
      if (!part) continue;
      const std::optional<std::uint32_t> holder = part->component_of(port.body);
      if (!holder) {
        if (!part->part.whole) {  // yet to be passed on
          missing.insert(port.owner);
          continue;
        }
        misfit(port.owner, "world " + std::to_string(key.origin) + " touches body " + std::to_string(port.body) +
                               ", but its owner " + std::to_string(port.owner) + " does not say so");
        continue;
      }
      const auto& bodies = part->part.components[*holder]->set.bodies;
      const auto body = std::lower_bound(bodies.begin(), bodies.end(), port.body,
                                         [](const BodyState& b, BodyId id) { return b.id < id; });
      if (record_hash(*body) != port.record) {
        misfit(port.owner, "worlds " + std::to_string(key.origin) + " and " + std::to_string(port.owner) +
                               " hold different states of body " + std::to_string(port.body));
        continue;
      }
      visit({port.owner, *holder});
    }
    for (const BodyState& body : component.set.bodies) {
      if (!neighbourhood_->is_wide(body)) continue;
      neighbourhood_->reached(body, step_, reached);
      for (const WorldId world : reached)
        if (const Indexed* part = part_of(world)) {
          if (!part->part.whole) missing.insert(world);
          const auto& users = part->port_users;
          for (auto it = std::lower_bound(users.begin(), users.end(), std::pair(body.id, 0u));
               it != users.end() && it->first == body.id; ++it)
            visit({world, it->second});
        }
    }
  }
  closure.components.assign(seen.begin(), seen.end());
  closure.worlds.assign(used.begin(), used.end());
  closure.missing.assign(missing.begin(), missing.end());
  return closure;
}

bool MixedIslands::touches(WorldId world, WorldId other) const {
  const auto it = parts_.find(world);
  return it != parts_.end() &&
         std::binary_search(it->second.touched_by_any.begin(), it->second.touched_by_any.end(), other);
}

bool MixedIslands::touches_both(const Closure& island, WorldId world, WorldId one, WorldId other) const {
  const auto it = parts_.find(world);
  if (it == parts_.end()) return false;
  for (auto key = std::lower_bound(island.components.begin(), island.components.end(), Key{world, 0});
       key != island.components.end() && key->origin == world; ++key)
    if (const auto& touched = it->second.touched[key->component]; contains(touched, one) && contains(touched, other))
      return true;
  return false;
}

bool MixedIslands::touches(Key component, WorldId other) const {
  return contains(parts_.at(component.origin).touched[component.component], other);
}

bool MixedIslands::leads_over(const Closure& island, Key component, WorldId between, WorldId other) const {
  const auto it = parts_.find(between);
  if (it == parts_.end() || !touches(component, between)) return false;
  const Indexed& origin = parts_.at(component.origin);
  const auto touches_it = [&](const Port& port) { return origin.component_of(port.body) == component.component; };
  for (auto key = std::lower_bound(island.components.begin(), island.components.end(), Key{between, 0});
       key != island.components.end() && key->origin == between; ++key) {
    const std::vector<Port>& ports = it->second.part.components[key->component]->ports;
    if (touches(*key, other) && std::any_of(ports.begin(), ports.end(), touches_it)) return true;
  }
  return false;
}

std::optional<BodySet> MixedIslands::assemble(const Closure& closure, std::string& misfit) const {
  BodySet set;
  for (const Key& key : closure.components) {
    const BodySet& component = parts_.at(key.origin).part.components[key.component]->set;
    set.bodies.insert(set.bodies.end(), component.bodies.begin(), component.bodies.end());
    set.contacts.insert(set.contacts.end(), component.contacts.begin(), component.contacts.end());
  }
  std::sort(set.bodies.begin(), set.bodies.end(), [](const BodyState& l, const BodyState& r) { return l.id < r.id; });
  for (std::size_t i = 1; i < set.bodies.size(); ++i)
    if (set.bodies[i].id == set.bodies[i - 1].id) {
      misfit = "two worlds own body " + std::to_string(set.bodies[i].id);
      return std::nullopt;
    }
  // A contact across a border is found by both sides; they must have found the same.
  std::sort(set.contacts.begin(), set.contacts.end(), record_before);
  std::size_t kept = 0;
  for (const ContactRecord& record : set.contacts) {
    if (kept > 0 && !record_before(set.contacts[kept - 1], record)) {
      if (std::memcmp(&set.contacts[kept - 1], &record, sizeof record) != 0) {
        misfit = "two worlds found different contacts between bodies " + std::to_string(record.a) + " and " +
                 std::to_string(record.b & ~kStaticBit);
        return std::nullopt;
      }
      continue;
    }
    set.contacts[kept++] = record;
  }
  set.contacts.resize(kept);
  return set;
}

}  // namespace soda::border
