// `soda-bench viewer`: what it costs to watch. Sessions of 2 worlds over DDS in real time, in which hardly anything
// costs time but telling of it: bodies that fly without gravity or contacts, all of them, or where one in
// twenty turns and the others sleep. First nobody watches; then the gateway with a page that takes all it can get;
// then, where there are Node.js and Chromium, the page itself in a browser without a window.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "bench/commands.h"
#include "bench/program.h"
#include "client/buffer/session_client.h"
#include "common/scene/scene_builder.h"
#include "common/scene/scene_file.h"
#include "tests/support/page.h"

namespace soda::bench {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr double kSpacing = 2;  // m
constexpr double kSpeed = 0.5;  // m/s
constexpr WorldId kWorlds = 2;
constexpr const char* kToken = "token-of-the-bench";

// Boxes in layers, each of which flies its own way as one: nothing meets. Or one in `moving_every` turns in its place,
// and the others sleep.
Scene flying_boxes(int bodies, int moving_every) {
  SceneBuilder builder("flying boxes");
  builder.scene.gravity = Vec3::Zero();
  int side = 1;
  while (side * side * 4 < bodies) ++side;
  for (int i = 0; i < bodies; ++i) {
    const int layer = i / (side * side), row = i / side % side, column = i % side;
    Body& body = builder.add(Box{Vec3::Constant(0.5)}, kSpacing * Vec3(column, row, layer));
    body.colour = 0x3d7ea6ff;
    if (i % moving_every != 0) continue;
    body.angular_velocity = Vec3(0.3, 0.6, 0.9);
    if (moving_every > 1) continue;  // it would meet those that rest
    const double turn = layer * 1.3;
    body.linear_velocity = kSpeed * Vec3(std::cos(turn), std::sin(turn), 0);
  }
  return builder.finish();
}

// Sums over the worlds.
struct Spent {
  double steps = 0, cpu = 0;  // steps of the slowest world; seconds
};

class Watched {
 public:
  explicit Watched(const std::string& session) : client_({}, session, {.transforms = false}) {}

  bool until_displayed(Step step, std::chrono::seconds at_most) {
    const auto end = Clock::now() + at_most;
    while (client_.displayed() < step || !known()) {
      if (Clock::now() > end || !client_.ended().empty()) return false;
      client_.poll(50ms);
    }
    return true;
  }
  Spent now() {
    client_.poll(0ms);
    Spent spent{1e300, 0};
    for (const auto& world : client_.worlds()) {
      spent.steps = std::min(spent.steps, static_cast<double>(world.status->steps()));
      spent.cpu += world.status->cpu_seconds();
    }
    return spent;
  }

 private:
  bool known() const {
    return !client_.worlds().empty() && std::all_of(client_.worlds().begin(), client_.worlds().end(),
                                                    [](const auto& world) { return world.status.has_value(); });
  }
  buffer::SessionClient client_;
};

struct Measured {
  double steps_per_second = 0, world_ms_unwatched = 0, world_ms_watched = 0;  // CPU per step of all worlds
  double gateway_cpu = 0;                                                     // cores
  double bytes_per_second = 0, frames_per_second = 0;                         // to the page
  double age_median = 0, age_p99 = 0;        // ms: since the displayed step was computed, which is some time ahead
  double newest_median = 0, newest_p99 = 0;  // ms: the same of the newest step that there is, in the future
};

// How long its frames have been under way when the page has them: a page that is a thread of this process.
class Watcher {
 public:
  explicit Watcher(std::uint16_t port) : page_(port, std::string("/ws?token=") + kToken) {
    if (!page_.refusal().empty()) throw std::runtime_error("the gateway refuses the page: " + page_.refusal());
  }
  bool until_all(std::size_t bodies, std::chrono::seconds at_most) {
    return page_.until([&] { return page_.bodies.size() == bodies; }, at_most);
  }
  void watch(std::chrono::milliseconds time, Measured& result) {
    const std::vector<double> ages = watch_ages(time, result);
    result.age_median = at(ages, 0.5);
    result.age_p99 = at(ages, 0.99);
  }
  void watch_newest(std::chrono::milliseconds time, Measured& result) {
    page_.look(100'000);
    page_.until([] { return false; }, 1000ms);
    Measured other;
    const std::vector<double> ages = watch_ages(time, other);
    page_.look(0);
    result.newest_median = at(ages, 0.5);
    result.newest_p99 = at(ages, 0.99);
  }

 private:
  static double at(const std::vector<double>& sorted, double share) {
    return sorted.empty() ? 0 : sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1) + 0.5)];
  }
  std::vector<double> watch_ages(std::chrono::milliseconds time, Measured& result) {
    const std::uint64_t bytes = page_.bytes, frames = page_.frames;
    std::vector<double> ages;
    std::uint64_t seen = frames;
    const auto began = Clock::now();
    page_.until(
        [&] {
          if (page_.frames != seen) ages.push_back(1000 * page_.frame.age());
          seen = page_.frames;
          return false;
        },
        time);
    const double seconds = std::chrono::duration<double>(Clock::now() - began).count();
    result.bytes_per_second = static_cast<double>(page_.bytes - bytes) / seconds;
    result.frames_per_second = static_cast<double>(page_.frames - frames) / seconds;
    std::sort(ages.begin(), ages.end());
    return ages;
  }

  test::Page page_;
};

// Pictures per second, and milliseconds of script in each and from computing to showing, in a headless browser; zeros
// where there is none.
struct Browser {
  double fps = 0, script_ms = 0, delay_ms = 0;
};
Browser in_browser(const std::string& url, int seconds) {
  Program node({"--prefix", SODA_PAGE_SOURCE, "run", "--silent", "fps", "--", "--url", url, "--seconds",
                std::to_string(seconds)},
               "npm");
  const std::string said = node.output("done", 240s);
  Browser result;
  if (std::sscanf(said.c_str(), "fps %lf script_ms %lf delay_ms %lf", &result.fps, &result.script_ms,
                  &result.delay_ms) != 3)
    std::printf("  no browser: %s\n", said.empty() ? "npm, Node.js or Chromium is missing" : said.c_str());
  return result;
}

void measure(const Options& options, int bodies, bool all, Csv& csv, Headline& headline) {
  const auto time = options.quick ? 2000ms : 10'000ms;
  const auto folder = std::filesystem::temp_directory_path() / ("soda-viewer-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  save_scene(flying_boxes(bodies, all ? 1 : 20), folder / "boxes.scene");
  const std::string session = "viewer-" + std::to_string(getpid()) + "-" + std::to_string(bodies) + (all ? "a" : "s");
  const std::string name = (all ? "moving_" : "asleep_") + std::to_string(bodies);
  std::printf("%s ...\n", name.c_str());
  std::fflush(stdout);
  Measured m;
  Browser browser;
  {
    const Program run({"run", (folder / "boxes.scene").string(), "--session", session, "--worlds",
                       std::to_string(kWorlds), "--steps", "1000000", "-q"});
    Watched worlds(session);
    if (!worlds.until_displayed(120, 300s)) throw std::runtime_error(name + ": the session does not start");
    const auto per_step = [&](auto&& meanwhile) {
      const Spent before = worlds.now();
      const auto began = Clock::now();
      meanwhile();
      const Spent after = worlds.now();
      m.steps_per_second = (after.steps - before.steps) / std::chrono::duration<double>(Clock::now() - began).count();
      return 1000 * (after.cpu - before.cpu) / std::max(1.0, after.steps - before.steps);
    };
    m.world_ms_unwatched = per_step([&] { std::this_thread::sleep_for(time); });
    Program gateway({"view", "--session", session, "--port", "0", "--token", kToken});
    const std::string said = gateway.output("token=", 30s), host = "http://localhost:";
    const std::size_t at = said.find(host);
    if (at == std::string::npos) throw std::runtime_error("the gateway does not start: is the page built?");
    const auto port = static_cast<std::uint16_t>(std::stoi(said.substr(at + host.size())));
    {
      Watcher watcher(port);
      if (!watcher.until_all(static_cast<std::size_t>(bodies), 60s))
        throw std::runtime_error(name + ": the page does not see all bodies");
      watcher.watch(1000ms, m);  // until all is even
      const double cpu = gateway.cpu_seconds();
      m.world_ms_watched = per_step([&] { watcher.watch(time, m); });
      m.gateway_cpu = (gateway.cpu_seconds() - cpu) / std::chrono::duration<double>(time).count();
      watcher.watch_newest(time / 2, m);
    }
    browser = in_browser(host + std::to_string(port) + "/?token=" + kToken, options.quick ? 2 : 10);
  }
  std::filesystem::remove_all(folder);
  std::printf(
      "  %.1f steps/s; CPU per step of the worlds %.2f ms, watched %.2f ms; gateway %.2f cores, %.2f MB/s and %.0f "
      "frames/s to the page; displayed %.0f ms after it was computed (p99 %.0f), the newest step %.1f ms (%.1f)\n  "
      "browser: %.1f pictures/s, %.2f ms of script each, %.0f ms old\n",
      m.steps_per_second, m.world_ms_unwatched, m.world_ms_watched, m.gateway_cpu, 1e-6 * m.bytes_per_second,
      m.frames_per_second, m.age_median, m.age_p99, m.newest_median, m.newest_p99, browser.fps, browser.script_ms,
      browser.delay_ms);
  csv.row(bodies, all ? 1 : 0, m.steps_per_second, m.world_ms_unwatched, m.world_ms_watched, m.gateway_cpu,
          m.bytes_per_second, m.frames_per_second, m.age_median, m.age_p99, m.newest_median, m.newest_p99, browser.fps,
          browser.script_ms, browser.delay_ms);
  headline.add(name + ".steps_per_second", m.steps_per_second);
  headline.add(name + ".world_ms_per_step_unwatched", m.world_ms_unwatched);
  headline.add(name + ".world_ms_per_step_watched", m.world_ms_watched);
  headline.add(name + ".gateway_cores", m.gateway_cpu);
  headline.add(name + ".page_bytes_per_second", m.bytes_per_second);
  headline.add(name + ".frames_per_second", m.frames_per_second);
  headline.add(name + ".age_ms_median", m.age_median);
  headline.add(name + ".age_ms_p99", m.age_p99);
  headline.add(name + ".newest_age_ms_median", m.newest_median);
  headline.add(name + ".newest_age_ms_p99", m.newest_p99);
  headline.add(name + ".browser_fps", browser.fps);
  headline.add(name + ".browser_script_ms", browser.script_ms);
  headline.add(name + ".browser_delay_ms", browser.delay_ms);
}

}  // namespace

void viewer(const Options& options, Headline& headline) {
  Csv csv(options, "viewer",
          "bodies,all_move,steps_per_second,world_ms_unwatched,world_ms_watched,gateway_cores,page_bytes_per_second,"
          "frames_per_second,age_ms_median,age_ms_p99,newest_age_ms_median,newest_age_ms_p99,browser_fps,browser_"
          "script_ms,browser_delay_ms");
  for (const int bodies : options.quick ? std::vector{1000} : std::vector{1000, 8000, 30000})
    for (const bool all : {false, true}) measure(options, bodies, all, csv, headline);
  csv.close();
  plot(options, "viewer",
       "set title 'watching: bytes to a page and CPU of the gateway, real time, 2 worlds'\n"
       "set xlabel 'bodies'\nset ylabel 'MB/s to the page'\nset y2label 'cores of the gateway'\nset y2tics\nset ytics "
       "nomirror\n"
       "set logscale x\nset key top left\nset datafile separator ','\nset yrange [0:*]\nset y2range [0:*]\n"
       "plot 'viewer.csv' skip 1 every 2::1 using 1:($7 / 1e6) with linespoints title 'all move, MB/s', "
       "'' skip 1 every 2::0 using 1:($7 / 1e6) with linespoints title '1 of 20 moves, MB/s', "
       "'' skip 1 every 2::1 using 1:6 axes x1y2 with linespoints title 'all move, cores', "
       "'' skip 1 every 2::0 using 1:6 axes x1y2 with linespoints title '1 of 20 moves, cores'\n");
}

}  // namespace soda::bench
