#include "physics_scenes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <numeric>

#include "common/scene/generators.h"
#include "common/scene/mass_properties.h"
#include "common/scene/random.h"

namespace soda::physics::test {
namespace {

Shape shape(SceneBuilder& builder, const Geometry& geometry, const Vec3& at, const Quat& turn = Quat::Identity()) {
  return {builder.geometry(geometry), Pose{at, turn}};
}

ConvexHull random_hull(std::uint32_t points, double radius, std::uint64_t seed) {
  Random random(seed);
  ConvexHull hull;
  for (std::uint32_t i = 0; i < points; ++i) hull.points.push_back(radius * random.direction());
  return hull;
}

TriangleMesh bowl(double radius, double depth, std::uint32_t rings, std::uint32_t sectors) {
  TriangleMesh mesh;
  mesh.vertices.push_back(Vec3(0, 0, 0));
  for (std::uint32_t r = 1; r <= rings; ++r)
    for (std::uint32_t s = 0; s < sectors; ++s) {
      const double share = static_cast<double>(r) / rings, angle = 2 * 3.14159265358979323846 * s / sectors;
      double sine, cosine;
      sin_cos(angle, sine, cosine);
      mesh.vertices.push_back(Vec3(radius * share * cosine, radius * share * sine, depth * share * share));
    }
  const auto at = [&](std::uint32_t ring, std::uint32_t sector) { return 1 + (ring - 1) * sectors + sector % sectors; };
  for (std::uint32_t s = 0; s < sectors; ++s) {
    mesh.triangles.push_back({0, at(1, s), at(1, s + 1)});
    for (std::uint32_t r = 1; r < rings; ++r) {
      mesh.triangles.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
      mesh.triangles.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
    }
  }
  return mesh;
}

HeightField waves(std::uint32_t side, double spacing, double amplitude) {
  HeightField field;
  field.columns = field.rows = side;
  field.spacing_x = field.spacing_y = spacing;
  for (std::uint32_t j = 0; j < side; ++j)
    for (std::uint32_t i = 0; i < side; ++i) {
      double s, c;
      sin_cos(0.9 * spacing * i + 0.4 * spacing * j, s, c);
      field.heights.push_back(amplitude * s);
    }
  return field;
}

Scene piles_case() { return with_meteor(generate("piles", 135, 1), 90); }
Scene heap_case() { return generate("heap", 200, 2); }
Scene city_case() { return generate("city", 160, 3); }
Scene towers_case() { return with_meteor(generate("towers", 90, 3), 20); }
Scene dominoes_case() { return generate("dominoes", 60, 4); }
Scene cluster_case() { return generate("cluster", 120, 5); }
Scene machines_case() { return generate("machines", 108, 1); }
Scene shapes_case() { return with_meteor(shapes_scene(), 150); }
Scene wide_case() { return with_meteor(wide_scene(), 330); }

}  // namespace

const char* name_of(Kind kind) {
  constexpr const char* kNames[] = {"sphere", "box", "capsule", "cylinder", "hull", "tetrahedron", "table", "dumbbell"};
  static_assert(std::size(kNames) == static_cast<std::size_t>(Kind::kCount));
  return kNames[static_cast<int>(kind)];
}

Body& add_shape(SceneBuilder& builder, Kind kind, const Vec3& position, const Quat& orientation) {
  switch (kind) {
    case Kind::kSphere:
      return builder.add(Sphere{0.25}, position, orientation);
    case Kind::kBox:
      return builder.add(Box{Vec3(0.5, 0.4, 0.3)}, position, orientation);
    case Kind::kCapsule:
      return builder.add(Capsule{0.15, 0.4}, position, orientation);
    case Kind::kCylinder:
      return builder.add(Cylinder{0.25, 0.3}, position, orientation);
    case Kind::kHull:
      return builder.add(random_hull(16, 0.3, 7), position, orientation);
    case Kind::kTetrahedron:
      return builder.add(ConvexHull{{Vec3(.3, .3, .3), Vec3(.3, -.3, -.3), Vec3(-.3, .3, -.3), Vec3(-.3, -.3, .3)}},
                         position, orientation);
    case Kind::kTable: {  // a top and four legs
      Body& table = builder.add(Box{Vec3(0.6, 0.6, 0.1)}, position, orientation);
      for (double x : {-0.25, 0.25})
        for (double y : {-0.25, 0.25})
          table.shapes.push_back(shape(builder, Box{Vec3(0.1, 0.1, 0.3)}, Vec3(x, y, -0.2)));
      return table;
    }
    case Kind::kDumbbell: {  // two different balls on a bar
      const Quat along_x = rotation_of(Vec3(0, 0.5 * 3.14159265358979323846, 0));
      Body& dumbbell = builder.add(Capsule{0.08, 0.4}, position, orientation);
      dumbbell.shapes[0].pose.orientation = along_x;
      dumbbell.shapes.push_back(shape(builder, Sphere{0.2}, Vec3(0.2, 0, 0)));
      dumbbell.shapes.push_back(shape(builder, Sphere{0.15}, Vec3(-0.2, 0, 0)));
      return dumbbell;
    }
    case Kind::kCount:
      break;
  }
  throw std::invalid_argument("no such kind of shape");
}

Scene shapes_scene() {
  SceneBuilder builder("shapes");
  Random random(11);
  std::uint32_t n = 0;
  for (double x : {-6.0, -2.0, 2.0, 6.0})  // bowl, plane, box, height field
    for (std::uint32_t i = 0; i < 16; ++i, ++n) {
      const Vec3 at(x + 0.8 * (i % 2 - 0.5), 0.8 * (i / 2 % 2 - 0.5), 1.3 + 0.8 * (i / 4));
      Body& body = add_shape(builder, static_cast<Kind>((i + n / 16) % 8),
                             at + random.between(Vec3::Constant(-.02), Vec3::Constant(.02)), random.orientation());
      body.friction = 0.4 + 0.1 * (i % 4);
      body.angular_damping = 0.3;  // round things would roll for long
      if (i % 5 == 0) body.restitution = 0.4;
      body.fixed_rotation = i % 8 == 6;
    }
  builder.add_static(Plane{}, Vec3(0, 0, 0)).friction = 0.7;
  builder.add_static(bowl(1.9, 1.2, 6, 17), Vec3(-6, 0, 0.05));
  builder.add_static(Box{Vec3(2.2, 2.2, 0.5)}, Vec3(2, 0, 0.25), rotation_of(Vec3(0.05, 0, 0.3)));
  builder.add_static(waves(17, 0.25, 0.12), Vec3(6, 0, 0.2));
  return builder.finish();
}

Scene wide_scene() {
  SceneBuilder builder("wide");
  Random random(12);
  const Box crate{Vec3(0.3, 0.3, 0.3)};
  for (int x = -2; x <= 2; ++x)
    for (int y = -1; y <= 1; ++y) builder.add(crate, Vec3(2.5 * x, y, 0.16));
  builder.add(Box{Vec3(11, 3, 0.2)}, Vec3(0, 0, 0.45));                                  // a slab on fifteen crates
  builder.add(Box{Vec3(8, 0.3, 0.1)}, Vec3(0, 1, 1.2), rotation_of(Vec3(0, 0.05, 0)));   // a plank that falls on it
  builder.add(Sphere{1.5}, Vec3(3, -0.5, 4), Quat::Identity(), 50).angular_damping = 3;  // or it rolls for ever
  for (int i = 0; i < 40; ++i)
    builder.add(crate, random.between(Vec3(-5, -1.3, 1.6), Vec3(1, 1.3, 1.7)) + Vec3(0, 0, 0.5 * (i % 8)),
                random.orientation());
  builder.add_ground(200);
  return builder.finish();
}

Scene with_meteor(Scene scene, double height) {
  Body meteor;
  meteor.id = scene.bodies.back().id + 1;
  for (const Body& b : scene.bodies) meteor.id = std::max(meteor.id, b.id + 1);
  // Not on the middle exactly, so that nothing is symmetric.
  meteor.pose.position = Vec3(0.07, -0.11, height);
  meteor.shapes = {Shape{static_cast<std::uint32_t>(scene.geometries.size()), Pose{}}};
  scene.geometries.push_back(Sphere{0.6});
  meteor.inertial = mass_of(scene.geometries.back(), 3000);
  scene.bodies.push_back(meteor);
  return scene;
}

const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"piles", piles_case, 400, true, true},       {"heap", heap_case, 300, false, false},
      {"city", city_case, 240, false, false},       {"towers", towers_case, 240, true, true},
      {"dominoes", dominoes_case, 420, true, true}, {"cluster", cluster_case, 240, false, false},
      {"machines", machines_case, 300, true, true}, {"shapes", shapes_case, 420, true, true},
      {"wide", wide_case, 530, true, true},
  };
  return all;
}

namespace {

std::string hex(double d) {
  char text[40];
  std::snprintf(text, sizeof text, "%a", d);
  return text;
}

// Names and compares the doubles of one thing; empty where equal.
template <std::size_t N>
std::string compare(const char* field, const double (&expected)[N], const double (&got)[N]) {
  for (std::size_t i = 0; i < N; ++i)
    if (std::memcmp(&expected[i], &got[i], sizeof(double)) != 0)
      return std::string(field) + "[" + std::to_string(i) + "] is " + hex(got[i]) + ", should be " + hex(expected[i]);
  return {};
}

std::string difference(const BodyState& e, const BodyState& g) {
  if (e.id != g.id) return "id is " + std::to_string(g.id);
  for (const std::string& text :
       {compare("position", e.position, g.position), compare("orientation", e.orientation, g.orientation),
        compare("linear_velocity", e.linear_velocity, g.linear_velocity),
        compare("angular_velocity", e.angular_velocity, g.angular_velocity)})
    if (!text.empty()) return text;
  if (e.quiet_steps != g.quiet_steps) return "quiet_steps is " + std::to_string(g.quiet_steps);
  return "flags are " + std::to_string(g.flags) + ", should be " + std::to_string(e.flags);
}

std::string difference(const ContactRecord& e, const ContactRecord& g) {
  const auto name = [](const ContactRecord& r) {
    return std::to_string(r.a) + (r.with_static() ? "/static " : "/") + std::to_string(r.b & ~kStaticBit) + " part " +
           std::to_string(r.part) + ", " + std::to_string(r.count) + " points";
  };
  if (name(e) != name(g)) return "is of " + name(g);
  for (const std::string& text : {compare("normal", e.normal, g.normal), compare("offset", e.offset, g.offset),
                                  compare("orientation_a", e.orientation_a, g.orientation_a),
                                  compare("orientation_b", e.orientation_b, g.orientation_b),
                                  compare("friction", e.friction, g.friction), compare("twist", {e.twist}, {g.twist})})
    if (!text.empty()) return text;
  for (std::size_t i = 0; i < kMaxContactPoints; ++i)
    for (const std::string& text : {compare("arm_a", e.points[i].arm_a, g.points[i].arm_a),
                                    compare("arm_b", e.points[i].arm_b, g.points[i].arm_b),
                                    compare("impulse", {e.points[i].impulse}, {g.points[i].impulse})})
      if (!text.empty()) return "point " + std::to_string(i) + " " + text;
  return "unknown";
}

}  // namespace

std::string first_difference(const BodySet& expected, const BodySet& got) {
  for (std::size_t i = 0; i < std::min(expected.bodies.size(), got.bodies.size()); ++i)
    if (std::memcmp(&expected.bodies[i], &got.bodies[i], sizeof(BodyState)) != 0)
      return "body " + std::to_string(expected.bodies[i].id) + ": " + difference(expected.bodies[i], got.bodies[i]);
  if (expected.bodies.size() != got.bodies.size()) return std::to_string(got.bodies.size()) + " bodies";
  for (std::size_t i = 0; i < std::min(expected.contacts.size(), got.contacts.size()); ++i)
    if (std::memcmp(&expected.contacts[i], &got.contacts[i], sizeof(ContactRecord)) != 0)
      return "record of " + std::to_string(expected.contacts[i].a) + "/" +
             std::to_string(expected.contacts[i].b & ~kStaticBit) + ": " +
             difference(expected.contacts[i], got.contacts[i]);
  if (expected.contacts.size() != got.contacts.size())
    return std::to_string(got.contacts.size()) + " records, should be " + std::to_string(expected.contacts.size());
  return {};
}

void Watch::see(const BodySet& set) {
  most_contacts = std::max(most_contacts, set.contacts.size());
  asleep_.resize(set.bodies.size(), false);
  parent_.resize(set.bodies.size());
  std::iota(parent_.begin(), parent_.end(), 0u);
  const auto slot = [&](BodyId id) {
    const auto at = std::lower_bound(set.bodies.begin(), set.bodies.end(), id,
                                     [](const BodyState& b, BodyId i) { return b.id < i; });
    return static_cast<std::uint32_t>(at - set.bodies.begin());
  };
  const auto root = [&](std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i];
    return i;
  };
  for (const ContactRecord& c : set.contacts)
    if (!c.with_static()) parent_[root(slot(c.a))] = root(slot(c.b));
  std::size_t islands = 0;
  for (std::uint32_t i = 0; i < set.bodies.size(); ++i) islands += parent_[i] == i;
  most_islands = std::max(most_islands, islands);
  for (std::size_t i = 0; i < set.bodies.size(); ++i) {
    const bool now = set.bodies[i].asleep();
    if (now && !asleep_[i]) ++slept;
    if (!now && asleep_[i]) ++woke;
    asleep_[i] = now;
  }
}

void run(Stepper& stepper, BodySet& set, const Scene& scene, double seconds) {
  const int steps = static_cast<int>(std::lround(seconds / scene.dt));
  for (int i = 0; i < steps; ++i) stepper.step(set);
}

const BodyState& body(const BodySet& set, BodyId id) {
  for (const BodyState& b : set.bodies)
    if (b.id == id) return b;
  throw std::invalid_argument("no body " + std::to_string(id));
}

double energy(const Model& model, const BodySet& set) {
  double sum = 0;
  for (const BodyState& b : set.bodies) {
    const BodyModel& m = *model.find(b.id);
    const Vec3 local = b.q().conjugate() * b.w();
    sum += 0.5 * m.mass * b.v().squaredNorm() + 0.5 * local.dot(m.inertia * local) -
           m.mass * model.scene().gravity.dot(b.x());
  }
  return sum;
}

Vec3 momentum(const Model& model, const BodySet& set) {
  Vec3 sum = Vec3::Zero();
  for (const BodyState& b : set.bodies) sum += model.find(b.id)->mass * b.v();
  return sum;
}

Vec3 angular_momentum(const Model& model, const BodySet& set) {
  Vec3 sum = Vec3::Zero();
  for (const BodyState& b : set.bodies) {
    const BodyModel& m = *model.find(b.id);
    sum += b.x().cross(m.mass * b.v()) + b.q() * (m.inertia * (b.q().conjugate() * b.w()));
  }
  return sum;
}

}  // namespace soda::physics::test
