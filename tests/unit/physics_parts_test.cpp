// The step's parts against the plainest ways of doing the same: all pairs, flood fill, shuffled input.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include "common/scene/random.h"
#include "physics_scenes.h"

namespace soda::physics::test {
namespace {

using PairSet = std::set<std::pair<std::uint32_t, std::uint32_t>>;

PairSet all_pairs(const std::vector<Aabb>& boxes, const std::vector<std::uint8_t>& roles) {
  PairSet pairs;
  for (std::uint32_t i = 0; i < boxes.size(); ++i)
    for (std::uint32_t j = i + 1; j < boxes.size(); ++j) {
      const bool awake = ((roles[i] | roles[j]) & kRoleAwake) != 0, wanted = ((roles[i] | roles[j]) & kRoleWanted) != 0;
      const bool both_wide = (roles[i] & roles[j] & kRoleWide) != 0;
      if (awake && (wanted || both_wide) && boxes[i].overlaps(boxes[j])) pairs.insert({i, j});
    }
  return pairs;
}

std::vector<Aabb> random_boxes(Random& random, std::size_t count, double space, double large_share) {
  std::vector<Aabb> boxes(count);
  for (Aabb& box : boxes) {
    const double most = random.unit() < large_share ? 12 : 0.9;
    const Vec3 half = random.between(Vec3::Constant(0.02), Vec3::Constant(0.5 * most));
    const Vec3 at = random.between(Vec3::Constant(-space), Vec3::Constant(space));
    box = {at - half, at + half};
  }
  return boxes;
}

TEST(BroadPhase, FindsExactlyTheOverlappingPairs) {
  Random random(21);
  BroadPhase broad;  // one for all: nothing may be left over from the last call
  std::size_t found = 0;
  for (int trial = 0; trial < 120; ++trial) {
    const double space = trial % 3 == 0 ? 2 : trial % 3 == 1 ? 6 : 30;
    std::vector<Aabb> boxes = random_boxes(random, 20 + random.below(300), space, trial % 2 ? 0.03 : 0);
    if (trial % 10 == 0) boxes[0] = {Vec3::Constant(-1e9), Vec3::Constant(1e9)};
    if (trial % 10 == 1) boxes[1] = {Vec3::Constant(1e15), Vec3::Constant(1e15 + 1)};
    std::vector<std::uint8_t> roles(boxes.size());
    const std::uint32_t sleeping = random.below(5);  // of five
    for (std::uint8_t& r : roles) {
      r = random.below(4) == 0 ? kRoleNone : kRoleWanted;
      if (random.below(5) >= sleeping) r |= kRoleAwake;
      if (random.below(6) == 0) r |= kRoleWide;
      if (trial % 4 == 0) r = kRoleWanted | kRoleAwake;
    }
    Pairs pairs;
    broad.find(boxes, roles, 1.0, pairs);
    PairSet got;
    for (std::uint32_t i = 0; i < boxes.size(); ++i) {
      ASSERT_TRUE(std::is_sorted(pairs.of(i).begin(), pairs.of(i).end()));
      for (const std::uint32_t j : pairs.of(i)) {
        ASSERT_LT(i, j);
        ASSERT_TRUE(got.insert({i, j}).second) << "twice: " << i << " " << j;
      }
    }
    ASSERT_EQ(got, all_pairs(boxes, roles)) << "trial " << trial;
    found += got.size();
  }
  EXPECT_GT(found, 1000u);
}

// What touches, or overlaps by the last bit, meets; what is apart by the last bit does not. At the places where scenes
// are, and where single precision ends.
TEST(BroadPhase, TheLastBitDecides) {
  BroadPhase broad;
  const std::vector<std::uint8_t> roles(2, kRoleWanted | kRoleAwake);
  Random random(23);
  for (const double place : {0.0, 0.1, 1.0, 1e3, 1e6, 1e7, 1e30, 1e38, 1e39, 1e300})
    for (int trial = 0; trial < 60; ++trial) {
      const int axis = trial % 3;
      const double edge = place * (1 + random.between(-0.5, 0.5)) + random.between(0.01, 0.4);
      const double size = std::max(0.3, 1e-3 * place);
      std::vector<Aabb> boxes(2, {Vec3::Constant(place - size), Vec3::Constant(place + size)});
      boxes[0].max[axis] = edge;
      boxes[0].min[axis] = edge - size;
      boxes[1].min[axis] = trial % 2 ? edge : std::nextafter(edge, HUGE_VAL);
      boxes[1].max[axis] = edge + size;
      if (random.below(2) == 0) std::swap(boxes[0], boxes[1]);
      Pairs pairs;
      broad.find(boxes, roles, 4 * size, pairs);
      EXPECT_EQ(pairs.partners.size(), trial % 2 ? 1u : 0u) << place << ", trial " << trial;
    }
}

TEST(BroadPhase, BoxesThatAreNotNumbersMeetNobodyAndHarmNobody) {
  std::vector<Aabb> boxes(3, {Vec3::Zero(), Vec3::Ones()});
  boxes[1].min = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
  const std::vector<std::uint8_t> roles(3, kRoleWanted | kRoleAwake);
  Pairs pairs;
  BroadPhase().find(boxes, roles, 1.0, pairs);
  ASSERT_EQ(pairs.partners.size(), 1u);
  EXPECT_EQ(pairs.of(0)[0], 2u);
}

TEST(StaticGrid, FindsExactlyTheOverlappingBoxes) {
  Random random(22);
  for (int trial = 0; trial < 40; ++trial) {
    const std::vector<Aabb> boxes = random_boxes(random, random.below(200), 8, 0.1);
    const StaticGrid grid(boxes, 1.0);
    for (const Aabb& box : random_boxes(random, 60, 9, 0.1)) {
      std::vector<std::uint32_t> got, expected;
      grid.find(box, got);
      for (std::uint32_t i = 0; i < boxes.size(); ++i)
        if (boxes[i].overlaps(box)) expected.push_back(i);
      ASSERT_EQ(got, expected);
    }
  }
}

TEST(Islands, AreTheConnectedComponents) {
  Random random(23);
  IslandFinder finder;
  for (int trial = 0; trial < 100; ++trial) {
    const std::uint32_t bodies = 1 + random.below(120);
    std::vector<Ends> ends(random.below(bodies + 20));
    for (Ends& e : ends) {
      e.a = random.below(bodies);
      e.b = random.below(3) == 0 ? kStaticSlot : random.below(bodies);
    }
    Islands islands;
    finder.find(bodies, ends, islands);
    // Flood fill: lowest body reached from each.
    std::vector<std::uint32_t> lowest(bodies);
    std::iota(lowest.begin(), lowest.end(), 0u);
    for (bool changed = true; changed;) {
      changed = false;
      for (const Ends& e : ends)
        if (e.b != kStaticSlot && lowest[e.a] != lowest[e.b])
          lowest[e.a] = lowest[e.b] = std::min(lowest[e.a], lowest[e.b]), changed = true;
    }
    std::vector<bool> body_seen(bodies, false), contact_seen(ends.size(), false);
    std::uint32_t first_before = 0;
    for (std::size_t i = 0; i < islands.size(); ++i) {
      const auto members = islands.bodies_of(i);
      ASSERT_FALSE(members.empty());
      ASSERT_TRUE(std::is_sorted(members.begin(), members.end()));
      ASSERT_TRUE(i == 0 || members[0] > first_before) << "ordered by first body";
      first_before = members[0];
      for (const std::uint32_t b : members) {
        ASSERT_EQ(lowest[b], members[0]);
        ASSERT_FALSE(body_seen[b]);
        body_seen[b] = true;
      }
      const auto contacts = islands.contacts_of(i);
      ASSERT_TRUE(std::is_sorted(contacts.begin(), contacts.end()));
      for (const std::uint32_t c : contacts) {
        ASSERT_EQ(lowest[ends[c].a], members[0]);
        ASSERT_FALSE(contact_seen[c]);
        contact_seen[c] = true;
      }
    }
    EXPECT_EQ(std::count(body_seen.begin(), body_seen.end(), false), 0);
    EXPECT_EQ(std::count(contact_seen.begin(), contact_seen.end(), false), 0);
  }
}

TEST(ConstraintOrder, DoesNotDependOnWhereBodiesLieInMemoryNorOnOtherIslands) {
  Random random(24);
  for (int trial = 0; trial < 60; ++trial) {
    const std::uint32_t bodies = 60;
    std::vector<Vec3> centres(bodies);
    for (Vec3& c : centres) c = random.between(Vec3::Constant(-20), Vec3::Constant(20));
    std::vector<Ends> ends;
    for (std::uint32_t a = 0; a < bodies; ++a) {
      ends.push_back({a, kStaticSlot});
      for (std::uint32_t b = a + 1; b < bodies; ++b)
        if ((centres[a] - centres[b]).norm() < 9) ends.push_back({a, b});
    }
    std::vector<std::uint32_t> order(ends.size());
    std::iota(order.begin(), order.end(), 0u);
    ConstraintOrder sorter(8.0);
    sorter.sort(order, ends, centres);

    // A permutation, and within each run of one colour no body twice in a row (colours share no body).
    std::vector<std::uint32_t> check = order;
    std::sort(check.begin(), check.end());
    for (std::uint32_t i = 0; i < check.size(); ++i) ASSERT_EQ(check[i], i);
    ASSERT_FALSE(std::is_sorted(order.begin(), order.end())) << "nothing was sorted";

    // The same bodies at other positions of a larger array, among strangers.
    const std::uint32_t space = 200;
    std::vector<std::uint32_t> place(space);
    std::iota(place.begin(), place.end(), 0u);
    for (std::uint32_t i = space; i > 1; --i) std::swap(place[i - 1], place[random.below(i)]);
    std::vector<Vec3> other_centres(space, Vec3::Constant(3));
    for (std::uint32_t b = 0; b < bodies; ++b) other_centres[place[b]] = centres[b];
    std::vector<Ends> other_ends(17, Ends{0, 1});  // records of other islands lie before
    for (const Ends& e : ends) other_ends.push_back({place[e.a], e.b == kStaticSlot ? kStaticSlot : place[e.b]});
    std::vector<std::uint32_t> other(ends.size());
    std::iota(other.begin(), other.end(), 17u);
    sorter.sort(other, other_ends, other_centres);
    for (std::size_t i = 0; i < order.size(); ++i) ASSERT_EQ(other[i], order[i] + 17);
  }
}

TEST(ReachBox, HoldsTheBodyThroughTheStep) {
  for (const Case& c : cases()) {
    const Model model(c.make());
    Stepper stepper(model);
    BodySet set = model.initial_state();
    std::size_t moved = 0;
    for (int t = 0; t < 120; ++t) {
      const BodySet before = set;
      stepper.step(set);
      for (std::size_t i = 0; i < set.bodies.size(); ++i) {
        const BodyModel& m = *model.find(set.bodies[i].id);
        const BodyState &from = before.bodies[i], &to = set.bodies[i];
        // Unless an impulse changed its way within the step.
        if ((to.v() - from.v()).norm() > 0.25 || (to.w() - from.w()).norm() * m.radius > 0.2) continue;
        const Aabb reach = reach_box(from, model);
        Aabb box = bounding_box(model.shapes().children(m.first_child, m.children), to.x(), to.q().toRotationMatrix());
        // The box of a turned box about a shape; the shape is within the sphere, too.
        box.min = box.min.cwiseMax((to.x().array() - m.radius).matrix());
        box.max = box.max.cwiseMin((to.x().array() + m.radius).matrix());
        ASSERT_TRUE((box.min - reach.min).minCoeff() >= 0 && (reach.max - box.max).minCoeff() >= 0)
            << c.name << " body " << to.id << " step " << t;
        moved += from.v().norm() > 1;
      }
    }
    if (std::string(c.name) != "dominoes" && std::string(c.name) != "towers") {
      EXPECT_GT(moved, 0u) << c.name;
    }
  }
}

}  // namespace
}  // namespace soda::physics::test
