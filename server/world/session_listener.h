// What a world hears of its session, from the host (world 0 itself) or as a guest (all others).
#pragma once

#include <functional>

#include "idl/soda.h"

namespace soda::world {

struct SessionListener {
  std::function<void(const wire::Control&)> control;
  std::function<void(const wire::LogEntry&)> entry;
};

}  // namespace soda::world
