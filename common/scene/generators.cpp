#include "common/scene/generators.h"

#include <cmath>
#include <functional>
#include <stdexcept>
#include <unordered_map>

#include "common/scene/generator_parts.h"

namespace soda {
namespace generator {

std::uint32_t divide_up(std::uint32_t a, std::uint32_t b) { return (a + b - 1) / b; }

std::uint32_t square_side(std::uint32_t count) {
  std::uint32_t n = 1;
  while (std::uint64_t{n} * n < count) ++n;
  return n;
}

std::uint32_t colour(std::uint32_t n) {
  constexpr std::uint32_t kPalette[] = {0xd1603dff, 0x3d7ea6ff, 0x6a994eff, 0xe9b44cff,
                                        0x8e6c8aff, 0x5c9eadff, 0xbc4749ff, 0x7f8c8dff};
  return kPalette[n % std::size(kPalette)];
}

double ground_edge(double width) { return std::max(200.0, width + 60); }

namespace {

constexpr double kNear =
    1.7320508075688772 + 0.02;  // m: unit cubes further apart than this cannot touch, however turned

// Where bodies are already, for placing them at random without overlap.
class Occupied {
 public:
  bool take(const Vec3& at) {
    const auto cell = [](double v) { return static_cast<std::int64_t>(std::floor(v / kNear)); };
    const std::int64_t cx = cell(at.x()), cy = cell(at.y()), cz = cell(at.z());
    for (std::int64_t x = cx - 1; x <= cx + 1; ++x)
      for (std::int64_t y = cy - 1; y <= cy + 1; ++y)
        for (std::int64_t z = cz - 1; z <= cz + 1; ++z)
          if (const auto found = cells_.find(key(x, y, z)); found != cells_.end())
            for (const Vec3& other : found->second)
              if ((other - at).squaredNorm() < kNear * kNear) return false;
    cells_[key(cx, cy, cz)].push_back(at);
    return true;
  }

 private:
  static std::uint64_t key(std::int64_t x, std::int64_t y, std::int64_t z) {
    return static_cast<std::uint64_t>(x & 0x1fffff) << 42 | static_cast<std::uint64_t>(y & 0x1fffff) << 21 |
           static_cast<std::uint64_t>(z & 0x1fffff);
  }
  std::unordered_map<std::uint64_t, std::vector<Vec3>> cells_;
};

// Six static walls 1 m thick round the space between `low` and `high`.
void add_room(SceneBuilder& builder, const Vec3& low, const Vec3& high, double friction, double restitution) {
  const Vec3 middle = 0.5 * (low + high), size = high - low;
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side) {
      Vec3 at = middle, wall = size + Vec3::Constant(2);
      at[axis] = side == 0 ? low[axis] - 0.5 : high[axis] + 0.5;
      wall[axis] = 1;
      Body& body = builder.add_static(Box{wall}, at);
      body.name = "wall";
      body.friction = friction;
      body.restitution = restitution;
      body.colour = 0xc0c8d020;
    }
}

// The experiment of the SODA paper (section 4.1): cubes homogeneously, randomly distributed in a space, while their
// number, and so the density, grows. The paper has "24000 km3" and "cubes of 100 cm3"; we read 24,000 m^3 and cubes of
// 100 cm = 1 m, with which a few hundred bodies meet each other at all. Up to 2,400 cubes the space is 40 x 30 x 20 m;
// beyond, it grows at that density (a tenth full), for they would not find room otherwise. The cubes fly about without
// gravity, at up to 4 m/s, in a closed room, so that they stay homogeneously distributed.
void cubes(SceneBuilder& builder, Random& random, std::uint32_t count) {
  constexpr std::uint32_t kDensest = 2400;
  builder.scene.gravity = Vec3::Zero();
  const double grow = count > kDensest ? std::sqrt(static_cast<double>(count) / kDensest) : 1;
  const Vec3 half(20 * grow, 15 * grow, 10);
  const Vec3 margin = Vec3::Constant(0.5 * kNear);
  Occupied occupied;
  for (std::uint32_t i = 0; i < count;) {
    const Vec3 at = random.between(margin - half, half - margin);
    if (!occupied.take(at)) continue;
    const Quat orientation = random.orientation();
    Body& body = builder.add(Box{Vec3(1, 1, 1)}, at, orientation);
    const Vec3 direction = random.direction();
    body.linear_velocity = random.between(0, 4) * direction;
    body.angular_velocity = random.between(Vec3::Constant(-1), Vec3::Constant(1));
    body.restitution = 0.8;
    body.colour = colour(i);
    ++i;
  }
  add_room(builder, -half, half, 0, 1);
}

// Boxes and spheres in turn, .3 to .6 m, dropped in layers into one pit of 8 x 8 m.
void heap(SceneBuilder& builder, Random& random, std::uint32_t count) {
  constexpr double kPit = 8, kPitch = 0.66,
                   kFirstLayer = 0.5;  // m; the pitch has room for a .6 m box that is tilted a little
  constexpr std::uint32_t kSide = 12;  // 12 * .66 m < 8 m
  const double height = kFirstLayer + kPitch * (divide_up(count, kSide * kSide) + 1);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t layer = i / (kSide * kSide), row = i / kSide % kSide, column = i % kSide;
    Vec3 at((column - 0.5 * (kSide - 1)) * kPitch, (row - 0.5 * (kSide - 1)) * kPitch, kFirstLayer + layer * kPitch);
    at += random.between(Vec3::Constant(-0.005), Vec3::Constant(0.005));
    // Rounded sizes, so that bodies share their geometry.
    const double size = 0.3 + 0.05 * random.below(7);
    const Quat tilt = rotation_of(random.between(Vec3::Constant(-0.02), Vec3::Constant(0.02)));
    Body& body = (i + row + layer) % 2 == 0 ? builder.add(Box{Vec3(size, size, size)}, at, tilt)
                                            : builder.add(Sphere{0.5 * size}, at, tilt);
    body.linear_velocity = Vec3(0, 0, -1);
    body.colour = colour(layer);
  }
  builder.add_ground(200);
  for (int axis = 0; axis < 2; ++axis)
    for (double side : {-1.0, 1.0}) {
      Vec3 at(0, 0, 0.5 * height), size(kPit + 2, kPit + 2, height);
      at[axis] = side * (0.5 * kPit + 0.5);
      size[axis] = 1;
      Body& wall = builder.add_static(Box{size}, at);
      wall.name = "pit wall";
      wall.colour = 0xc0c8d040;
    }
}

// Eight bunches of .5 m boxes, loosely packed, fly from the corners of a cube to its middle and meet there, without
// gravity.
void cluster(SceneBuilder& builder, Random& random, std::uint32_t count) {
  constexpr std::uint32_t kBunches = 8;
  constexpr double kBox = 0.5, kPitch = 0.6, kSpeed = 5;  // m, m, m/s
  builder.scene.gravity = Vec3::Zero();
  std::uint32_t side = 1;  // of a bunch
  while (std::uint64_t{side} * side * side * kBunches < count) ++side;
  const double away = 0.5 * kPitch * side + 4;  // m along each axis, from the middle to a bunch's centre
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t bunch = i % kBunches, n = i / kBunches;  // the bunches' sizes differ by one at most
    const Vec3 corner(bunch & 1 ? 1 : -1, bunch & 2 ? 1 : -1, bunch & 4 ? 1 : -1);
    const Vec3 slot(n % side, n / side % side, n / (side * side));
    Vec3 at = away * corner + kPitch * (slot - Vec3::Constant(0.5 * (side - 1)));
    at += random.between(Vec3::Constant(-0.02), Vec3::Constant(0.02));
    Body& body = builder.add(Box{Vec3(kBox, kBox, kBox)}, at, Quat::Identity(), 250.0 * (2 + random.below(5)));
    body.linear_velocity = corner * (-kSpeed / 1.7320508075688772);
    body.linear_velocity += random.between(Vec3::Constant(-0.2), Vec3::Constant(0.2));
    body.restitution = 0.3;
    body.colour = colour(bunch);
  }
}

void piles(SceneBuilder& builder, Random& random, std::uint32_t count) {
  builder.add_ground(ground_edge(add_piles(builder, random, count, Vec3::Zero())));
}

void towers(SceneBuilder& builder, Random&, std::uint32_t count) {
  builder.add_ground(ground_edge(add_towers(builder, count, Vec3::Zero())));
}

void city(SceneBuilder& builder, Random& random, std::uint32_t count) {
  builder.add_ground(ground_edge(add_city(builder, random, count / 2, count - count / 2, Vec3::Zero())));
}

// Friction between dominoes is .25 and on the ground .5 = sqrt(.25 * 1): hence the ground's 1.
void dominoes(SceneBuilder& builder, Random&, std::uint32_t count) {
  builder.add_ground(ground_edge(add_dominoes(builder, count, Vec3::Zero())), 1);
}

void machines(SceneBuilder& builder, Random& random, std::uint32_t count) {
  builder.add_ground(ground_edge(add_machines(builder, random, count, Vec3::Zero())));
}

// A little of everything, side by side: a city in the middle, piles to its left, dominoes to its right.
void demo(SceneBuilder& builder, Random& random, std::uint32_t count) {
  const std::uint32_t in_piles = count / 5, in_rows = count / 5, slabs = 7 * count / 20;
  const double town = add_city(builder, random, slabs, count - in_piles - in_rows - slabs, Vec3::Zero());
  // Each part is told its middle, so how wide it is must be known first: try it on a builder of its own.
  SceneBuilder trial("");
  Random trial_random(0);
  const double heaps = in_piles > 0 ? add_piles(trial, trial_random, in_piles, Vec3::Zero()) : 0;
  const double rows = in_rows > 0 ? add_dominoes(trial, in_rows, Vec3::Zero()) : 0;
  constexpr double kGap = 4;  // m
  if (in_piles > 0) add_piles(builder, random, in_piles, Vec3(-0.5 * (town + heaps) - kGap, 0, 0));
  if (in_rows > 0) add_dominoes(builder, in_rows, Vec3(0.5 * (town + rows) + kGap, 0, 0));
  builder.add_ground(ground_edge(town + 2 * std::max(heaps, rows) + 4 * kGap));
}

struct Entry {
  Generator about;
  void (*make)(SceneBuilder&, Random&, std::uint32_t);
};

constexpr Entry kEntries[] = {
    {{"cubes", "1 m cubes flying about in a closed room of 24,000 m^3 without gravity (the paper's experiment)"},
     cubes},
    {{"piles", "heaps of 27 tumbled .5 m boxes, 10 m apart"}, piles},
    {{"heap", "boxes and spheres dropped into one pit of 8 x 8 m"}, heap},
    {{"towers", "towers of ten 1 m boxes, 3 m apart"}, towers},
    {{"city", "half in stacks of 20 mixed slabs, half a driven crowd in the streets between them"}, city},
    {{"dominoes", "rows of up to 200 dominoes, the first of each pushed"}, dominoes},
    {{"cluster", "eight bunches of boxes that meet in zero gravity"}, cluster},
    {{"machines", "driven cars, swinging chains, presses, doors and turning arms among loose boxes"}, machines},
    {{"demo", "a small city, piles and dominoes side by side"}, demo},
};

}  // namespace
}  // namespace generator

std::span<const Generator> generators() {
  static const std::vector<Generator> list = [] {
    std::vector<Generator> all;
    for (const generator::Entry& entry : generator::kEntries) all.push_back(entry.about);
    return all;
  }();
  return list;
}

Scene generate(const std::string& name, std::uint32_t bodies, std::uint64_t seed) {
  std::string known;
  for (const generator::Entry& entry : generator::kEntries) {
    if (name != entry.about.name) {
      known += (known.empty() ? "" : ", ") + std::string(entry.about.name);
      continue;
    }
    if (bodies == 0 || bodies > kMaxGenerated)
      throw std::invalid_argument("the number of bodies must be between 1 and " + std::to_string(kMaxGenerated) +
                                  ", is " + std::to_string(bodies));
    SceneBuilder builder(name);
    Random random(seed);
    entry.make(builder, random, bodies);
    return builder.finish();
  }
  throw std::invalid_argument("no generator is called \"" + name + "\"; there are: " + known);
}

}  // namespace soda
