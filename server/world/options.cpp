#include "server/world/options.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <random>
#include <stdexcept>

#include "common/dds/checks.h"

namespace soda::world {
namespace {

const char* const kAbout =
    "One world of a SODA session: simulates the bodies in its territory, together with the other worlds.\n"
    "`soda run` starts these daemons itself; this is how to start them by hand.";

const char* const kByHand = R"(Starting a session by hand:
  World 0 has the scene and says how it is run; the others only need to know the session and which world they are. They
  may be started in any order, and get the scene from world 0. The run starts when all are there and ends when all are
  done.

    soda-world --session demo --world 0 --worlds 3 --scene city.scene --steps 600 --pace max
    soda-world --session demo --world 1
    soda-world --session demo --world 2

  On several hosts: the same commands with --interface all (or the address of the interface to use) on each. Hosts find
  each other by multicast; where that does not work, or from about 32 worlds on, start `fast-discovery-server -i 0 -l
  ADDRESS -p 11811` on one of them and add --discovery-server ADDRESS:11811 everywhere. Watch with
  `soda watch --session demo` and the same network options. A scene file is a .scene or .txtpb; `soda scene` makes one from
  SDF and others.

Exit codes: 0 done, 1 failed, 2 bad options or scene, 3 refused by the session, 128 + number: ended by that signal.)";

std::uint64_t parse_hash(const std::string& text) {
  std::uint64_t hash = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), hash, 16);
  if (error != std::errc() || end != text.data() + text.size() || hash == 0)
    throw std::invalid_argument("a scene hash is up to 16 hexadecimal digits, not '" + text + "'");
  return hash;
}

void check(const Options& o) {
  dds::check_session_name(o.session);
  const bool has_scene = !o.scene.empty() || o.scene_fd >= 0;
  if (o.world == 0 && !has_scene) throw std::invalid_argument("--scene: world 0 needs one");
  if (o.world != 0 && has_scene)
    throw std::invalid_argument("--scene: only world 0 has one; the others get it from there");
  if (o.sync == SyncMode::kSingle && (o.world != 0 || o.worlds != 1))
    throw std::invalid_argument("--sync single: there is only one world then");
  if (o.world != 0 && !o.actions.empty()) throw std::invalid_argument("--actions: only world 0 has them");
  if (o.world == 0 && o.dump_last > o.steps) throw std::invalid_argument("--dump-steps: beyond the last step");
}

}  // namespace

std::optional<Options> parse_options(int argc, char** argv, int& exit_code) {
  Options o;
  std::string sync = "anticipative", pace = "realtime", balance = "on", dump, expect;
  CLI::App app(kAbout, "soda-world");
  app.footer(kByHand);
  app.set_version_flag("--version", std::string("soda ") + kVersion + ", protocol " + std::to_string(kProtocolVersion));
  app.add_option("--session", o.session, "name of the session")->capture_default_str();
  app.add_option("--world", o.world, "which world this is")
      ->check(CLI::Range(0u, dds::kMaxWorlds - 1))
      ->capture_default_str();
  app.add_option("--expect-scene", expect, "refuse to run any other scene than that with this hash");
  app.add_flag("--verbose,-v", o.verbose, "say more");
  app.add_flag("--explain", o.explain, "measure what each way of solving islands costs, for `soda run --explain`");
  const char* group = "World 0 only";
  app.add_option("--scene", o.scene, "scene file")->group(group);
  app.add_option("--worlds", o.worlds, "how many worlds")
      ->check(CLI::Range(1u, dds::kMaxWorlds))
      ->capture_default_str()
      ->group(group);
  app.add_option("--sync", sync,
                 "'anticipative': worlds run ahead and repair; 'conservative': they wait for each other; 'single': one "
                 "world and no network, the reference")
      ->check(CLI::IsMember(sync_names()))
      ->capture_default_str()
      ->group(group);
  app.add_option("--steps", o.steps, "the run ends when this step is final")
      ->check(CLI::Range(Step{0}, dds::kMaxStepNumber))
      ->capture_default_str()
      ->group(group);
  app.add_option("--pace", pace, "'realtime', 'max' (as fast as possible), or a multiple of real time")
      ->capture_default_str()
      ->group(group);
  app.add_option("--anticipation", o.window, "K: steps beyond the final one that a world may compute")
      ->check(CLI::Range(Step{1}, kLargestWindow))
      ->capture_default_str()
      ->group(group);
  app.add_option("--balance", balance, "'on': worlds that have much to do give cells to their neighbours; 'off'")
      ->check(CLI::IsMember({"on", "off"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--input-lead", o.lead, "steps beyond the displayed one that are closed for actions")
      ->check(CLI::Range(Step{1}, kLargestLead))
      ->capture_default_str()
      ->group(group);
  app.add_flag("--watched", o.watched, "begin only once all worlds' reports have a reader, such as `soda watch`")
      ->group(group);
  app.add_option("--actions", o.actions, "file of actions (see docs/actions.md)")->group(group);
  app.add_option("--dump-steps", dump, "A[:B]: report the whole states of these steps")->group(group);
  dds::add_network_options(app, o.network);
  const char* hidden = "";
  app.add_option("--actions-fd", o.actions_fd)->group(hidden);
  app.add_option("--pose-every", o.pose_every)->check(CLI::Range(Step{0}, Step{1000000}))->group(hidden);
  app.add_option("--scene-fd", o.scene_fd)->group(hidden);
  app.add_option("--report-fd", o.report_fd)->group(hidden);
  app.add_option("--supervised-by", o.supervised_by)->group(hidden);
  app.add_option("--epoch", o.epoch)->group(hidden);
  app.add_option("--pretend-protocol", o.protocol)->group(hidden);
  try {
    app.parse(argc, argv);
    o.sync = parse_sync(sync);
    o.pace = parse_pace(pace);
    o.balance = balance == "on";
    if (!expect.empty()) o.expect_scene = parse_hash(expect);
    if (!dump.empty()) std::tie(o.dump_first, o.dump_last) = parse_steps(dump);
    if (o.epoch == 0) o.epoch = std::random_device{}() | 1u;
    check(o);
    return o;
  } catch (const CLI::ParseError& e) {
    exit_code = app.exit(e) == 0 ? 0 : 2;
  } catch (const std::invalid_argument& e) {
    std::fprintf(stderr, "soda-world: %s\n", e.what());
    exit_code = 2;
  }
  return std::nullopt;
}

}  // namespace soda::world
