// Load balancing over time: crowds that walk and stand, with loads, reports and transfers as late as between daemons.
// Every transfer is checked: all territories stay in one piece, nobody gives what it has not, nobody is left without a
// cell.
#include "balance_crowd.h"

#include <gtest/gtest.h>

namespace soda::balance::test {
namespace {

constexpr std::size_t kCrowd = 4000;  // bodies
constexpr Step kSecond = 60;
constexpr double kWalk = 30;  // s
constexpr std::array<std::int32_t, 3> kFlat{24, 24, 1}, kTall{16, 16, 4};

// From corner to corner; the crowd's radius is 5/24 of the grid's width. Territories by bisection where it stands at
// first.
CrowdOptions corner_to_corner(const std::array<std::int32_t, 3>& size, WorldId worlds) {
  CrowdOptions o;
  o.grid.size = size;
  o.worlds = worlds;
  o.bodies = kCrowd + o.grid.cells();
  const double width = size[0];
  o.walk = walking_crowd(o.grid, kCrowd, width * 4 / 24, width * 5 / 24, kWalk);
  o.owner = bisected(o);
  return o;
}

// The crowd when it has walked half its way, and stands.
CrowdOptions standing_in_the_middle(const std::array<std::int32_t, 3>& size, WorldId worlds) {
  CrowdOptions o = corner_to_corner(size, worlds);
  o.walk = [walk = o.walk](std::size_t body, double) { return walk(body, kWalk / 2); };
  return o;
}

struct Walked {
  double worst, mean;  // of the slowest world's load over the mean load
};

// The first reports are there after a quarter of a second, what is given then has taken effect after a whole one; then
// a second of adapting. Measured until the crowd is there.
Walked walk(CrowdSession& session) {
  session.run(kSecond * 9 / 4);
  session.forget();
  session.run(static_cast<Step>(kWalk * kSecond) - session.now());
  EXPECT_EQ(session.fault(), "");
  return {session.worst(), session.mean_ratio()};
}

struct Case {
  std::array<std::int32_t, 3> size;
  WorldId worlds;
  Step in_flight;
  double worst, mean, unbalanced;  // limits: at most, at most, at least
};
void PrintTo(const Case& c, std::ostream* out) {
  *out << c.size[0] << "x" << c.size[1] << "x" << c.size[2] << " " << c.worlds << " worlds, in flight " << c.in_flight;
}

class Crowd : public testing::TestWithParam<Case> {};

TEST_P(Crowd, WalksFromCornerToCorner) {
  const Case& c = GetParam();
  CrowdOptions o = corner_to_corner(c.size, c.worlds);
  o.in_flight = c.in_flight;
  // What is decided now holds from a second on, until what is decided next does.
  o.horizon = 1 + 0.5 * static_cast<double>(std::max<Step>(c.in_flight, kSecond / 4)) / kSecond;
  CrowdSession session(o);
  const Walked walked = walk(session);
  EXPECT_LT(walked.worst, c.worst);
  EXPECT_LT(walked.mean, c.mean);
  RecordProperty("worst", std::to_string(walked.worst));
  RecordProperty("mean", std::to_string(walked.mean));
  o.balancing = false;
  CrowdSession left_alone(o);
  EXPECT_GT(walk(left_alone).mean, c.unbalanced);
  EXPECT_EQ(left_alone.transfers(), 0u);
  // When the crowd has arrived, transfers die out.
  session.run(5 * kSecond);
  const std::size_t transfers = session.transfers();
  session.run(20 * kSecond);
  EXPECT_EQ(session.transfers(), transfers);
  EXPECT_EQ(session.fault(), "");
}

INSTANTIATE_TEST_SUITE_P(Agreed, Crowd,
                         testing::Values(Case{kFlat, 4, 15, 1.25, 1.1, 3}, Case{kTall, 4, 15, 1.25, 1.1, 3},
                                         Case{kFlat, 9, 15, 1.4, 1.2, 6}, Case{kTall, 9, 15, 1.4, 1.2, 6},
                                         Case{kFlat, 16, 15, 1.75, 1.4, 9}, Case{kTall, 16, 15, 1.75, 1.4, 7}));
INSTANTIATE_TEST_SUITE_P(OneByOne, Crowd,
                         testing::Values(Case{kFlat, 4, 60, 1.5, 1.15, 3}, Case{kTall, 4, 60, 1.5, 1.15, 3},
                                         Case{kFlat, 9, 60, 1.8, 1.35, 6}, Case{kFlat, 16, 60, 2.2, 1.6, 9}));

TEST(Balancing, KeepsTerritoriesCompact) {
  CrowdOptions o = corner_to_corner(kFlat, 4);
  o.in_flight = 15;
  o.horizon = 1.125;
  CrowdSession session(o);
  double faces = 0;
  for (int second = 0; second < 30; ++second) {
    session.run(kSecond);
    faces += static_cast<double>(session.border_faces()) / 30;
  }
  EXPECT_LT(faces, 150);  // two straight cuts through all are 48; cells dealt out at random have 828
  EXPECT_LT(session.cells_moved(), 10 * o.grid.cells());
  EXPECT_EQ(session.fault(), "");
}

// The lightest world and the one with all the load are five apart.
TEST(Balancing, CarriesLoadAlongAChain) {
  CrowdOptions o;
  o.grid.size = {36, 6, 1};
  o.worlds = 6;
  for (std::size_t c = 0; c < o.grid.cells(); ++c) o.owner.push_back(static_cast<WorldId>(cell_at(o.grid, c)[0] / 6));
  o.bodies = 3000;
  o.walk = [](std::size_t b, double) -> Vec3 {
    return {6 * std::fmod(0.6180339887 * static_cast<double>(b), 1),
            6 * std::fmod(0.7548776662 * static_cast<double>(b), 1), 0};
  };
  CrowdSession session(o);
  session.run(1);
  EXPECT_DOUBLE_EQ(session.slowest_over_mean(), 6);
  session.run(60 * kSecond);
  EXPECT_LT(session.slowest_over_mean(), 1.5);
  EXPECT_GT(*std::min_element(session.loads().begin(), session.loads().end()), 0);
  EXPECT_EQ(session.fault(), "");
}

TEST(Balancing, DiesOutWhereNothingMoves) {
  for (const double noise : {0.0, 0.05})
    for (const WorldId worlds : {4u, 9u}) {
      CrowdOptions o = standing_in_the_middle(kFlat, worlds);
      const auto side = static_cast<std::int32_t>(worlds == 4 ? 2 : 3);
      for (std::size_t c = 0; c < o.owner.size(); ++c) {
        const Cell cell = cell_at(o.grid, c);
        o.owner[c] = static_cast<WorldId>(cell[1] * side / 24 * side + cell[0] * side / 24);
      }
      o.noise = noise;
      CrowdSession session(o);
      session.run(20 * kSecond);
      const std::size_t transfers = session.transfers();
      EXPECT_LE(transfers, 12u * worlds) << noise;
      session.run(60 * kSecond);
      EXPECT_LE(session.transfers(), transfers + (noise > 0 ? 3u : 0u)) << worlds;
      EXPECT_LT(session.slowest_over_mean(), 1.25) << worlds;
      EXPECT_EQ(session.fault(), "");
    }
}

TEST(Balancing, DoesNothingWhileWorldsKeepUp) {
  CrowdOptions o = corner_to_corner(kFlat, 4);
  o.budget = 1.05 * o.cost * static_cast<double>(o.bodies);  // one world could do it all
  CrowdSession session(o);
  session.run(40 * kSecond);
  EXPECT_EQ(session.transfers(), 0u);
  EXPECT_EQ(session.late(), 0);
}

// Paced, at a rate that the four can hold together with a third to spare: how much later than in real time is the end?
TEST(Balancing, KeepsAPacedSessionOnTime) {
  CrowdOptions o = corner_to_corner(kFlat, 4);
  o.in_flight = 15;
  o.budget = 1.5 * o.cost * static_cast<double>(o.bodies) / 4;
  CrowdSession session(o);
  session.run(static_cast<Step>(kWalk) * kSecond);
  EXPECT_LT(session.late(), 0.5);
  EXPECT_GT(session.transfers(), 0u);
  EXPECT_EQ(session.fault(), "");
  // Not more often than where every world is as fast as it can be.
  CrowdOptions hasty = o;
  hasty.budget = 0;
  CrowdSession unpaced(hasty);
  unpaced.run(static_cast<Step>(kWalk) * kSecond);
  EXPECT_LT(session.transfers(), unpaced.transfers());
  o.balancing = false;
  CrowdSession left_alone(o);
  left_alone.run(static_cast<Step>(kWalk) * kSecond);
  EXPECT_GT(left_alone.late(), 10);
}

TEST(Balancing, SeesWhereTheCrowdIsHeading) {
  CrowdOptions o = corner_to_corner(kFlat, 4);
  o.in_flight = 15;
  o.horizon = 1.125;
  CrowdSession foresighted(o);
  o.foresight = false;
  CrowdSession blind(o);
  EXPECT_LT(walk(foresighted).mean + 0.05, walk(blind).mean);
}

}  // namespace
}  // namespace soda::balance::test
