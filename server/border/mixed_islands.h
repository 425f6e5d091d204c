// Islands with bodies of several worlds at one step: gathers the worlds' parts until an island is whole.
//
// The graph has the components of all parts as nodes. A component leads to the component that holds a body which it has
// as a port; a wide body leads to every component that has it as a port, so every world that it reaches must have told
// its part, if only to say that nothing touches it there. An island is closed when nothing that is led to is missing,
// lacks a body, or holds another record of it.
//
// A part may have come without the components that do not concern this world (Part::whole): those that an island leads
// to nevertheless are still to come, from whoever passes them on. What leads to nothing would not be missed, so where
// there is a wide body whole parts are needed.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "server/border/message.h"
#include "server/border/neighbourhood.h"

namespace soda::border {

// Two worlds told things that cannot both be true: a bug, never the network's fault.
struct ProtocolError : std::logic_error {
  using std::logic_error::logic_error;
};

class MixedIslands {
 public:
  MixedIslands(const Neighbourhood& neighbourhood, Step step) : neighbourhood_(&neighbourhood), step_(step) {}

  struct Key {
    WorldId origin = 0;
    std::uint32_t component = 0;
    auto operator<=>(const Key&) const = default;
  };
  struct Closure {
    std::vector<Key> components;   // reached so far, ascending
    std::vector<WorldId> worlds;   // whose parts were used, ascending
    std::vector<WorldId> missing;  // whose parts are lacking, or do not fit (yet); empty: closed
    std::uint64_t content = 0;     // hash of all components
    std::string misfit;            // what does not fit, if anything
  };

  // Takes a part, in place of an older one of that origin, or together with what there is of the same revision; false
  // where nothing is new.
  bool put(Part part);
  const Part* find(WorldId origin) const;
  template <typename F>
  void for_each(F&& f) const {
    for (const auto& [origin, indexed] : parts_) f(indexed.part);
  }

  // Everything that component leads to, as far as the parts at hand go.
  Closure close(Key from) const;

  // By its part at hand, whether that world touches a body of `other`, and so tells it its part itself.
  bool touches(WorldId world, WorldId other) const;
  // Whether one of its components in `island` touches bodies of both.
  bool touches_both(const Closure& island, WorldId world, WorldId one, WorldId other) const;
  // The same of one component: whether it touches a body of `other`; and whether `between` has a component in `island`
  // that it touches, and which touches a body of `other`.
  bool touches(Key component, WorldId other) const;
  bool leads_over(const Closure& island, Key component, WorldId between, WorldId other) const;

  // Bodies and contacts of all components of a closed island; nothing where two worlds' do not fit together, which
  // `misfit` then tells.
  std::optional<BodySet> assemble(const Closure& closure, std::string& misfit) const;

 private:
  struct Indexed {
    void add(std::shared_ptr<const Component> component);
    void sort();
    std::optional<std::uint32_t> component_of(BodyId body) const;
    Part part;
    using InComponent = std::pair<BodyId, std::uint32_t>;
    std::vector<std::uint64_t> hashes;          // by component
    std::vector<InComponent> holder;            // which component has a body; ascending
    std::vector<InComponent> port_users;        // which components have a body as a port; ascending
    std::vector<std::vector<WorldId>> touched;  // by component: whose bodies are its ports
    std::vector<WorldId> touched_by_any;        // ascending
  };
  const Neighbourhood* neighbourhood_;
  Step step_;
  std::map<WorldId, Indexed> parts_;
};

// Of a component's whole content.
std::uint64_t component_hash(const Component& component);

}  // namespace soda::border
