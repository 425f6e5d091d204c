// Who owns which cell when.
#include <gtest/gtest.h>

#include <limits>

#include "server/border/territories.h"

namespace soda::border::territories_test {
namespace {

// A row of eight cells of 1 m, the left half of world 0, the right one of world 1; a third world has nothing.
TerritoryMap row() {
  Grid grid;
  grid.size = {8, 1, 1};
  return {grid, 3, {0, 0, 0, 0, 1, 1, 1, 1}};
}

std::string owners(const Territories& t, Step step) {
  std::string text;
  for (std::size_t cell = 0; cell < 8; ++cell) text += std::to_string(t.owner(cell, step));
  return text;
}

TEST(Territories, TransfersCountFromTheirStepInWhateverOrderTheyComeToBeKnown) {
  const Transfer first{0, 1, 10, 1, {3}}, second{1, 1, 20, 2, {7}}, third{1, 2, 20, 0, {4}};
  const std::vector<std::vector<Transfer>> orders = {
      {first, second, third}, {second, third, first}, {second, first, third}};
  for (const auto& order : orders) {
    Territories t(row());
    for (const Transfer& transfer : order) EXPECT_TRUE(t.add(transfer));
    EXPECT_EQ(owners(t, 0), "00001111");
    EXPECT_EQ(owners(t, 9), "00001111");
    EXPECT_EQ(owners(t, 10), "00011111");
    EXPECT_EQ(owners(t, 19), "00011111");
    EXPECT_EQ(owners(t, 20), "00010112");
    EXPECT_EQ(owners(t, 1000), "00010112");
    EXPECT_EQ(t.cells_of(2, 20), 1u);
    EXPECT_FALSE(t.add(second));  // known already
    EXPECT_EQ(t.transfers().size(), 3u);
    EXPECT_EQ(t.known(0), 1u);
    EXPECT_EQ(t.known(1), 2u);
    EXPECT_EQ(t.known(2), 0u);
  }
}

TEST(Territories, TellWhereOneWorldIsAmongItself) {
  Territories t(row());
  EXPECT_EQ(t.sole(2, 0), 0u);
  EXPECT_EQ(t.sole(3, 0), kNoWorld);
  EXPECT_EQ(t.sole(4, 0), kNoWorld);
  EXPECT_EQ(t.sole(5, 0), 1u);
  t.add({1, 1, 5, 0, {4}});
  EXPECT_EQ(t.sole(3, 4), kNoWorld);
  EXPECT_EQ(t.sole(3, 5), 0u);
  EXPECT_EQ(t.sole(5, 5), kNoWorld);
  EXPECT_EQ(t.sole(6, 5), 1u);
}

TEST(Territories, TellWhereThingsChange) {
  Territories t(row());
  t.add({1, 1, 5, 0, {4}});
  for (const Step step : {0, 4, 6}) EXPECT_FALSE(t.change_at(step)) << step;
  EXPECT_TRUE(t.change_at(5));
  std::string near;
  for (std::size_t cell = 0; cell < 8; ++cell) near += t.changes_near(cell, 5) ? 'x' : '.';
  EXPECT_EQ(near, "..xxxxx.");
  EXPECT_FALSE(t.changes_near(4, 6));
}

TEST(Territories, NeighboursAreSinceTheStepAtWhichCellsAreNear) {
  constexpr Step kNever = std::numeric_limits<Step>::max();
  Territories t(row());
  const auto since = [&](int range) {
    std::vector<Step> of(3, kNever);
    t.find_neighbours(2, range, 0, of);
    return of;
  };
  EXPECT_EQ(since(1), (std::vector<Step>{kNever, kNever, kNever}));
  t.add({1, 1, 5, 2, {6, 7}});
  t.add({0, 1, 9, 2, {0}});
  EXPECT_EQ(since(1), (std::vector<Step>{9, 5, 5}));
  EXPECT_EQ(since(3), (std::vector<Step>{5, 5, 5}));
}

TEST(Territories, KnowHowManyNeighboursLieBetween) {
  Grid grid;
  grid.size = {9, 1, 1};
  const Territories three({grid, 4, {0, 0, 0, 1, 1, 1, 2, 2, 2}});  // the fourth has nothing
  EXPECT_EQ(three.diameter(2), 2);
  EXPECT_EQ(three.diameter(4), 1);
  const Territories nine({grid, 9, {0, 1, 2, 3, 4, 5, 6, 7, 8}});
  EXPECT_EQ(nine.diameter(2), 4);
  EXPECT_EQ(Territories({grid, 1, std::vector<WorldId>(9, 0)}).diameter(2), 0);
}

TEST(Territories, ForgetWhatIsPast) {
  Territories t(row());
  t.add({1, 1, 5, 0, {4}});
  t.add({1, 2, 10, 0, {5}});
  t.add({1, 3, 90, 0, {6}});
  t.release_before(10, 5);
  EXPECT_EQ(owners(t, 10), "00000011");
  EXPECT_EQ(owners(t, 90), "00000001");
  EXPECT_EQ(t.transfers().size(), 3u);
  t.release_before(50, 5);
  EXPECT_EQ(owners(t, 50), "00000011");
  EXPECT_EQ(t.transfers().size(), 1u);
  EXPECT_FALSE(t.add({1, 1, 5, 0, {4}}));  // known, if not remembered
  EXPECT_TRUE(t.add({0, 1, 60, 1, {4, 5}}));
  EXPECT_EQ(owners(t, 60), "00001111");
  EXPECT_EQ(owners(t, 90), "00001101");
}

TEST(Territories, KnowWhatCannotBe) {
  Territories t(row());
  t.add({1, 1, 20, 0, {4}});
  EXPECT_EQ(t.fault({1, 2, 30, 0, {5}}), "");
  EXPECT_EQ(t.fault({1, 1, 7, 0, {9}}), "");  // known already
  EXPECT_EQ(t.fault({1, 3, 30, 0, {5}}), "others of its giver have to come before it");
  EXPECT_EQ(t.fault({1, 2, 30, 3, {5}}), "such worlds cannot be");
  EXPECT_EQ(t.fault({1, 2, 30, 1, {5}}), "such worlds cannot be");
  EXPECT_EQ(t.fault({1, 2, 0, 0, {5}}), "it would begin at a step that is past");
  EXPECT_EQ(t.fault({1, 2, 30, 0, {}}), "without cells");
  EXPECT_EQ(t.fault({1, 2, 30, 0, {8}}), "there is no cell 8");
  EXPECT_EQ(t.fault({1, 2, 30, 0, {6, 5}}), "its cells are out of order");
  EXPECT_EQ(t.fault({1, 2, 30, 0, {4}}), "cell 4 is not its giver's");
  EXPECT_EQ(t.fault({1, 2, 20, 0, {4}}), "");  // the step before it was
  EXPECT_FALSE(t.keeps(1, 4, 10));
  EXPECT_TRUE(t.keeps(1, 5, 10));
  EXPECT_TRUE(t.keeps(0, 4, 20));
  EXPECT_FALSE(t.keeps(0, 4, 19));
}

}  // namespace
}  // namespace soda::border::territories_test
