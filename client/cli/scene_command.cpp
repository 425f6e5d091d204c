#include "client/cli/scene_command.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>

#include "client/cli/exit_code.h"
#include "common/grid.h"
#include "common/import/load.h"
#include "common/scene/extent.h"
#include "common/scene/generators.h"
#include "common/scene/mass_properties.h"
#include "common/scene/scene_file.h"

namespace soda {
namespace {

// A counter on one line of a terminal; nothing in a log file.
ProgressFn progress_on_terminal() {
  if (!isatty(STDERR_FILENO)) return {};
  return [](std::size_t done, std::size_t total) {
    std::fprintf(stderr, "\rconverting models: %zu of %zu%s", done, total, done == total ? "\n" : "");
    std::fflush(stderr);
  };
}

Scene load_and_warn(const std::string& file) {
  std::vector<std::string> warnings;
  Scene scene = load_any_scene(file, progress_on_terminal(), warnings);
  for (const std::string& w : warnings) std::fprintf(stderr, "warning: %s: %s\n", file.c_str(), w.c_str());
  return scene;
}

std::string counted(std::size_t n, const char* one, const char* many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

std::string list_shapes(const std::array<std::size_t, std::variant_size_v<Geometry>>& counts) {
  constexpr std::pair<const char*, const char*> kNames[] = {{"sphere", "spheres"},
                                                            {"box", "boxes"},
                                                            {"capsule", "capsules"},
                                                            {"cylinder", "cylinders"},
                                                            {"convex hull", "convex hulls"},
                                                            {"plane", "planes"},
                                                            {"triangle mesh", "triangle meshes"},
                                                            {"height field", "height fields"}};
  static_assert(std::size(kNames) == std::variant_size_v<Geometry>);
  std::string text;
  for (std::size_t k = 0; k < counts.size(); ++k)
    if (counts[k] > 0) text += (text.empty() ? "" : ", ") + counted(counts[k], kNames[k].first, kNames[k].second);
  return text.empty() ? "none" : text;
}

std::string list_joints(const Scene& scene) {
  std::array<std::size_t, 6> counts{};
  for (const Joint& joint : scene.joints) ++counts[static_cast<std::size_t>(joint.kind)];
  std::string text;
  for (std::size_t k = 0; k < counts.size(); ++k)
    if (counts[k] > 0)
      text += (text.empty() ? "" : ", ") + std::to_string(counts[k]) + " " + name_of(static_cast<JointKind>(k));
  return text.empty() ? "none" : text;
}

std::string box_text(const std::optional<Aabb>& box) {
  if (!box) return "unbounded";
  char text[160];
  std::snprintf(text, sizeof text, "x %.6g .. %.6g, y %.6g .. %.6g, z %.6g .. %.6g m", box->min.x(), box->max.x(),
                box->min.y(), box->max.y(), box->min.z(), box->max.z());
  return text;
}

// What is allowed, but is probably not meant.
std::vector<std::string> doubts(const Scene& scene) {
  std::vector<std::string> list;
  std::size_t impossible = 0;
  const Body* first = nullptr;
  for (const Body& body : scene.bodies) {
    if (body.is_static) continue;
    const Vec3 m = principal_moments(body.inertial.inertia);
    if (m[0] + m[1] < m[2] * (1 - 1e-6) && impossible++ == 0) first = &body;
  }
  if (impossible > 0)
    list.push_back(counted(impossible, "body has", "bodies have") +
                   " an inertia that no solid body has: one principal "
                   "moment exceeds the sum of the others (first: " +
                   label_of(*first) + ")");
  return list;
}

void print_summary(const Scene& scene, const std::string& file) {
  std::array<std::size_t, std::variant_size_v<Geometry>> moving{}, fixed{};
  std::size_t statics = 0, driven = 0, kinematic = 0, compounds = 0;
  double mass = 0, lightest = HUGE_VAL, heaviest = 0, fastest = 0;
  std::optional<Aabb> where;
  for (const Body& body : scene.bodies) {
    for (const Shape& shape : body.shapes)
      ++(body.is_static ? fixed : moving)[scene.geometries[shape.geometry].index()];
    if (body.is_static) {
      ++statics;
      continue;
    }
    compounds += body.shapes.size() > 1;
    driven += body.drive.has_value();
    kinematic += body.motion.has_value();
    mass += body.inertial.mass;
    lightest = std::min(lightest, body.inertial.mass);
    heaviest = std::max(heaviest, body.inertial.mass);
    fastest = std::max(fastest, body.linear_velocity.norm());
    if (const auto box = extent_of(scene, body)) where = where ? merged(*where, *box) : *box;
  }
  const std::size_t dynamic = scene.bodies.size() - statics;
  std::printf("%s: \"%s\" is a valid scene\n", file.c_str(), scene.name.c_str());
  std::printf("  dynamic bodies  %zu (%zu driven, %zu kinematic, %zu of several shapes)\n", dynamic, driven, kinematic,
              compounds);
  std::printf("    shapes        %s\n", list_shapes(moving).c_str());
  if (dynamic > 0) {
    std::printf("    masses        %.6g .. %.6g kg, %.6g kg in all\n", lightest, heaviest, mass);
    std::printf("    within        %s\n", box_text(where).c_str());
    std::printf("    fastest       %.6g m/s\n", fastest);
  }
  std::printf("  static bodies   %zu\n", statics);
  std::printf("    shapes        %s\n", list_shapes(fixed).c_str());
  std::printf("  joints          %s%s\n", list_joints(scene).c_str(),
              scene.joint_method == JointMethod::kDirect     ? "; solved as a whole, however many"
              : scene.joint_method == JointMethod::kIterated ? "; solved one after the other"
                                                             : "");
  std::printf("  gravity         %.6g %.6g %.6g m/s^2\n", scene.gravity.x(), scene.gravity.y(), scene.gravity.z());
  const std::string substeps =
      scene.substeps == 0 ? "as many sub-steps as each island needs" : counted(scene.substeps, "sub-step", "sub-steps");
  std::printf("  step            %.9g s, %s, sleeping %s, at most %.6g m/s\n", scene.dt, substeps.c_str(),
              scene.sleeping ? "on" : "off", scene.max_speed);
  const Grid grid = make_grid(scene);
  std::printf("  territory grid  %d x %d x %d cells of %.6g m (%s)\n", grid.size[0], grid.size[1], grid.size[2],
              grid.edge,
              scene.territory_cell == 0           ? "chosen from the bodies"
              : scene.territory_cell == grid.edge ? "given"
                                                  : "at least max_speed x dt; fewer where bodies are far apart");
  for (const std::string& doubt : doubts(scene)) std::printf("  note: %s\n", doubt.c_str());
}

std::string generator_help() {
  std::string text = "Generators:";
  for (const Generator& g : generators())
    text += "\n  " + std::string(g.name) + std::string(10 - std::string(g.name).size(), ' ') + g.summary;
  return text;
}

// Runs an action of the user's. Whatever goes wrong is the input's fault: nothing else is asked here.
template <class Action>
int run(Action action) {
  const auto command = [&] {
    action();
    return cli::kExitOk;
  };
  return cli::guarded(command, cli::kExitBadInput);
}

}  // namespace

void add_scene_command(CLI::App& app, int& exit_code) {
  CLI::App* scene = app.add_subcommand("scene", "Make, convert and check scenes");
  scene->require_subcommand(1);

  struct MakeOptions {
    std::string name, out;
    std::uint32_t bodies = 1000;
    std::uint64_t seed = 1;
  };
  const auto made = std::make_shared<MakeOptions>();
  CLI::App* make = scene->add_subcommand("make", "Make a scene of any size");
  make->add_option("NAME", made->name, "Generator")->required();
  make->add_option("-n,--bodies", made->bodies, "Number of dynamic bodies")->capture_default_str();
  make->add_option("-s,--seed", made->seed, "Seed: the same seed makes the same scene")->capture_default_str();
  make->add_option("-o,--output", made->out, "File to write: .txtpb (text) or .scene (binary)")->required();
  make->footer(generator_help());
  make->callback([made, &exit_code] {
    exit_code = run([&] {
      const Scene result = generate(made->name, made->bodies, made->seed);
      save_scene(result, made->out);
      std::printf("%s: %u bodies\n", made->out.c_str(), made->bodies);
    });
  });

  const auto files = std::make_shared<std::pair<std::string, std::string>>();
  CLI::App* convert = scene->add_subcommand("convert", "Convert between .sdf, .world, .txtpb and .scene");
  convert->add_option("IN", files->first, "Scene to read: .sdf, .world, .txtpb or .scene")->required();
  convert->add_option("OUT", files->second, "File to write: .txtpb or .scene")->required();
  convert->callback([files, &exit_code] {
    exit_code = run([&] {
      const Scene result = load_and_warn(files->first);
      save_scene(result, files->second);
      std::printf("%s: %zu bodies\n", files->second.c_str(), result.bodies.size());
    });
  });

  const auto checked = std::make_shared<std::string>();
  CLI::App* check = scene->add_subcommand("check", "Check a scene and say what is in it");
  check->add_option("FILE", *checked, "Scene: .sdf, .world, .txtpb or .scene")->required();
  check->callback(
      [checked, &exit_code] { exit_code = run([&] { print_summary(load_and_warn(*checked), *checked); }); });
}

}  // namespace soda
