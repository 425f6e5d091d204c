// `soda view` with pages that are no browsers: what they are shown is what the session computes, whatever they do.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <sstream>
#include <thread>

#include "common/dump.h"
#include "common/grid.h"
#include "common/recording/recording.h"
#include "tests/distributed/live_session.h"
#include "tests/support/page.h"

namespace soda::test {
namespace {

constexpr const char* kToken = "test-token-1";
constexpr const char* kActing = "/ws?token=test-token-1";
constexpr const char* kWatching = "/ws";

class Viewer : public LiveSession {
 protected:
  // Starts the gateway, of the session or as `what` says, with a page that is one file, at a port of its own.
  void serve(std::vector<std::string> what = {}) {
    std::filesystem::create_directories(directory() / "page");
    std::ofstream(directory() / "page/index.html") << "<p>the page</p>";
    std::vector<std::string> arguments = what.empty() ? std::vector<std::string>{"view", "--session", session} : what;
    arguments.insert(arguments.end(), {"--port", "0", "--token", kToken, "--page", path("page")});
    gateway_ = std::make_unique<Program>(soda(arguments), directory());
    ASSERT_TRUE(gateway_->wrote("http://localhost:", 20s)) << gateway_->output();
    const std::string said = gateway_->output();
    port = static_cast<std::uint16_t>(std::stoi(said.substr(said.find("http://localhost:") + 17)));
  }
  std::unique_ptr<Page> open(const char* target = kActing) const { return std::make_unique<Page>(port, target); }
  static bool shows(Page& page, std::size_t bodies) {
    return page.until([&] { return page.bodies.size() == bodies && page.frame.step() > 5; });
  }
  static view::Do push(std::uint64_t body, double up) {
    view::Do what;
    what.mutable_action()->mutable_push()->set_body(body);
    what.mutable_action()->mutable_push()->mutable_impulse()->set_z(up);
    return what;
  }
  Program& gateway() { return *gateway_; }
  std::uint16_t port = 0;

 private:
  std::unique_ptr<Program> gateway_;
};

TEST_F(Viewer, ShowsThePastAndTheFutureAndChangesNothing) {
  const std::string file = scene("city", 400);
  auto running = start(file, 3, 900);
  serve();
  auto page = open(kWatching), late = std::unique_ptr<Page>();
  ASSERT_TRUE(shows(*page, 400)) << page->bodies.size() << gateway().output();
  EXPECT_EQ(page->welcome.worlds(), 3u);
  EXPECT_FALSE(page->welcome.may_act());
  EXPECT_EQ(page->ids.size(), 400u);
  EXPECT_GT(page->welcome.meshes_size(), 1);
  EXPECT_EQ(page->welcome.statics_size(), 1) << "the ground";
  EXPECT_EQ(page->welcome.grid().owner().size(),
            2u * page->welcome.grid().size(0) * page->welcome.grid().size(1) * page->welcome.grid().size(2));
  std::map<int, int> of_world;
  int near = 0;
  for (const auto& [id, body] : page->bodies) {
    ++of_world[body.world];
    near += (body.flags & view::FLAG_NEAR) != 0;
  }
  EXPECT_EQ(of_world.size(), 3u) << "not all worlds are seen";
  EXPECT_GT(near, 0);

  page->look(+20);
  EXPECT_TRUE(page->until([&] { return page->frame.step() > page->clocks.final() + 5 && page->frame.anticipated(); }))
      << page->frame.step() << " with " << page->clocks.final() << " final";
  EXPECT_EQ(page->bodies.size(), 400u);
  page->look(-60);
  EXPECT_TRUE(page->until([&] {
    return page->clocks.displayed() > 100 && page->frame.step() < page->clocks.displayed() - 40 &&
           !page->frame.anticipated();
  })) << page->frame.step()
      << " at " << page->clocks.displayed();
  EXPECT_EQ(page->bodies.size(), 400u);
  // Who comes late sees all of it, too.
  late = open(kWatching);
  EXPECT_TRUE(shows(*late, 400));
  EXPECT_EQ(late->wholes, 1u);
  EXPECT_TRUE(
      page->until([&] { return page->worlds.world_size() == 3 && page->worlds.world(1).steps_per_second() > 0; }));
  EXPECT_EQ(page->worlds.world(1).state(), "running");

  ask({"speed", "max"});
  EXPECT_TRUE(page->until([&] { return !page->ended.empty(); }, 60s));
  EXPECT_EQ(page->ended, "the session has ended");
  EXPECT_FALSE(page->failed);
  expect_exit(*running, 0);
  run({"run", file, "--sync", "single", "--steps", "900", "--pace", "max", "--hash-log", path("single"), "-q"});
  expect_equal_logs(path("log"), path("single"));
  gateway().signal(SIGTERM);
  expect_exit(gateway(), 0, 10s);
}

// Bodies of the page's frame that are not where the territories of its step say: in a cell of another world than the
// one that produced them. Those that have just crossed a border are among them. `transfers`: with those that it knows.
int misplaced(const Page& page, bool transfers) {
  const view::Grid& told = page.welcome.grid();
  Grid grid;
  for (int axis = 0; axis < 3; ++axis) {
    grid.origin[axis] = told.origin(axis);
    grid.size[axis] = told.size(axis);
  }
  grid.edge = told.edge();
  std::vector<std::uint16_t> owner(grid.cells());
  std::memcpy(owner.data(), told.owner().data(), told.owner().size());
  std::vector<view::Transfer> done = transfers ? page.transfers : std::vector<view::Transfer>();
  std::sort(done.begin(), done.end(), [](const auto& l, const auto& r) { return l.step() < r.step(); });
  for (const view::Transfer& transfer : done)
    if (transfer.step() < page.frame.step())  // a body is produced by the world that owned it a step earlier
      for (const std::uint32_t cell : transfer.cell()) owner.at(cell) = static_cast<std::uint16_t>(transfer.taker());
  return static_cast<int>(std::count_if(page.bodies.begin(), page.bodies.end(), [&](const auto& entry) {
    const auto& [x, y, z] = entry.second.position;
    return owner[grid.index(grid.cell_of(Vec3(x, y, z)))] != entry.second.world;
  }));
}

// One world has nearly everything at the start, so that cells change hands.
TEST_F(Viewer, TerritoriesAreThoseOfTheStepThatIsShown) {
  std::ofstream(path("hand.txtpb"))
      << "territory { world: 1 min { x: 8 y: 8 z: -1000 } max { x: 1000 y: 1000 z: 1000 } }\n"
         "territory { world: 2 min { x: 8 y: -1000 z: -1000 } max { x: 1000 y: 8 z: 1000 } }\n"
         "territory { world: 0 min { x: -1000 y: -1000 z: -1000 } max { x: 8 y: 1000 z: 1000 } }\n";
  auto running = start(scene("city", 1000), 3, 100'000, {"--territories", path("hand.txtpb"), "--pace", "max"});
  serve();
  auto page = open(kWatching);
  const auto shown = [](Page& it) {
    return it.until([&] { return it.transfers.size() > 2 && misplaced(it, true) <= 20 && misplaced(it, false) > 100; });
  };
  const auto failure = [](const Page& it) {
    return std::to_string(it.transfers.size()) + " transfers, " + std::to_string(it.bodies.size()) + " bodies, " +
           std::to_string(misplaced(it, true)) + " misplaced, without transfers " +
           std::to_string(misplaced(it, false)) + " at step " + std::to_string(it.frame.step());
  };
  EXPECT_TRUE(shown(*page)) << failure(*page);
  for (const view::Transfer& transfer : page->transfers) {
    EXPECT_NE(transfer.giver(), transfer.taker());
    EXPECT_LT(std::max(transfer.giver(), transfer.taker()), 3u);
    EXPECT_GT(transfer.step(), 0);
    EXPECT_GT(transfer.cell_size(), 0);
  }
  // Who comes late is told what has changed hands before: the page, and the gateway, too.
  serve();
  auto late = open(kWatching);
  EXPECT_TRUE(shown(*late)) << failure(*late);
  EXPECT_GE(late->transfers.size(), page->transfers.size());
  running->signal(SIGINT);
  expect_exit(*running, 128 + SIGINT);
}

TEST_F(Viewer, OneMayActWithTheTokenOnly) {
  const std::string file = scene("city", 300);
  auto running = start(file, 3, 1200, {"--record", path("run.rec")});
  serve();
  EXPECT_TRUE(gateway().wrote(std::string("?token=") + kToken, 1s));
  for (const char* target : {kWatching, "/ws?token=", "/ws?token=test-token-2", "/ws?token=test-token-11"}) {
    auto watcher = open(target);
    ASSERT_TRUE(shows(*watcher, 300));
    EXPECT_FALSE(watcher->welcome.may_act()) << target;
    const auto number = watcher->act(push(7, 5000));
    ASSERT_TRUE(watcher->until([&] { return !watcher->answers.empty(); }));
    EXPECT_EQ(watcher->answers[0].number(), number);
    EXPECT_FALSE(watcher->answers[0].accepted());
    expect_says(watcher->answers[0].reason(), "may only watch");
  }
  auto page = open();
  ASSERT_TRUE(shows(*page, 300));
  EXPECT_TRUE(page->welcome.may_act());
  const auto lower = [](const auto& l, const auto& r) { return l.second.position[2] < r.second.position[2]; };
  const auto [top, body_before] = *std::max_element(page->bodies.begin(), page->bodies.end(), lower);
  const float before = body_before.position[2];
  page->act(push(top, 8 * page->mass[top]));  // 8 m/s
  ASSERT_TRUE(page->until([&] { return !page->answers.empty(); }));
  EXPECT_TRUE(page->answers[0].accepted()) << page->answers[0].reason();
  EXPECT_TRUE(page->until([&, id = top] { return page->bodies[id].position[2] > before + 0.5f; })) << "it does not fly";
  ASSERT_TRUE(page->until([&] { return !page->rollbacks.empty(); })) << "what it changed was not reported";
  EXPECT_GT(page->rollbacks[0].bodies(), 0u);
  EXPECT_GT(page->rollbacks[0].steps(), 0u);
  EXPECT_GT(page->redone, 0u) << "nothing was marked as done again";

  // A spawned body is listed, with its shape, and shown.
  view::Do spawn;
  auto& body = *spawn.mutable_action()->mutable_spawn()->mutable_body();
  body.add_shape()->mutable_sphere()->set_radius(0.4);
  body.mutable_pose()->mutable_position()->set_z(8);
  page->act(spawn);
  ASSERT_TRUE(page->until([&] { return page->answers.size() == 2; }));
  ASSERT_TRUE(page->answers[1].accepted()) << page->answers[1].reason();
  EXPECT_TRUE(page->until([&] { return page->bodies.contains(page->answers[1].body()); }));

  view::Do pause;
  pause.set_pause(true);
  page->act(pause);
  ASSERT_TRUE(page->until([&] { return page->answers.size() == 3 && page->clocks.paused(); }));
  const auto at = page->clocks.displayed();
  EXPECT_FALSE(page->until([&] { return page->clocks.displayed() > at; }, 500ms)) << "it goes on";
  view::Do step;
  step.set_steps(3);
  page->act(step);
  EXPECT_TRUE(page->until([&] { return page->clocks.displayed() == at + 3; }));
  view::Do speed;
  speed.set_speed(0);
  page->act(speed);
  view::Do resume;
  resume.set_resume(true);
  page->act(resume);
  EXPECT_TRUE(page->until([&] { return !page->ended.empty(); }, 60s));
  expect_exit(*running, 0);
  expect_says(run({"verify", path("run.rec"), "--sync", "single", "-q"}), "equal: 1201 steps");
}

TEST_F(Viewer, ASlowPageGetsFewerFrames) {
  auto running = start(scene("cubes", 60), 2, 100'000);
  serve();
  auto slow = open(), quick = open();
  slow->acknowledges = false;
  ASSERT_TRUE(quick->until([&] { return quick->frames > 200; }));
  slow->until([] { return false; }, 500ms);
  EXPECT_LE(slow->frames, 3u);
  EXPECT_TRUE(slow->clocks.displayed() > 0);
  const auto step = slow->frame.step();
  slow->acknowledges = true;
  view::FromPage shown;
  shown.mutable_shown()->set_number(slow->frame.number());
  slow->send(shown);
  EXPECT_TRUE(slow->until([&] { return slow->frame.step() > step + 100; })) << "it does not catch up";
  EXPECT_LT(slow->frames, 50u);
  running->signal(SIGINT);
  expect_exit(*running, 128 + SIGINT);
}

TEST_F(Viewer, NothingIsBelievedThatPagesSay) {
  auto running = start(scene("cubes", 60), 2, 100'000);
  serve();
  auto good = open();
  ASSERT_TRUE(shows(*good, 60));
  const auto expect_closed = [&](Page& page, const std::string& why) {
    page.until([] { return false; }, 5s);
    EXPECT_TRUE(page.closed) << why;
    expect_says(page.close_reason, why);
  };
  auto garbage = open();
  garbage->send_raw("\xff\xff\xff\xff not a message");
  expect_closed(*garbage, "not a message");
  auto text = open();
  text->send_raw("hello", false);
  expect_closed(*text, "not a message");
  auto large = open();
  large->send_raw(std::string(1 << 20, 'x'));
  expect_closed(*large, "");
  auto flood = open();
  for (int i = 0; i < 2000 && !flood->closed; ++i) flood->look(i);
  expect_closed(*flood, "too many messages");
  view::Do nonsense;
  nonsense.set_speed(std::numeric_limits<double>::quiet_NaN());
  const std::size_t before = good->answers.size();
  good->act(nonsense);
  good->act(view::Do());
  EXPECT_TRUE(good->until([&] { return good->answers.size() >= before + 2; }));
  expect_says(Page(port, kActing, "http://elsewhere.example").refusal(), "declined");
  EXPECT_EQ(Page(port, kActing, "http://127.0.0.1:" + std::to_string(port)).refusal(), "");
  EXPECT_EQ(get(port, "/").second, "<p>the page</p>");
  for (const char* target : {"/../../etc/passwd", "/nothing", "/ws", "//"})
    EXPECT_EQ(get(port, target).first, 404) << target;
  EXPECT_EQ(get(port, "/", "localhost:8080").first, 200);
  EXPECT_EQ(get(port, "/", "[::1]:8080").first, 200);
  for (const char* host : {"elsewhere.example", "127.0.0.1.elsewhere.example", "localhost.example:80"})
    EXPECT_EQ(get(port, "/", host).first, 403) << "a name that was made to lead here: " << host;
  good->look(std::numeric_limits<std::int64_t>::max());
  EXPECT_TRUE(good->until([&] { return good->frame.anticipated(); }));
  good->look(0);
  std::vector<std::unique_ptr<Page>> many;
  while (many.size() < 80 && (many.empty() || many.back()->refusal().empty())) many.push_back(open());
  EXPECT_EQ(many.size(), 64u) << "the good one is the 65th";
  EXPECT_FALSE(good->closed);
  EXPECT_TRUE(good->until([&] { return good->frame.step() > good->clocks.displayed() - 5; }))
      << "the good page suffers";
  running->signal(SIGINT);
  expect_exit(*running, 128 + SIGINT);
}

TEST_F(Viewer, MayBeThereBeforeTheSessionAndSeesAWorldDie) {
  serve();
  auto page = open();
  EXPECT_TRUE(page->until([&] { return page->clocks.gathering(); }));
  EXPECT_FALSE(page->welcomed);
  auto running = start(scene("city", 300), 3, 100'000);
  ASSERT_TRUE(shows(*page, 300));
  EXPECT_TRUE(page->until([&] { return page->worlds.world_size() == 3 && page->worlds.world(2).pid() > 0; }));
  ::kill(static_cast<pid_t>(page->worlds.world(2).pid()), SIGSTOP);
  EXPECT_TRUE(page->until([&] { return page->clocks.world_size() == 3 && page->clocks.world(2).silent(); }));
  EXPECT_FALSE(page->clocks.world(1).silent());
  const auto told = [&](const std::string& text) {  // others may be slow, too
    return page->until([&] {
      return std::any_of(page->events.begin(), page->events.end(),
                         [&](const std::string& event) { return event.find(text) != std::string::npos; });
    });
  };
  EXPECT_TRUE(told("world 2 has fallen silent"));
  ::kill(static_cast<pid_t>(page->worlds.world(2).pid()), SIGCONT);
  EXPECT_TRUE(told("world 2 is heard of again"));
  EXPECT_TRUE(page->until([&] { return page->clocks.newest() >= page->clocks.displayed(); }));
  ::kill(static_cast<pid_t>(page->worlds.world(2).pid()), SIGKILL);
  EXPECT_TRUE(page->until([&] { return !page->ended.empty(); }, 60s));
  EXPECT_TRUE(page->failed);
  expect_exit(*running, 1);
}

TEST_F(Viewer, ShowsTheNextSessionOfItsName) {
  serve();
  auto page = open();
  auto first = start(scene("cubes", 60), 2, 100'000);  // for as long as it takes to be found
  ASSERT_TRUE(page->until([&] { return page->bodies.size() == 60; }));
  page->look(-5);
  first->signal(SIGINT);
  ASSERT_TRUE(page->until([&] { return !page->ended.empty(); }, 60s));
  expect_exit(*first, 128 + SIGINT);
  auto second = start(scene("city", 300), 3, 100'000);
  ASSERT_TRUE(shows(*page, 300)) << page->bodies.size() << gateway().output();
  EXPECT_EQ(page->ended, "");
  EXPECT_EQ(page->welcome.worlds(), 3u);
  page->act(push(7, 10));
  EXPECT_TRUE(page->until([&] { return !page->answers.empty() && page->answers[0].accepted(); }));
  EXPECT_TRUE(page->until([&] { return page->frame.step() + 3 > page->clocks.displayed(); })) << "it looks at the past";
  second->signal(SIGINT);
  expect_exit(*second, 128 + SIGINT);
}

// A spring that nobody holds would pull for ever.
TEST_F(Viewer, APageThatGoesAwayLetsGo) {
  auto running = start(scene("city", 300), 2, 100'000, {"--record", path("run.rec")});
  serve();
  auto page = open(), watcher = open();
  ASSERT_TRUE(shows(*page, 300));
  for (const std::uint64_t body : {200, 201}) {
    view::Do grab;
    grab.mutable_action()->mutable_grab()->set_body(body);
    grab.mutable_action()->mutable_grab()->mutable_target()->set_z(3);
    page->act(grab);
  }
  // The first is answered, the second perhaps not yet.
  ASSERT_TRUE(page->until([&] { return !page->answers.empty(); }));
  ASSERT_TRUE(page->answers[0].accepted()) << page->answers[0].reason();
  page.reset();
  ASSERT_TRUE(shows(*watcher, 300));
  const auto then = watcher->clocks.displayed();
  ASSERT_TRUE(watcher->until([&] { return watcher->clocks.displayed() > then + 120; }));
  running->signal(SIGINT);
  expect_exit(*running, 128 + SIGINT);
  int grabbed = 0, released = 0;
  for (const LoggedAction& logged : load_recording(path("run.rec"), false).actions) {
    grabbed += std::holds_alternative<Grab>(logged.action);
    released += std::holds_alternative<Release>(logged.action);
  }
  EXPECT_EQ(grabbed, 2);
  EXPECT_EQ(released, 2);
}

// Cyclone DDS, with nothing of SODA but its IDL.
TEST_F(Viewer, AnotherVendorsDdsReadsTransforms) {
  const std::string file = scene("city", 300);
  Program subscriber({"/usr/bin/env", "CYCLONEDDS_URI=" SODA_CYCLONE_URI, SODA_CYCLONE, session, "2", "240", "100"},
                     directory());
  auto running = start(file, 2, 240);
  expect_exit(*running, 0);
  expect_exit(subscriber, 0, 30s);
  std::istringstream lines(subscriber.output());
  std::string line, last;
  int count = 0;
  for (; std::getline(lines, line); ++count) {
    last = line;
    EXPECT_NE(line.find(" 300 "), std::string::npos) << line;
  }
  EXPECT_GT(count, 50) << subscriber.output();
  run({"run", file, "--sync", "single", "--steps", "240", "--pace", "max", "--dump", path("dump"), "-q"});
  DumpReader dump(path("dump"));
  const auto state = dump.next();
  ASSERT_TRUE(state);
  double x = 0;
  for (const BodyState& body : state->state.bodies) x += body.position[0];
  std::istringstream words(last);
  Step said_step = 0;
  double said_bodies = 0, said_x = 0;
  words >> said_step >> said_bodies >> said_x;
  EXPECT_EQ(said_step, 240);
  EXPECT_NEAR(said_x, x, 0.0006);  // printed with three digits
}

TEST_F(Viewer, ReplaysARecordingWithoutAnyWorld) {
  const std::string file = scene("cubes", 60);
  const std::string acts = actions(file, 80, 12, 2);
  run({"run", file, "--sync", "single", "--steps", "120", "--pace", "max", "--actions", acts, "--record", path("a.rec"),
       "-q"});
  serve({"replay", path("a.rec")});
  auto page = open();
  ASSERT_TRUE(page->until([&] { return page->frames > 2; }));
  EXPECT_TRUE(page->welcome.replay());
  EXPECT_EQ(page->welcome.session(), "a.rec");
  EXPECT_GE(page->bodies.size(), 55u);
  view::Do seek;
  seek.set_seek(0);
  page->act(seek);
  view::Do pause;
  pause.set_pause(true);
  page->act(pause);
  ASSERT_TRUE(page->until([&] { return page->answers.size() == 2 && page->clocks.paused(); }));
  EXPECT_TRUE(page->until([&] { return page->frame.step() < 20 && page->bodies.size() == 60; })) << page->bodies.size();
  seek.set_seek(120);
  page->act(seek);
  EXPECT_TRUE(page->until([&] { return page->frame.step() == 120; }));
  page->act(push(1, 5));
  ASSERT_TRUE(page->until([&] { return page->answers.size() == 4; }));
  EXPECT_FALSE(page->answers[3].accepted());
  expect_says(run({"replay", file, "--page", path("page")}, 2), "not a recording");
}

TEST_F(Viewer, StatusTellsTheSameInTheTerminal) {
  expect_says(run({"status", "--session", session}, 3), "nobody is there");
  auto running = start(scene("city", 300), 3, 100'000);
  const std::string table = run({"status", "--session", session});
  expect_says(table, "x real time");
  expect_says(table, "running");
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 4 + 3) << table;
  const std::string json = run({"status", "--session", session, "--json"});
  expect_says(json, "\"steps_per_second\":");
  expect_says(json, "\"final\":");
  running->signal(SIGINT);
  expect_exit(*running, 128 + SIGINT);
}

TEST_F(Viewer, BadOptionsAreRefused) {
  expect_says(run({"view", "--session", "no good", "--page", path("")}, 2), "session");
  expect_says(run({"view", "--session", session, "--page", path("nowhere")}, 1), "page was not built");
  expect_says(run({"view", "--token", "short"}, 2), "at least 8");
  serve();
  expect_says(run({"view", "--session", session, "--page", path("page"), "--port", std::to_string(port)}, 1),
              "cannot listen at 127.0.0.1 port");
}

}  // namespace
}  // namespace soda::test
