// What a daemon tells those who watch the run: `soda run`, and world 0's session service. Two homes: DDS and, for the
// one world of a run without network, a pipe. All calls come from the daemon's thread and may block when a reader is
// slow: nothing is ever dropped but transforms.
#pragma once

#include <chrono>

#include "idl/soda.h"

namespace soda::world {

class Reports {
 public:
  virtual ~Reports() = default;
  // Whether whoever is to watch this world listens already. The world becomes ready only then, so that nothing is
  // missed.
  virtual bool listened_to() const = 0;
  virtual void status(const wire::Status& sample) = 0;
  virtual void digests(const wire::Digests& sample) = 0;
  virtual void state(const wire::StateChunk& sample) = 0;
  virtual void poses(const wire::Poses& sample) = 0;
  // Of which this world is the giver, each once.
  virtual void transfer(const wire::Transfer& sample) = 0;
  virtual bool wants_transforms() const = 0;
  // Whether somebody has begun to read transforms, or said that some are lacking, since the last call.
  virtual bool take_lack() = 0;
  virtual void transforms(const wire::Transforms& sample) = 0;
  // Blocks until everything has been acknowledged, or the time is up: false.
  virtual bool finish(std::chrono::milliseconds at_most) = 0;
};

}  // namespace soda::world
