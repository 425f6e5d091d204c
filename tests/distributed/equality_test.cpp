// The invariant, over real processes and DDS: a run on any number of worlds has the hashes of the run on one, at every
// step. The reference is `--sync single`: one process, no network.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "tests/distributed/session.h"

namespace soda::test {
namespace {

struct Case {
  const char* scene;     // a generator, or an SDF file of scenes/
  std::uint32_t bodies;  // to generate
  std::vector<int> worlds;
  // From this number of worlds on, islands of several worlds must occur, and bodies must cross borders: a run in which
  // nothing happened at borders proves nothing.
  int mixes_from = 2, crosses_from = 2;
  // m; territories avoid cutting through bodies where cells let them, and this does not.
  double cell = 0;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.scene; }

std::string name_of(const ::testing::TestParamInfo<Case>& info) {
  std::string name = info.param.scene;
  return name.substr(0, name.find('.'));
}

class Equality : public SessionTest, public ::testing::WithParamInterface<Case> {};

constexpr int kSteps = 600;

enum class When {
  kAlways,
  kMostWorlds,
  kAll
};  // the last: in the whole matrix only, with the largest number of worlds
struct Way {
  const char* name;
  std::vector<std::string> arguments;
  bool anticipates, acts;
  When when;
};
const Way kWays[] = {{"", {"--pace", "max"}, true, false, When::kAlways},
                     {"-short", {"--pace", "max", "--anticipation", "4"}, true, false, When::kAll},
                     {"-conservative", {"--pace", "max", "--sync", "conservative"}, false, false, When::kMostWorlds},
                     {"-acted", {"--pace", "max"}, true, true, When::kAlways},
                     {"-acted-rate", {"--pace", "3"}, true, true, When::kMostWorlds},
                     {"-acted-realtime", {"--pace", "realtime"}, true, true, When::kAll},
                     {"-acted-conservative", {"--pace", "max", "--sync", "conservative"}, false, true, When::kAll}};

TEST_P(Equality, AnyNumberOfWorldsGivesTheHashesOfOne) {
  const Case& c = GetParam();
  const bool is_file = std::string(c.scene).find('.') != std::string::npos;
  const std::string file = is_file ? path("converted.scene") : scene(c.scene, c.bodies, c.cell);
  if (is_file) run({"scene", "convert", std::string(SODA_SCENES) + "/" + c.scene, file});
  const std::string steps = std::to_string(kSteps);
  run({"run", file, "--sync", "single", "--steps", steps, "--pace", "max", "-q", "--hash-log", path("single.log"),
       "--dump", path("single.dump")},
      0, 900s);
  const auto reference = lines_of(path("single.log"));
  ASSERT_EQ(reference.size(), kSteps + 1u);
  // "STEP BODIES HASH": the number of bodies stays, and the hashes say that something moves.
  std::istringstream first(reference.front()), last(reference.back());
  std::string step, bodies_first, bodies_last, hash_first, hash_last;
  first >> step >> bodies_first >> hash_first;
  last >> step >> bodies_last >> hash_last;
  EXPECT_EQ(bodies_first, bodies_last);
  EXPECT_NE(hash_first, hash_last);

  // The same with things done to bodies: all of it known from the start, so that it is the same run.
  const std::string acts = actions(file, kSteps, 30, 1);
  run({"run", file, "--sync", "single", "--steps", steps, "--pace", "max", "-q", "--actions", acts, "--hash-log",
       path("acted.log"), "--dump", path("acted.dump")},
      0, 900s);
  EXPECT_NE(lines_of(path("acted.log")).back(), reference.back());
  const bool whole_matrix =
      std::string(::testing::UnitTest::GetInstance()->current_test_suite()->name()).starts_with("All");

  std::optional<double> most_anticipated;  // with more worlds than one
  for (const int worlds : c.worlds) {
    const bool most = worlds == c.worlds.back();
    for (const Way& way : kWays) {
      if (way.when != When::kAlways && !most) continue;
      if (way.when == When::kAll && !whole_matrix) continue;
      if (way.acts && way.when == When::kAlways && !most && !whole_matrix) continue;
      SCOPED_TRACE(std::to_string(worlds) + " worlds, " + way.name);
      const std::string n = std::to_string(worlds) + way.name;
      std::vector<std::string> arguments{"run",
                                         file,
                                         "--worlds",
                                         std::to_string(worlds),
                                         "--steps",
                                         steps,
                                         "-q",
                                         "--stats",
                                         path(n + ".json"),
                                         "--hash-log",
                                         path(n + ".log"),
                                         "--dump",
                                         path(n + ".dump")};
      arguments.insert(arguments.end(), way.arguments.begin(), way.arguments.end());
      if (way.acts) arguments.insert(arguments.end(), {"--actions", acts});
      run(arguments, 0, 900s);
      ASSERT_FALSE(HasFailure());
      const std::string single = way.acts ? "acted" : "single";
      expect_equal_logs(path(single + ".log"), path(n + ".log"));
      run({"diff", path(single + ".log"), path(n + ".log")});
      run({"diff", path(single + ".dump"), path(n + ".dump")});  // sleep counters and contact records, too
      EXPECT_EQ(stat(path(n + ".json"), "actions") > 10, way.acts);
      if (worlds >= c.mixes_from) {
        EXPECT_GT(stat(path(n + ".json"), "mixed_islands"), 0);
      }
      if (worlds >= c.crosses_from) {
        EXPECT_GT(stat(path(n + ".json"), "arrived"), 0);
      }
      // Worlds that keep pace need not; of several on few cores some lag.
      const double anticipated = stat(path(n + ".json"), "anticipated");
      if (!way.anticipates) {
        EXPECT_EQ(anticipated, 0);
      }
      if (worlds >= c.mixes_from && worlds > 1) most_anticipated = std::max(most_anticipated.value_or(0), anticipated);
      if (HasFailure()) return;
    }
  }
  if (most_anticipated) {
    EXPECT_GT(*most_anticipated, 0);
  }
}

constexpr int kNever = 1000;
// Piles are 2.3 m wide and stand 10 m apart, in a square whose middle is the grid's: with cells like these borders go
// through them.
constexpr double kThrough16Piles = 11, kThrough100Piles = 10.3;
// Towers stand 3 m apart.
constexpr double kThroughTowers = 6;

INSTANTIATE_TEST_SUITE_P(
    Sample, Equality,
    ::testing::Values(Case{"cubes", 1000, {1, 3, 8}}, Case{"piles", 432, {2, 4}, 2, 2, kThrough16Piles},
                      Case{"heap", 400, {3, 4}, 2, 4}, Case{"towers", 400, {4, 8}, 2, kNever, kThroughTowers},
                      Case{"city", 1000, {2, 4}}, Case{"dominoes", 600, {2, 8}}, Case{"cluster", 320, {8}},
                      Case{"machines", 240, {2, 4}}, Case{"nested.sdf", 0, {2, 3}, kNever, kNever}),
    name_of);

INSTANTIATE_TEST_SUITE_P(All, Equality,
                         ::testing::Values(Case{"cubes", 4000, {1, 2, 3, 4, 8}},
                                           Case{"piles", 2700, {1, 2, 3, 4, 8}, 2, 2, kThrough100Piles},
                                           Case{"heap", 1500, {1, 2, 3, 4, 8}},
                                           Case{"towers", 2000, {1, 2, 3, 4, 8}, 2, kNever, kThroughTowers},
                                           Case{"city", 4000, {1, 2, 3, 4, 8}}, Case{"dominoes", 2000, {1, 2, 3, 4, 8}},
                                           Case{"cluster", 800, {1, 2, 3, 4, 8}},
                                           Case{"machines", 960, {1, 2, 3, 4, 8}},
                                           Case{"nested.sdf", 0, {1, 2, 3, 4, 8}, kNever, kNever}),
                         name_of);

}  // namespace
}  // namespace soda::test
