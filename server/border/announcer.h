// Tells the neighbours of the bodies that this world produced and that they own or have near.
#pragma once

#include <vector>

#include "server/border/context.h"
#include "server/border/frame_book.h"

namespace soda::border {

class Announcer {
 public:
  explicit Announcer(const Context& context) : context_(context), books_(context.links.size(), FrameBook(0)) {}

  // The timeline has a new entry, a copy of the one before.
  void extend(Step newest);
  // There is one more link, to whom nothing that is known so far matters.
  void add_link(Step newest);
  // Adds to the links' next messages what their neighbours do not hold of the steps up to `front`.
  void tell(Step front);
  // A step has become final.
  void count(Step step);
  void release_before(Step step);

 private:
  void update(Step step);
  std::uint64_t wanted(Step step, const timeline::Record& record) const;
  const Context& context_;
  std::vector<FrameBook> books_;  // by link
  Step oldest_ = 0;
  // Scratch of update().
  std::vector<timeline::Slot> changed_;
  std::vector<NearBodies> added_;  // by link
  std::vector<WorldId> hearers_;
};

}  // namespace soda::border
