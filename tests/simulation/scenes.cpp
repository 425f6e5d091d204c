#include "tests/simulation/scenes.h"

#include <stdexcept>

#include "common/scene/generators.h"
#include "common/scene/random.h"
#include "common/scene/scene_builder.h"

namespace soda::test {
namespace {

Scene piles() { return generate("piles", 162, 3); }
Scene heap() { return generate("heap", 420, 5); }
Scene cubes() { return generate("cubes", 150, 11); }
Scene city() { return generate("city", 240, 2); }
Scene machines() { return generate("machines", 120, 1); }
Scene cluster() { return generate("cluster", 108, 4); }

// Sleeping boxes in a row across many cells, touching; one end is struck when all are asleep. The wave of waking
// crosses every border at once, for an island wakes as a whole.
Scene sleeping_chain() {
  SceneBuilder builder("sleeping chain");
  builder.add_ground(200);
  for (int i = 0; i < 24; ++i) builder.add(Box{Vec3(0.9, 0.9, 0.9)}, Vec3(-11 + 0.9 * i, 0.3, 0.45));
  Body& ball = builder.add(Sphere{0.4}, Vec3(-24, 0.3, 0.4));
  ball.linear_velocity = Vec3(9, 0, 0);
  ball.linear_damping = 0;
  return builder.finish();
}

// Planks three cells long and a slab over nine cells on small boxes in as many territories, and a box that comes down
// on one end of a plank: those below the other end are known to the plank's owner only through others.
Scene wide_bodies() {
  SceneBuilder builder("wide bodies");
  builder.scene.territory_cell = 1.7;
  builder.add_ground(200);
  for (int x = -6; x <= 6; x += 2)
    for (int y = -6; y <= 6; y += 2) builder.add(Box{Vec3(0.5, 0.5, 0.5)}, Vec3(x, y, 0.25));
  for (int k = 0; k < 3; ++k)
    builder.add(Box{Vec3(6.2, 0.6, 0.15)}, Vec3(-3 + 0.5 * k, -6 + 4.0 * k, 0.6), Quat::Identity(), 300);
  builder.add(Box{Vec3(5.5, 5.5, 0.2)}, Vec3(3, 3, 1.2), Quat::Identity(), 300);
  builder.add(Box{Vec3(6.0, 0.6, 0.15)}, Vec3(2, 2.5, 1.6), Quat::Identity(), 300);  // on the slab: two wide bodies
  for (int k = 0; k < 4; ++k) builder.add(Box{Vec3(0.6, 0.6, 0.6)}, Vec3(-5.5 + 3.3 * k, -6 + 4.0 * (k % 3), 3.0 + k));
  return builder.finish();
}

// Bodies at 20 to 60 m/s through standing ones: reach boxes of many cells, and one cell and more travelled per few
// steps.
Scene fast_bodies() {
  SceneBuilder builder("fast bodies");
  builder.add_ground(300);
  Random random(17);
  for (int x = -8; x <= 8; x += 2)
    for (int y = -8; y <= 8; y += 4)
      for (int z = 0; z < 3; ++z) builder.add(Box{Vec3(0.7, 0.7, 0.7)}, Vec3(x, y, 0.35 + 0.7 * z));
  for (int i = 0; i < 24; ++i) {
    Body& body = builder.add(Sphere{0.3}, random.between(Vec3(-30 - i, -8, 0.4), Vec3(-30 - i, 8, 1.9)));
    body.linear_velocity = random.between(Vec3(20, -2, 1), Vec3(60, 2, 1));
  }
  return builder.finish();
}

// Everything in one place, at a corner of eight territories when there are that many: bodies cross corners.
Scene corner() {
  SceneBuilder builder("corner");
  builder.scene.gravity = Vec3::Zero();
  Random random(29);
  for (int i = 0; i < 60; ++i) {
    const Vec3 place = random.between(Vec3::Constant(-4), Vec3::Constant(4));
    Body& body = i % 2 ? builder.add(Sphere{0.35}, place) : builder.add(Box{Vec3(0.6, 0.6, 0.6)}, place);
    body.linear_velocity = -1.2 * place;
    body.restitution = 0.3;
  }
  return builder.finish();
}

}  // namespace

const std::vector<HardScene>& hard_scenes() {
  static const std::vector<HardScene> scenes = {
      {"piles", piles, 150, false},
      {"heap", heap, 150, true},
      {"cubes", cubes, 200, false},
      {"city", city, 150, true},
      {"cluster", cluster, 200, true},
      {"sleeping_chain", sleeping_chain, 200, true},
      {"wide_bodies", wide_bodies, 150, true},
      {"fast_bodies", fast_bodies, 150, false},
      {"corner", corner, 200, true},
      {"machines", machines, 200, true},
  };
  return scenes;
}

const HardScene& hard_scene(const std::string& name) {
  for (const HardScene& scene : hard_scenes())
    if (scene.name == name) return scene;
  throw std::invalid_argument("no hard scene " + name);
}

}  // namespace soda::test
