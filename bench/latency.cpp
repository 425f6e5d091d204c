// soda-bench latency: what users notice. How long what they do takes to come about in all that was computed ahead, and
// whether each frame is there in time although first one world's machine is slow and then the other's (load_peaks.cpp).
#include <algorithm>
#include <cstdio>
#include <stdexcept>

#include "bench/commands.h"
#include "bench/load_peaks.h"
#include "bench/lone_core.h"
#include "common/scene/generators.h"

namespace soda::bench {
namespace {

// By push.
struct Pushes {
  std::vector<double> ms, step_ms, over_step, redone;
};

// One ordinary step of the session, and one push whose effect on the whole window is computed, take turns.
Pushes push_city(const Scene& scene, int pushes, Step settle) {
  std::vector<const Body*> people;
  for (const Body& body : scene.bodies)
    if (body.drive) people.push_back(&body);
  LoneCore world(scene, settle + 4 * kWindow + pushes);
  // The step after the newest final one is the first that can still be acted on, and the window is full.
  const auto advance = [&](Step final_step) {
    world->set_limit(final_step + kWindow);
    world->close_actions(final_step, world->logged());
    return world.work();
  };
  for (Step step = 0; step <= settle; ++step) advance(step);
  Pushes result;
  for (int i = 0; i < pushes; ++i) {
    const double step = 1e3 * advance(settle + 1 + i);
    if (world->final_step() != settle + 1 + i || world->clock() != world->final_step() + kWindow)
      throw std::runtime_error("the window is not full");
    const Body& person = *people[people.size() * static_cast<std::size_t>(i) / static_cast<std::size_t>(pushes)];
    // To one side, as fast as one walks.
    const Vec3 impulse = person.inertial.mass * 1.4 * (i % 2 ? Vec3(0, 1, 0) : Vec3(1, 0, 0));
    const std::uint64_t before = bodies_redone(*world);
    const double ms = 1e3 * world.act({static_cast<ActionNumber>(i + 1), world->final_step() + 1,
                                       Push{.body = person.id, .impulse = impulse}});
    const auto redone = static_cast<double>(bodies_redone(*world) - before);
    if (redone < kWindow) throw std::runtime_error("a push has not changed what was computed ahead");
    result.ms.push_back(ms);
    result.step_ms.push_back(step);
    result.over_step.push_back(ms / step);
    result.redone.push_back(redone);
  }
  return result;
}

void measure_pushes(const Options& options, Headline& headline) {
  const std::uint32_t bodies = options.quick ? 1000 : 8000;
  const int pushes = options.quick ? 5 : 30;
  const Step settle = options.quick ? 20 : 120;
  Csv table(options, "latency_push", "scene,push,ms,step_ms,over_one_step,bodies_redone");
  for (const bool sleeping : {false, true}) {
    Scene scene = generate("city", bodies, 1);
    scene.sleeping = sleeping;
    const Pushes p = push_city(scene, pushes, settle);
    for (std::size_t i = 0; i < p.ms.size(); ++i)
      table.row(sleeping ? "sleeping" : "awake", i, p.ms[i], p.step_ms[i], p.over_step[i], p.redone[i]);
    const std::string name = sleeping ? "push_city_sleeping" : "push_city";
    std::printf(
        "city of %u, sleeping %s: a push and %d steps repaired take %.2f ms (%.0f bodies redone; worst %.2f ms), a "
        "step "
        "%.2f ms: %.2f\n",
        bodies, sleeping ? "on" : "off", static_cast<int>(kWindow), median(p.ms), median(p.redone),
        *std::max_element(p.ms.begin(), p.ms.end()), median(p.step_ms), median(p.over_step));
    headline.add(name + ".ms", median(p.ms));
    headline.add(name + ".ms_worst", *std::max_element(p.ms.begin(), p.ms.end()));
    headline.add(name + ".step_ms", median(p.step_ms));
    headline.add(name + ".over_one_step", median(p.over_step));
    headline.add(name + ".bodies_redone", median(p.redone));
  }
}

}  // namespace

void latency(const Options& options, Headline& headline) {
  measure_pushes(options, headline);
  load_peaks(options, headline);
}

}  // namespace soda::bench
