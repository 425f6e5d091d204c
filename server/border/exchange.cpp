#include "server/border/exchange.h"

#include <algorithm>

namespace soda::border {
namespace {

BodyId first_body(const Component& c) { return c.set.bodies.empty() ? c.ports.front().body : c.set.bodies.front().id; }

}  // namespace

void Exchange::refresh_part(WorldId me, std::uint32_t epoch, Step step) {
  if (!std::exchange(part_stale, false)) return;
  std::vector<KeptIsland*> shared;
  for (KeptIsland& k : kept)
    if (k.shared) shared.push_back(&k);
  std::sort(shared.begin(), shared.end(), [](const KeptIsland* l, const KeptIsland* r) {
    return first_body(*l->component) < first_body(*r->component);
  });
  Part part{me, step, {}, true, {}};
  std::uint64_t content = shared.size();
  for (std::uint32_t i = 0; i < shared.size(); ++i) {
    shared[i]->index = i;
    part.components.push_back(shared[i]->component);
    content = content * 0x9e3779b97f4a7c15u + component_hash(*shared[i]->component);
  }
  if (revisions > 0 && content == part_content) return;
  part_content = content;
  part.revision = {epoch, ++revisions};
  parts.put(std::move(part));
}

void Exchange::note_final(const FinalPart& part) {
  Revision& newest = finals[part.origin];
  newest = std::max(newest, part.revision);
  finals_due = true;
}

bool Exchange::open() const {
  return std::any_of(kept.begin(), kept.end(), [](const KeptIsland& k) { return k.state == KeptIsland::State::kOpen; });
}

bool Exchange::held() const {
  return std::any_of(kept.begin(), kept.end(),
                     [](const KeptIsland& k) { return k.state == KeptIsland::State::kOpen && !k.shared; });
}

bool Exchange::unsolved() const {
  return std::any_of(kept.begin(), kept.end(),
                     [](const KeptIsland& k) { return k.state != KeptIsland::State::kSolved; });
}

}  // namespace soda::border
