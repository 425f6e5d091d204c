// The command line: exit codes, messages, files.
#include <gtest/gtest.h>

#include <fstream>

#include "tests/distributed/session.h"

namespace soda::test {
namespace {

class Command : public SessionTest {
 protected:
  void expect_bad(const std::vector<std::string>& arguments, const std::string& message) const {
    const std::string output = run(arguments, 2, 30s);
    EXPECT_NE(output.find(message), std::string::npos) << output;
  }
};

TEST_F(Command, BadInputIsExitCodeTwoWithAReason) {
  const std::string good = scene("cubes", 100);
  std::ofstream(path("bad.txtpb")) << "bodies { id: 1 shape { sphere { radius: -1 } } }\n";
  expect_bad({"run", path("bad.txtpb")}, "bad.txtpb");
  expect_bad({"run", path("nowhere.scene")}, "nowhere.scene");
  expect_bad({"run", good, "--pace", "sometimes"}, "a pace is 'realtime', 'max' or a multiple");
  expect_bad({"run", good, "--worlds", "0"}, "--worlds");
  expect_bad({"run", good, "--worlds", "4000"}, "cells");
  expect_bad({"run", good, "--steps", "-1"}, "--steps");
  expect_bad({"run", good, "--session", "a*b"}, "--session");
  expect_bad({"run", good, "--hash-log", path("no/such/directory/x.log")}, "cannot be written");
  expect_bad({"run", good, "--dump", path("x.dump"), "--steps", "10", "--dump-steps", "5:11"}, "beyond the last step");
  expect_bad({"run", good, "--interface", "lo"}, "--interface");
  expect_bad({"run"}, "scene");
  expect_bad({"run", good, "--no-such-option"}, "--no-such-option");
  expect_bad({}, "subcommand is required: run, watch, ");
  expect_bad({"act", "jump", "3"}, "push, velocity, pose, grab, move, release, spawn, remove; not 'jump'");
}

TEST_F(Command, WorldDaemonsComplainToo) {
  const auto expect_bad_world = [this](const std::vector<std::string>& arguments, const std::string& message) {
    Program world(soda_world(arguments), directory());
    expect_exit(world, 2, 30s);
    EXPECT_NE(world.output().find(message), std::string::npos) << world.output();
  };
  expect_bad_world({"--world", "0"}, "--scene");
  expect_bad_world({"--world", "1", "--scene", "x.scene"}, "only world 0 has one");
  expect_bad_world({"--world", "0", "--scene", path("nowhere.scene")}, "nowhere.scene");
  expect_bad_world({"--world", "0", "--scene", scene("cubes", 10), "--worlds", "4000"}, "cells");
  Program help(soda_world({"--help"}), directory());
  expect_exit(help, 0, 30s);
  EXPECT_NE(help.output().find("Starting a session by hand"), std::string::npos);
}

TEST_F(Command, RealTimeTakesItsTime) {
  const auto began = std::chrono::steady_clock::now();
  run({"run", scene("cubes", 50), "--worlds", "2", "--steps", "150", "-q", "--stats", path("stats")});
  const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  // 150 steps are 2.5 s; worlds may be 48 steps ahead of what is displayed.
  EXPECT_GT(took, (150 - 48) / 60.0);
  EXPECT_GT(stat(path("stats"), "wall_seconds", ""), (150 - 48) / 60.0 * 0.9);
  EXPECT_GT(stat(path("stats"), "paced_seconds"), 0.5);
}

TEST_F(Command, NoStepsAtAllIsARunToo) {
  run({"run", scene("cubes", 50), "--sync", "single", "--steps", "0", "--hash-log", path("a")});
  run({"run", scene("cubes", 50), "--worlds", "2", "--steps", "0", "--hash-log", path("b")});
  EXPECT_EQ(lines_of(path("a")).size(), 1u);
  expect_equal_logs(path("a"), path("b"));
}

TEST_F(Command, ExplainTellsHowASceneWasModelled) {
  const std::string towers = scene("towers", 200);
  for (const char* worlds : {"1", "3"}) {
    const std::string output =
        run({"run", towers, "--worlds", worlds, "--steps", "25", "--pace", "max", "--explain", "-q"});
    const auto at = output.find("solved in 4 sub-steps");
    ASSERT_NE(at, std::string::npos) << output;
    // Twenty towers of ten, before they fall asleep; on several worlds some are solved by two of them, or twice.
    double islands = 0, bodies = 0, contacts = 0, micro = 0;
    ASSERT_EQ(
        std::sscanf(output.c_str() + at, "solved in 4 sub-steps %lf %lf %lf %lf", &islands, &bodies, &contacts, &micro),
        4)
        << output;
    EXPECT_GT(islands, 19);
    EXPECT_LT(islands, 120);
    EXPECT_NEAR(bodies, 10 * islands, 1);
    EXPECT_GT(micro, 1);
  }
  EXPECT_EQ(run({"run", towers, "--sync", "single", "--steps", "10", "--pace", "max"}).find("sub-steps"),
            std::string::npos);
  const std::string machines =
      run({"run", scene("machines", 60), "--sync", "single", "--steps", "25", "--pace", "max", "--explain", "-q"});
  EXPECT_NE(machines.find("joints solved as a whole"), std::string::npos) << machines;
}

TEST_F(Command, TerritoriesByHandChangeNoBit) {
  const std::string piles = scene("piles", 200);
  std::ofstream(path("hand.txtpb"))
      << "territory { world: 0 min { x: -1000 y: -1000 z: -1000 } max { y: 1000 z: 1000 } }\n"
         "territory { world: 1 min { y: -1000 z: -1000 } max { x: 1000 y: 1000 z: 1000 } }\n";
  const std::vector<std::string> common = {"--steps", "60", "--pace", "max", "-q"};
  const auto with = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), common.begin(), common.end());
    return arguments;
  };
  run(with({"run", piles, "--sync", "single", "--hash-log", path("one.log")}));
  run(with({"run", piles, "--worlds", "2", "--territories", path("hand.txtpb"), "--hash-log", path("two.log"),
            "--stats", path("stats"), "--record", path("run.rec")}));
  expect_equal_logs(path("one.log"), path("two.log"));
  run({"verify", path("run.rec"), "--worlds", "3"}, 0);
  expect_bad(with({"run", piles, "--worlds", "3", "--territories", path("hand.txtpb")}), "given to 2 worlds");
  std::ofstream(path("bad.txtpb")) << "territory { world: 0 min { x: nan } max {} }\n";
  expect_bad(with({"run", piles, "--worlds", "1", "--territories", path("bad.txtpb")}), "territory[0].min.x");
}

// One world has nearly everything at the start: cells change hands while the session runs, or not, and no bit changes.
TEST_F(Command, BalancingChangesNoBit) {
  const std::string city = scene("city", 1000);
  std::ofstream(path("hand.txtpb"))
      << "territory { world: 1 min { x: 8 y: 8 z: -1000 } max { x: 1000 y: 1000 z: 1000 } }\n"
         "territory { world: 2 min { x: 8 y: -1000 z: -1000 } max { x: 1000 y: 8 z: 1000 } }\n"
         "territory { world: 0 min { x: -1000 y: -1000 z: -1000 } max { x: 8 y: 1000 z: 1000 } }\n";
  const std::vector<std::string> common = {"--steps", "400", "-q"};
  const auto with = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), common.begin(), common.end());
    return arguments;
  };
  run(with({"run", city, "--sync", "single", "--pace", "max", "--hash-log", path("one.log")}));
  struct Way {
    const char *balance, *sync, *pace;
  };
  for (const Way& way : {Way{"off", "anticipative", "max"}, Way{"on", "anticipative", "max"},
                         Way{"on", "conservative", "max"}, Way{"on", "anticipative", "3"}}) {
    const std::string name = std::string(way.balance) + way.sync + way.pace;
    SCOPED_TRACE(name);
    run(with({"run", city, "--worlds", "3", "--territories", path("hand.txtpb"), "--balance", way.balance, "--sync",
              way.sync, "--pace", way.pace, "--hash-log", path(name + ".log"), "--stats", path(name)}));
    expect_equal_logs(path("one.log"), path(name + ".log"));
    const double transfers = stat(path(name), "transfers");
    std::printf("%s: %g transfers of %g cells\n", name.c_str(), transfers, stat(path(name), "cells_given"));
    if (std::string(way.balance) == "off") {
      EXPECT_EQ(transfers, 0);
    } else if (std::string(way.pace) == "max") {
      EXPECT_GT(transfers, 2);
    }
  }
  expect_bad({"run", city, "--balance", "maybe"}, "--balance");
}

TEST_F(Command, DiffNamesTheFirstStepThatDiffers) {
  const std::string file = scene("cubes", 50);
  run({"run", file, "--sync", "single", "--steps", "20", "--pace", "max", "--hash-log", path("a.log")});
  const auto lines = lines_of(path("a.log"));
  std::ofstream other(path("b.log")), shorter(path("c.log")), broken(path("d.log"));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    other << (i == 13 ? "13 50 0000000000000000" : lines[i]) << '\n';
    if (i < 7) shorter << lines[i] << '\n';
    if (i != 5) broken << lines[i] << '\n';
  }
  other.close(), shorter.close(), broken.close();
  EXPECT_NE(run({"diff", path("a.log"), path("a.log")}, 0).find("equal: 21 steps"), std::string::npos);
  EXPECT_NE(run({"diff", path("a.log"), path("b.log")}, 1).find("step 13 is the first to differ"), std::string::npos);
  EXPECT_NE(run({"diff", path("a.log"), path("c.log")}, 1).find("equal up to step 6"), std::string::npos);
  EXPECT_NE(run({"diff", path("a.log"), path("d.log")}, 2).find("step 6 does not follow step 4"), std::string::npos);
  EXPECT_NE(run({"diff", path("a.log"), path("nowhere")}, 2).find("nowhere"), std::string::npos);
}

TEST_F(Command, DiffNamesTheFirstBodyAndFieldThatDiffer) {
  const auto dump = [&](const std::string& scene_file, const std::string& to, const std::string& steps) {
    run({"run", scene_file, "--sync", "single", "--steps", "20", "--pace", "max", "--dump", to, "--dump-steps", steps});
  };
  const std::string file = scene("cubes", 50);
  dump(file, path("a.dump"), "10:20");
  dump(file, path("b.dump"), "5:15");
  EXPECT_NE(run({"diff", path("a.dump"), path("b.dump")}, 0).find("equal: 6 steps"), std::string::npos);
  EXPECT_NE(run({"diff", path("a.dump"), file}, 2).find("one is a dump"), std::string::npos);

  // One bit of one position, and the checksum that guards it, as a faulty machine would have written them: the mantissa
  // of body 1's x lies behind the file's header, the step's header and the body's id.
  std::string bytes = read_text(path("a.dump"));
  bytes[48 + 32 + 8] ^= 1;
  std::ofstream(path("c.dump"), std::ios::binary) << bytes;
  EXPECT_NE(run({"diff", path("a.dump"), path("c.dump")}, 2).find("is damaged at step 10"), std::string::npos);
}

}  // namespace
}  // namespace soda::test
