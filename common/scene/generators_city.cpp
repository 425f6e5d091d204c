// A city: stacks of slabs, and people walking in the streets between them.
#include <algorithm>

#include "common/scene/generator_parts.h"

namespace soda::generator {
namespace {

constexpr std::uint32_t kStack = 20;                                    // slabs
constexpr double kBlock = 1.6, kStreet = 4, kPitch = kBlock + kStreet;  // m: a stack has a block of its own
constexpr double kWalk = 1.4;                                           // m/s
const Vec3 kPerson(0.6, 0.6, 0.8);                                      // m, low enough not to topple when pushed

// A place for a person, relative to the lower left corner of a block's share of the city (the block at its lower left,
// a street right of it and one above it), and the way along which one walks there.
struct Place {
  double x, y;
  bool along_x, along_y;
};

std::vector<Place> places_of_block() {
  std::vector<Place> places;
  constexpr double kLane = 1.0;  // m between neighbours across the street: four lanes
  for (int lane = 0; lane < 4; ++lane) {
    const double across = kBlock + 0.5 * kStreet + (lane - 1.5) * kLane;
    for (int i = 0; i < 2; ++i) {
      const double along = 0.25 * kBlock + i * 0.5 * kBlock;  // two beside the block: .8 m apart
      places.push_back({along, across, true, false});
      places.push_back({across, along, false, true});
    }
    for (int i = 0; i < 4; ++i) places.push_back({kBlock + 0.5 * kStreet + (i - 1.5) * kLane, across, true, true});
  }
  return places;  // 32; people take some of them
}

void add_stack(SceneBuilder& builder, Random& random, std::uint32_t slabs, const Vec3& foot) {
  double top = foot.z();
  for (std::uint32_t i = 0; i < slabs; ++i) {
    Vec3 size;  // in steps of 5 cm, so that slabs share their geometry
    size.x() = 0.8 + 0.05 * random.below(17);
    size.y() = 0.8 + 0.05 * random.below(17);
    size.z() = 0.1 + 0.05 * random.below(6);
    const double dx = random.between(-0.02, 0.02), dy = random.between(-0.02, 0.02);
    builder.add(Box{size}, Vec3(foot.x() + dx, foot.y() + dy, top + 0.5 * size.z())).colour = colour(random.below(8));
    top += size.z();
  }
}

}  // namespace

// Blocks on a square lattice, one stack each. People keep to the lanes: those in the lower or right half of a street
// walk towards +x or +y, the others back, and at the city's edges they turn round.
double add_city(SceneBuilder& builder, Random& random, std::uint32_t slabs, std::uint32_t people, const Vec3& middle) {
  static const std::vector<Place> places = places_of_block();
  const std::uint32_t per_block = 20;  // people; as many as slabs, so a city of equal parts is evenly filled
  const std::uint32_t stacks = divide_up(slabs, kStack);
  const std::uint32_t side = square_side(std::max({stacks, divide_up(people, per_block), 1u}));
  const double width = kPitch * side + kStreet;  // streets on all sides
  const Vec3 corner = middle - Vec3(0.5 * width, 0.5 * width, 0);
  for (std::uint32_t s = 0; s < stacks; ++s) {
    const Vec3 at(corner.x() + kStreet + kPitch * (s % side) + 0.5 * kBlock,
                  corner.y() + kStreet + kPitch * (s / side) + 0.5 * kBlock, 0);
    add_stack(builder, random, std::min(kStack, slabs - s * kStack), at);
  }

  // All places of the city in a random order; the first ones are taken.
  struct Taken {
    std::uint32_t block, place;
  };
  std::vector<Taken> order;
  const std::uint32_t blocks = std::max({stacks, divide_up(people, per_block), 1u});
  for (std::uint32_t b = 0; b < blocks; ++b)
    for (std::uint32_t p = 0; p < places.size(); ++p) order.push_back({b, p});
  for (std::uint32_t i = 0; i < people; ++i)
    std::swap(order[i], order[i + random.below(static_cast<std::uint32_t>(order.size()) - i)]);

  const Aabb bounds{Vec3(corner.x() + 0.5, corner.y() + 0.5, -1000),
                    Vec3(corner.x() + width - 0.5, corner.y() + width - 0.5, 1000)};
  for (std::uint32_t i = 0; i < people; ++i) {
    const Place& place = places[order[i].place];
    const std::uint32_t block = order[i].block;
    const Vec3 at(corner.x() + kStreet + kPitch * (block % side) + place.x,
                  corner.y() + kStreet + kPitch * (block / side) + place.y, 0.5 * kPerson.z());
    const bool along_x = place.along_x && !(place.along_y && random.below(2) == 1);
    const double across = along_x ? place.y : -place.x;
    const double centre = along_x ? kBlock + 0.5 * kStreet : -(kBlock + 0.5 * kStreet);
    const double speed = (across < centre ? kWalk : -kWalk) * random.between(0.8, 1.2);
    Body& person = builder.add(Box{kPerson}, at, Quat::Identity(), 250);
    person.friction = 0.1;
    person.colour = colour(random.below(8));
    // Strong enough for friction on the ground, sqrt(.1 * .5) g = 2.2 m/s^2, and to push a little.
    Drive drive;
    drive.velocity = along_x ? Vec3(speed, 0, 0) : Vec3(0, speed, 0);
    drive.max_acceleration = 5;
    drive.bounds = bounds;
    person.linear_velocity = drive.velocity;
    person.drive = drive;
  }
  return width;
}

}  // namespace soda::generator
