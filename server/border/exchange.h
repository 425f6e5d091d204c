// One step's islands that others have a share in, or that must wait, and the parts of all worlds about them.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "server/border/mixed_islands.h"
#include "server/timeline/timeline.h"

namespace soda::border {

struct KeptIsland {
  enum class State {
    kOpen,         // it waits: for parts, or for news of those who may touch it
    kUnconfirmed,  // nothing of it that is known here has changed since the step before, nor then its result; parts
                   // must confirm
    kSolved,
  };
  Ref<timeline::Island> island;
  std::shared_ptr<const Component> component;
  std::vector<Aabb> boxes;  // reach boxes of its own bodies
  bool shared = false;      // has foreign or wide bodies
  State state = State::kOpen;
  std::uint32_t index = 0;      // of its component in this world's part
  std::uint64_t content = 0;    // of the closure that it was solved with
  std::vector<WorldId> worlds;  // whose parts were used
};

struct Exchange {
  Exchange(const Neighbourhood& neighbourhood, Step step, std::size_t links)
      : parts(neighbourhood, step), told(links) {}

  std::vector<KeptIsland> kept;
  // Neighbours that had reached the step when its islands were last found, and tried.
  std::size_t reached_when_found = 0, reached_when_tried = 0;
  bool retry = false;      // something has come since islands were last tried
  bool postponed = false;  // so it has, but not all neighbours have reached the step, and shared islands were left out
  bool part_due = true;    // this world's part may not be what was told
  bool finals_due = true;  // parts that were passed on may have become final
  bool part_stale = true;  // this world's part in `parts` may not be that of `kept`

  MixedIslands parts;  // of all origins, this world included
  std::uint32_t revisions = 0;
  std::uint64_t part_content = 0;
  // What a link was told of this world's part: its revision (not its content: one that has become again what it was may
  // have been told to others in between, who pass on that one, and word that it is final), and whether all of it.
  struct Told {
    std::uint32_t revision = 0;
    bool whole = false;
  };
  std::vector<std::optional<Told>> told;  // by link
  bool own_due = false;                   // own components are to be passed on, once the part has been told
  struct Passed {
    Revision revision;
    bool whole = false;
    std::vector<BodyId> components;  // by their first bodies, where not whole
    bool final = false;
  };
  std::map<std::pair<WorldId, WorldId>, Passed> passed;  // (to, origin)
  std::set<WorldId> direct;                              // origins that told their parts themselves
  std::map<WorldId, Revision> finals;                    // told to be final by others

  // Makes this world's part out of the islands kept, if they have changed.
  void refresh_part(WorldId me, std::uint32_t epoch, Step step);
  // Of an origin's revisions the newest counts.
  void note_final(const FinalPart& part);
  bool open() const;      // whether results are lacking
  bool held() const;      // whether there are open islands that are not shared
  bool unsolved() const;  // whether results are lacking, or unconfirmed
};

}  // namespace soda::border
