// The step is a pure function: the state at t + 1 has the same bits however t came about and however the work is cut
// up. Each test runs a scene twice, side by side, and compares every bit of every state, contact records included. This
// is what rollback, load balancing, restarts and any number of worlds rest on.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <numeric>

#include "common/scene/random.h"
#include "physics_scenes.h"

namespace soda::physics::test {
namespace {

class Purity : public testing::TestWithParam<Case> {
 protected:
  Purity() : model(GetParam().make()), reference(model), state(model.initial_state()) {}

  // Steps `state` by the reference and `other` by the function; they must stay equal.
  void run_beside(const std::function<void(BodySet&)>& advance) {
    BodySet other = state;
    for (int t = 1; t <= GetParam().steps; ++t) {
      reference.step(state);
      advance(other);
      watch.see(state);
      const std::string difference = first_difference(state, other);
      if (!difference.empty()) FAIL() << GetParam().name << ", step " << t << ": " << difference;
    }
    expect_events();
  }

  void expect_events() const {
    EXPECT_GT(watch.most_contacts, state.bodies.size() / 2);
    EXPECT_GT(watch.most_islands, 1u);
    EXPECT_GT(reference.contact_counters().detected, 0u);
    EXPECT_GT(reference.contact_counters().recycled, 0u);
    EXPECT_EQ(reference.counters.non_finite, 0u);
    if (GetParam().sleeps) {
      EXPECT_GT(watch.slept, 0u);
    }
    if (GetParam().wakes) {
      EXPECT_GT(watch.woke, 0u);
    }
  }

  Model model;
  Stepper reference;
  BodySet state;
  Watch watch;
};

TEST_P(Purity, EveryInstructionSetGivesTheSameBits) {
  const Kernels kernels = available_kernels();
  if (kernels.count < 2) GTEST_SKIP() << "this machine has the baseline's instructions only";
  for (int k = 0; k + 1 < kernels.count; ++k) {
    Stepper other(model);
    other.use(*kernels.list[k]);
    reference.use(*kernels.list[kernels.count - 1]);
    run_beside([&](BodySet& set) { other.step(set); });
  }
}

TEST_P(Purity, DoesNotDependOnTheOrderInTheScene) {
  Scene scene = GetParam().make();
  Random random(5);
  for (std::size_t i = scene.bodies.size(); i > 1; --i)
    std::swap(scene.bodies[i - 1], scene.bodies[random.below(static_cast<std::uint32_t>(i))]);
  // The table of geometries turned round.
  std::reverse(scene.geometries.begin(), scene.geometries.end());
  for (Body& b : scene.bodies)
    for (Shape& s : b.shapes) s.geometry = static_cast<std::uint32_t>(scene.geometries.size()) - 1 - s.geometry;
  const Model shuffled(scene);
  Stepper stepper(shuffled);
  run_beside([&](BodySet& set) { stepper.step(set); });
}

TEST_P(Purity, RebuiltFromBytesEveryStep) {
  std::vector<unsigned char> bodies, contacts;
  int t = 0;
  std::unique_ptr<Model> fresh_model;
  run_beside([&](BodySet& set) {
    const auto to_bytes = [](const auto& from, std::vector<unsigned char>& bytes) {
      const auto* first = reinterpret_cast<const unsigned char*>(from.data());
      bytes.assign(first, first + from.size() * sizeof from[0]);
    };
    const auto from_bytes = [](const std::vector<unsigned char>& bytes, auto& to) {
      to.resize(bytes.size() / sizeof to[0]);
      std::copy(bytes.begin(), bytes.end(), reinterpret_cast<unsigned char*>(to.data()));
    };
    to_bytes(set.bodies, bodies);
    to_bytes(set.contacts, contacts);
    BodySet copy;
    from_bytes(bodies, copy.bodies);
    from_bytes(contacts, copy.contacts);
    if (t++ % 50 == 0) fresh_model = std::make_unique<Model>(GetParam().make());
    Stepper(*fresh_model).step(copy);
    set = std::move(copy);
  });
}

TEST_P(Purity, IslandsSolvedOneByOneInAnyOrder) {
  Stepper finder(model);
  Random random(6);
  std::vector<ContactRecord> found;
  std::vector<Ends> ends;
  Islands islands;
  run_beside([&](BodySet& set) {
    finder.find_contacts(set, {}, found);
    set.contacts = found;
    finder.find_islands(set.bodies, set.contacts, ends, islands);
    std::vector<std::uint32_t> order(islands.size());
    std::iota(order.begin(), order.end(), 0u);
    for (std::size_t i = order.size(); i > 1; --i)
      std::swap(order[i - 1], order[random.below(static_cast<std::uint32_t>(i))]);
    Stepper one(model), two(model);
    for (const std::uint32_t island : order)
      (random.below(2) ? one : two).solve(set.bodies, set.contacts, ends, islands, std::span(&island, 1));
  });
}

// Whoever looks for a body's partners looks within its reach box: a contact beyond it would be found by some and not by
// others.
TEST_P(Purity, EveryContactIsWithinReach) {
  Stepper finder(model);
  std::vector<ContactRecord> found;
  std::size_t between_sleepers = 0;
  for (int t = 1; t <= GetParam().steps; ++t) {
    reference.step(state);
    finder.find_contacts(state, {}, found);
    for (const ContactRecord& record : found) {
      if (record.with_static()) continue;
      const BodyState &a = body(state, record.a), &b = body(state, record.b);
      between_sleepers += a.asleep() && b.asleep();
      ASSERT_TRUE(reach_box(a, model).overlaps(reach_box(b, model)))
          << "step " << t << ": bodies " << a.id << " and " << b.id << (a.asleep() ? ", asleep" : "");
    }
  }
  if (GetParam().sleeps) {
    EXPECT_GT(between_sleepers, 0u);
  }
}

// A closed subset: some islands of this step, with the records that their bodies own from the step before.
BodySet subset_of(const BodySet& set, const std::vector<bool>& chosen) {
  BodySet subset;
  std::size_t record = 0;
  for (std::size_t i = 0; i < set.bodies.size(); ++i) {
    if (chosen[i]) subset.bodies.push_back(set.bodies[i]);
    for (; record < set.contacts.size() && set.contacts[record].a == set.bodies[i].id; ++record)
      if (chosen[i]) subset.contacts.push_back(set.contacts[record]);
  }
  return subset;
}

BodySet merged(const BodySet& a, const BodySet& b) {
  BodySet all;
  std::merge(a.bodies.begin(), a.bodies.end(), b.bodies.begin(), b.bodies.end(), std::back_inserter(all.bodies),
             [](const BodyState& l, const BodyState& r) { return l.id < r.id; });
  std::merge(a.contacts.begin(), a.contacts.end(), b.contacts.begin(), b.contacts.end(),
             std::back_inserter(all.contacts), record_before);
  return all;
}

TEST_P(Purity, ClosedSubsetsAgreeWithTheWhole) {
  Stepper finder(model), stepper(model);
  Random random(8);
  std::vector<ContactRecord> found;
  std::vector<Ends> ends;
  Islands islands;
  std::size_t split = 0;
  run_beside([&](BodySet& set) {
    finder.find_contacts(set, {}, found);
    finder.find_islands(set.bodies, found, ends, islands);
    std::vector<bool> first(set.bodies.size()), second(set.bodies.size());
    for (std::size_t i = 0; i < islands.size(); ++i) {
      const bool in_first = random.below(2) == 1;
      for (std::uint32_t b : islands.bodies_of(i)) first[b] = in_first, second[b] = !in_first;
    }
    BodySet one = subset_of(set, first), two = subset_of(set, second);
    if (!one.bodies.empty() && !two.bodies.empty()) ++split;
    stepper.step(one);
    stepper.step(two);
    set = merged(one, two);
  });
  EXPECT_GT(split, static_cast<std::size_t>(GetParam().steps) / 2);
}

TEST_P(Purity, RestoredAndRunAgain) {
  // Every 60 steps the last 60 are run once more, by the same stepper, whose scratch memory holds the future.
  BodySet saved = state;
  std::vector<BodySet> past;
  for (int t = 1; t <= GetParam().steps; ++t) {
    reference.step(state);
    watch.see(state);
    past.push_back(state);
    if (t % 60 != 0) continue;
    BodySet again = saved;
    for (std::size_t k = 0; k < past.size(); ++k) {
      reference.step(again);
      const std::string difference = first_difference(past[k], again);
      ASSERT_TRUE(difference.empty()) << GetParam().name << ", step " << t - 60 + static_cast<int>(k) + 1 << ": "
                                      << difference;
    }
    saved = state;
    past.clear();
  }
  expect_events();
}

TEST_P(Purity, WantedContactsAreThoseOfTheWhole) {
  // With roles, the records found are those of the whole that touch a wanted body (between two wide ones: all); those
  // that belong to wanted bodies come first.
  Stepper stepper(model);
  Random random(9);
  std::vector<ContactRecord> whole, part;
  std::size_t left_out = 0;
  for (int t = 1; t <= GetParam().steps; ++t) {
    std::vector<std::uint8_t> roles(state.bodies.size());
    for (std::uint8_t& r : roles) r = random.below(3) == 0 ? kRoleNone : kRoleWanted;
    for (std::uint8_t& r : roles)
      if (random.below(4) == 0) r |= kRoleWide;
    stepper.find_contacts(state, {}, whole);
    const std::size_t of_wanted = stepper.find_contacts(state, roles, part);
    const auto role = [&](BodyId id) {
      const auto at = std::lower_bound(state.bodies.begin(), state.bodies.end(), id,
                                       [](const BodyState& b, BodyId i) { return b.id < i; });
      return roles[static_cast<std::size_t>(at - state.bodies.begin())];
    };
    BodySet expected, of_others, got;
    got.contacts = part;
    for (const ContactRecord& c : whole) {
      const std::uint8_t a = role(c.a), b = c.with_static() ? std::uint8_t{kRoleNone} : role(c.b);
      if (a & kRoleWanted)
        expected.contacts.push_back(c);
      else if ((b & kRoleWanted) || (a & b & kRoleWide))
        of_others.contacts.push_back(c);
      else
        ++left_out;
    }
    ASSERT_EQ(of_wanted, expected.contacts.size());
    expected.contacts.insert(expected.contacts.end(), of_others.contacts.begin(), of_others.contacts.end());
    const std::string difference = first_difference(expected, got);
    ASSERT_TRUE(difference.empty()) << GetParam().name << ", step " << t << ": " << difference;
    reference.step(state);
    watch.see(state);
  }
  EXPECT_GT(left_out, 0u);
  expect_events();
}

INSTANTIATE_TEST_SUITE_P(Scenes, Purity, testing::ValuesIn(cases()), [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace soda::physics::test
