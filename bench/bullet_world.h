// A scene in stock Bullet, as its users would run it: btDiscreteDynamicsWorld in double precision with its default
// broad phase, solver, iterations and settings; sleeping off. For comparison only.
#pragma once

#include <memory>
#include <vector>

#include "common/body_state.h"
#include "common/scene/scene.h"

namespace soda::bench {

class BulletWorld {
 public:
  // Throws std::invalid_argument for triangle meshes and height fields. The scene must outlive the world.
  explicit BulletWorld(const Scene& scene);
  ~BulletWorld();

  void step();                                      // by the scene's dt
  Vec3 position(std::size_t body) const;            // m, centre of mass; by position among the scene's dynamic bodies
  void read(std::vector<BodyState>& states) const;  // of all dynamic bodies, in the scene's order; replaces `states`

 private:
  struct World;
  std::unique_ptr<World> world_;
};

}  // namespace soda::bench
