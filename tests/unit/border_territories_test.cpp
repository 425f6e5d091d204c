// Who owns which cell when.
#include <gtest/gtest.h>

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
  const Transfer first{0, 1, 10, 1, {3}}, second{1, 1, 20, 2, {3, 7}}, third{1, 2, 20, 0, {4}};
  const std::vector<std::vector<Transfer>> orders = {
      {first, second, third}, {third, second, first}, {second, third, first}};
  for (const auto& order : orders) {
    Territories t(row());
    for (const Transfer& transfer : order) EXPECT_TRUE(t.add(transfer));
    EXPECT_EQ(owners(t, 0), "00001111");
    EXPECT_EQ(owners(t, 9), "00001111");
    EXPECT_EQ(owners(t, 10), "00011111");
    EXPECT_EQ(owners(t, 19), "00011111");
    EXPECT_EQ(owners(t, 20), "00020112");
    EXPECT_EQ(owners(t, 1000), "00020112");
    EXPECT_EQ(t.cells_of(2, 20), 2u);
    EXPECT_FALSE(t.add(second));  // known already
    EXPECT_EQ(t.transfers().size(), 3u);
    EXPECT_TRUE(t.knows(1, 2));
    EXPECT_FALSE(t.knows(2, 1));
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

TEST(Territories, NeighboursAreThoseOfAnyTime) {
  Territories t(row());
  std::vector<std::uint8_t> marked;
  t.mark_neighbours(2, 1, marked);
  EXPECT_EQ(marked, (std::vector<std::uint8_t>{0, 0, 0}));
  t.add({1, 1, 5, 2, {6, 7}});
  t.mark_neighbours(2, 1, marked);
  EXPECT_EQ(marked, (std::vector<std::uint8_t>{0, 1, 1}));
  t.mark_neighbours(2, 3, marked);
  EXPECT_EQ(marked, (std::vector<std::uint8_t>{1, 1, 1}));
}

}  // namespace
}  // namespace soda::border::territories_test
