// What a world gives to whom, and what a world takes: load balancing's decisions, one at a time.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "server/balance/policy.h"

namespace soda::balance::test {
namespace {

constexpr double kMs = 1e-3;  // s

// One layer of cells: in `map` a digit is a cell's owner, rows from y = 0 up. World 0 asks itself; loads are in ms per
// step.
struct Field {
  Grid grid;
  std::vector<WorldId> owner;
  std::vector<double> cost;
  std::vector<Neighbour> neighbours;
  double budget = 0, ahead = 48;
  double coming = 0;  // ms per step, of cells accepted that are another's still
  Load load;
  Step now = 0;

  explicit Field(const std::vector<std::string>& map, double ms_per_cell = 0) {
    grid.size = {static_cast<std::int32_t>(map[0].size()), static_cast<std::int32_t>(map.size()), 1};
    for (const std::string& row : map)
      for (const char c : row) owner.push_back(static_cast<WorldId>(c - '0'));
    for (const WorldId w : owner) cost.push_back(w == 0 ? ms_per_cell * kMs : 0);
  }
  Field& knows(WorldId world, double ms) {
    neighbours.push_back({world, {ms * kMs, ms * kMs}});
    return *this;
  }
  std::vector<std::uint32_t> mine() const {
    std::vector<std::uint32_t> cells;
    for (std::uint32_t c = 0; c < owner.size(); ++c)
      if (owner[c] == 0) cells.push_back(c);
    return cells;
  }
  std::optional<Proposal> ask(Policy& policy) {
    const auto cells = mine();
    load.work = load.expected = std::accumulate(cost.begin(), cost.end(), coming * kMs);
    return policy.propose({grid, 0, now, owner, cells, cost, load, ahead, budget, neighbours});
  }
  std::optional<Proposal> ask() {
    Policy policy;
    return ask(policy);
  }
  void apply(const Proposal& p) {
    for (const std::uint32_t c : p.cells) owner[c] = p.taker, cost[c] = 0;
  }
  std::string text() const {
    std::string s;
    for (std::size_t c = 0; c < owner.size(); ++c) {
      s += static_cast<char>('0' + owner[c]);
      if ((c + 1) % static_cast<std::size_t>(grid.size[0]) == 0) s += '\n';
    }
    return s;
  }
};

TEST(BalanceShape, PiecesHangTogetherByFaces) {
  Field f({"0011", "1100", "2222", "3003"});
  EXPECT_FALSE(connected(f.grid, f.owner, 0));
  EXPECT_FALSE(connected(f.grid, f.owner, 1));  // corners do not count
  EXPECT_TRUE(connected(f.grid, f.owner, 2));
  EXPECT_FALSE(connected(f.grid, f.owner, 3));
  EXPECT_TRUE(connected(f.grid, f.owner, 4));  // has none
}

TEST(BalanceShape, WhatIsGivenMustTouchWhatTheTakerHas) {
  Field f({"0000", "0000", "0011", "0011"});
  const auto attached_to_1 = [&](std::vector<std::uint32_t> cells) { return attached(f.grid, f.owner, 1, cells); };
  EXPECT_TRUE(attached_to_1({6, 7}));
  EXPECT_TRUE(attached_to_1({2, 6}));  // one by way of the other
  EXPECT_FALSE(attached_to_1({2}));
  EXPECT_FALSE(attached_to_1({5}));        // by a corner
  EXPECT_FALSE(attached_to_1({0, 1, 6}));  // in part
}

TEST(BalanceShape, ACellLeavesWithoutCuttingWhatItLeaves) {
  const auto leaves = [](const std::vector<std::string>& map, std::size_t cell) {
    Field f(map);
    return can_leave(f.grid, cell, [&](std::size_t i) { return f.owner[i] == 0; });
  };
  EXPECT_TRUE(leaves({"000", "000", "111"}, 4));
  EXPECT_FALSE(leaves({"010", "000", "111"}, 4));
  EXPECT_TRUE(leaves({"110", "000", "110"}, 3));
  EXPECT_FALSE(leaves({"000", "101", "000"}, 4));
  // Up and down as well.
  Grid grid;
  grid.size = {2, 1, 3};
  EXPECT_TRUE(can_leave(grid, 2, [](std::size_t) { return true; }));
  EXPECT_FALSE(can_leave(grid, 2, [](std::size_t i) { return i % 2 == 0; }));
}

TEST(Balance, GivesHalfTheDifferenceAtMostBehindAStraightBorder) {
  Field f({"00001111", "00001111", "00001111", "00001111", "00001111", "00001111"}, 1);
  f.knows(1, 0);  // cells are all alike, but the neighbour's cost nothing
  const auto p = f.ask();
  ASSERT_TRUE(p);
  EXPECT_EQ(p->taker, 1u);
  EXPECT_LE(p->cost, 12 * kMs * (1 + 1e-9));
  EXPECT_GE(p->cost, 9 * kMs);
  EXPECT_NEAR(p->cost, static_cast<double>(p->cells.size()) * kMs, 1e-9);
  f.apply(*p);
  EXPECT_EQ(f.text(), "00111111\n00111111\n00111111\n00111111\n00111111\n00111111\n");
}

TEST(Balance, WhatDiffersLittleStays) {
  Field f(std::vector<std::string>(10, "0000000000111111"), 0.1);  // 10 ms in small cells
  EXPECT_FALSE(Field(f).knows(1, 12).ask());
  EXPECT_FALSE(Field(f).knows(1, 9.2).ask());
  EXPECT_TRUE(Field(f).knows(1, 9).ask());
}

TEST(Balance, TheLeastLoadedNeighbourThatTouchesIsGiven) {
  const std::vector<std::string> map = {"2000", "2000", "1000", "1000", "4333"};
  EXPECT_EQ(Field(map, 1).knows(1, 3).knows(2, 4).ask()->taker, 1u);
  EXPECT_EQ(Field(map, 1).knows(2, 3).knows(1, 4).ask()->taker, 2u);
  EXPECT_EQ(Field(map, 1).knows(2, 3).knows(1, 3).ask()->taker, 1u);             // the lower one
  EXPECT_EQ(Field(map, 1).knows(4, 0).knows(1, 3).ask()->taker, 1u);             // 4 touches by a corner only
  EXPECT_EQ(Field(map, 1).knows(1, std::nan("")).knows(2, 3).ask()->taker, 2u);  // says nothing sensible
  EXPECT_EQ(Field(map, 1).knows(1, -1).knows(2, 3).ask()->taker, 2u);
  EXPECT_FALSE(Field(map, 1).ask());  // nobody has reported yet
}

TEST(Balance, BelongsToTheFutureNotThePresent) {
  Field f({"00001111", "00001111"}, 1);
  f.neighbours = {{1, {1 * kMs, 8 * kMs}}};  // little to do now, but not for long
  EXPECT_FALSE(f.ask());
  f.neighbours = {{1, {8 * kMs, 1 * kMs}}};
  EXPECT_TRUE(f.ask());
}

TEST(Balance, IsLazyWhileAnticipationLasts) {
  Field f({"00001111", "00001111"}, 1);  // 8 ms
  f.knows(1, 0);
  f.budget = 10 * kMs;
  EXPECT_FALSE(f.ask());  // keeps up
  f.budget = 6 * kMs;     // 48 steps last for 192
  EXPECT_FALSE(f.ask());
  f.ahead = 20;  // for 80 only
  EXPECT_TRUE(f.ask());
  f.ahead = 48;
  f.budget = 3 * kMs;  // for 77
  EXPECT_TRUE(f.ask());
  f.budget = 10 * kMs;
  f.load.on_time = 50;  // as it is now, though it will be better
  EXPECT_TRUE(f.ask());
}

TEST(Balance, OneHeavyCellIsLeftAlone) {
  Field f({"00001111", "00001111"});
  f.knows(1, 1);
  f.cost[1] = 20 * kMs;  // cannot be split, and would only change places
  EXPECT_FALSE(f.ask());
  Settings settings;
  settings.max_cells = 2;  // nor are empty cells given to get at it
  Policy policy(settings);
  EXPECT_FALSE(f.ask(policy));
  for (const std::size_t c : {0, 2, 3, 8, 9, 10, 11}) f.cost[c] = 1 * kMs;
  const auto p = f.ask();  // but not the rest beside it
  ASSERT_TRUE(p);
  EXPECT_EQ(std::count(p->cells.begin(), p->cells.end(), 1), 0);
  EXPECT_GE(p->cost, 4 * kMs);
  f.apply(*p);
  EXPECT_TRUE(connected(f.grid, f.owner, 0) && connected(f.grid, f.owner, 1)) << f.text();
}

TEST(Balance, NeverGivesAll) {
  EXPECT_FALSE(Field({"01"}, 5).knows(1, 0).ask());
  Field f({"001"}, 0);
  f.cost = {0, 5 * kMs, 0};
  EXPECT_FALSE(f.knows(1, 0).ask());
  f.cost = {5 * kMs, 0.5 * kMs, 0};
  EXPECT_EQ(f.ask()->cells, std::vector<std::uint32_t>{1});
  f.cost = {1 * kMs, 1 * kMs, 0};
  f.coming = 20;
  EXPECT_EQ(f.ask()->cells, std::vector<std::uint32_t>{1});
}

TEST(Balance, NoLoadIsNoReason) {
  EXPECT_FALSE(Field({"00001111"}, 0).knows(1, 0).ask());
  EXPECT_FALSE(Field({"00001111"}, 1e-4).knows(1, 0).ask());  // 0.4 us
}

TEST(Balance, ACrowdIsReachedThroughEmptyCells) {
  Field f(std::vector<std::string>(12, "000000000011"));
  f.knows(1, 0);
  for (const std::size_t c : {50, 51, 62, 63, 74, 75, 86, 87}) f.cost[c] = 2 * kMs;
  const auto p = f.ask();
  ASSERT_TRUE(p);
  EXPECT_GE(p->cost, 4 * kMs);
  EXPECT_LE(p->cost, 8 * kMs);
  f.apply(*p);
  EXPECT_TRUE(connected(f.grid, f.owner, 0) && connected(f.grid, f.owner, 1)) << f.text();
}

TEST(Balance, ARingAndAStripCanGive) {
  Field ring({"00000", "01110", "01110", "01110", "00000"}, 1);
  const auto p = ring.knows(1, 2).ask();
  ASSERT_TRUE(p);
  ring.apply(*p);
  EXPECT_TRUE(connected(ring.grid, ring.owner, 0) && connected(ring.grid, ring.owner, 1)) << ring.text();
  Field strip({"2000000000", "2222111222"}, 1);  // touched in its middle: what would be cut off goes along
  const auto q = strip.knows(1, 0).ask();
  ASSERT_TRUE(q);
  EXPECT_GE(q->cost, 3 * kMs);
  EXPECT_LE(q->cost, 4.5 * kMs);
  strip.apply(*q);
  EXPECT_TRUE(connected(strip.grid, strip.owner, 0) && connected(strip.grid, strip.owner, 1)) << strip.text();
}

TEST(Balance, AtMostSoManyCellsAtOnce) {
  Field f(std::vector<std::string>(10, "0000000011"), 1);
  f.knows(1, 0);
  Settings settings;
  settings.max_cells = 7;
  Policy policy(settings);
  EXPECT_LE(f.ask(policy)->cells.size(), 7u);
  EXPECT_GT(f.ask()->cells.size(), 7u);
}

TEST(Balance, ManySmallStepsReachAFarCrowd) {
  Field f(std::vector<std::string>(12, "000000000000000000000011"));
  for (const std::size_t c : {98, 99, 122, 123, 146, 147, 170, 171}) f.cost[c] = 2 * kMs;
  f.knows(1, 0);
  Settings settings;
  settings.max_cells = 20;
  Policy policy(settings);
  int steps = 0;
  while (const auto p = f.ask(policy)) {
    ASSERT_LT(++steps, 20);
    policy.answered(f.now, *p, true);
    f.now += Settings().unreported;  // so that the report below is a newer one
    f.apply(*p);
    f.neighbours[0].load.expected += p->cost;
    ASSERT_TRUE(connected(f.grid, f.owner, 0) && connected(f.grid, f.owner, 1)) << f.text();
  }
  EXPECT_GE(f.neighbours[0].load.expected, 6 * kMs) << f.text();
}

TEST(Balance, WhoAcceptedCellsThatCostNothingHasNotRefused) {
  Field f({"0000000011"});
  f.cost[0] = f.cost[1] = 5 * kMs;
  f.knows(1, 0);
  Settings settings;
  settings.max_cells = 2;
  Policy policy(settings);
  const auto p = f.ask(policy);
  ASSERT_TRUE(p);
  EXPECT_EQ(p->cost, 0);
  policy.answered(f.now, *p, true);
  f.apply(*p);
  EXPECT_TRUE(f.ask(policy));
}

TEST(Balance, WhoRefusedIsNotAskedAgainSoon) {
  Field f({"2000", "2000", "1000", "1000"}, 1);
  f.knows(1, 1).knows(2, 2);
  Policy policy;
  const Proposal first = *f.ask(policy);
  EXPECT_EQ(first.taker, 1u);
  policy.answered(f.now, first, false);
  EXPECT_EQ(f.ask(policy)->taker, 2u);
  f.now += Settings().refused;
  EXPECT_EQ(f.ask(policy)->taker, 1u);
}

TEST(Balance, WhatWasAcceptedCountsBeforeItIsReported) {
  Field f({"2000", "2000", "1000", "1000"}, 1);
  f.knows(1, 1).knows(2, 2);
  Policy policy;
  const Proposal first = *f.ask(policy);
  policy.answered(f.now, first, true);
  f.apply(first);
  EXPECT_EQ(f.ask(policy)->taker, 2u);  // 1 still says that it has least
  EXPECT_EQ(f.ask()->taker, 1u);        // as who has not asked it would believe
}

TEST(Balance, CellsDoNotGoBackSoon) {
  Field f({"2001", "2001"}, 1);
  f.knows(1, 0);
  Policy policy;
  const std::vector<std::uint32_t> taken{1, 2, 5, 6};  // all, from 1
  policy.took(f.now, 1, taken);
  EXPECT_FALSE(f.ask(policy));
  f.knows(2, 0);
  EXPECT_EQ(f.ask(policy)->taker, 2u);  // but on to others
  f.now += Settings().keep;
  EXPECT_EQ(f.ask(policy)->taker, 1u);
}

TEST(Balance, TheSameQuestionsHaveTheSameAnswers) {
  const std::vector<std::string> map(16, "2220000000000111");
  const auto run = [&](bool turned) {
    Field f(map);
    for (std::size_t c = 0; c < f.cost.size(); ++c)
      if (f.owner[c] == 0) f.cost[c] = static_cast<double>(c * 7919 % 13) * kMs;
    f.knows(1, 10).knows(2, 10);
    if (turned) std::swap(f.neighbours[0], f.neighbours[1]);
    Policy policy;
    for (int i = 0; i < 6; ++i)
      if (const auto p = f.ask(policy)) {
        f.apply(*p);
        for (Neighbour& n : f.neighbours)
          if (n.world == p->taker) n.load.expected += p->cost;
      }
    return f.text();
  };
  EXPECT_EQ(run(false), run(false));
  EXPECT_EQ(run(false), run(true));
}

TEST(Balance, TheAskedWorldTakesWhatItHasRoomFor) {
  Field f({"00001111", "00001111"});
  const std::vector<std::uint32_t> near{3, 11}, far{0, 8};
  const Load idle{1 * kMs, 1 * kMs}, busy{7 * kMs, 7 * kMs}, giver{8 * kMs, 8 * kMs};
  EXPECT_TRUE(may_take(f.grid, f.owner, 1, near, 3 * kMs, idle, giver));
  EXPECT_FALSE(may_take(f.grid, f.owner, 1, near, 5 * kMs, idle, giver));  // would have more than the giver
  EXPECT_FALSE(may_take(f.grid, f.owner, 1, near, 3 * kMs, busy, giver));
  EXPECT_FALSE(may_take(f.grid, f.owner, 1, far, 3 * kMs, idle, giver));  // in pieces
  EXPECT_FALSE(may_take(f.grid, f.owner, 1, {}, 0, idle, giver));
  EXPECT_FALSE(may_take(f.grid, f.owner, 1, near, std::nan(""), idle, giver));
}

}  // namespace
}  // namespace soda::balance::test
