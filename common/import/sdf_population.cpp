#include "common/import/sdf_population.h"

#include <tinyxml2.h>

#include <cmath>
#include <cstdlib>
#include <ignition/math/Pose3.hh>
#include <numbers>

#include "common/import/warnings.h"
#include "common/scene/random.h"
#include "common/scene/validate.h"

namespace soda {
namespace {

constexpr std::size_t kMaxCopies = 1'000'000;

// All numbers of a text; none if there is anything else in it.
std::optional<std::vector<double>> numbers_of(const char* text) {
  std::vector<double> numbers;
  while (text && *text) {
    if (std::isspace(static_cast<unsigned char>(*text))) {
      ++text;
      continue;
    }
    char* end = nullptr;
    numbers.push_back(std::strtod(text, &end));
    if (end == text) return {};
    text = end;
  }
  return numbers;
}

struct Reader {
  const std::string& source;
  std::string name;

  [[noreturn]] void fail(const tinyxml2::XMLElement& at, const std::string& reason) const {
    throw SceneError(source, "population \"" + name + "\"", at.Name(), reason, at.GetLineNum());
  }

  std::vector<double> numbers(const tinyxml2::XMLElement& parent, const char* child, std::size_t count,
                              std::vector<double> fallback) const {
    const tinyxml2::XMLElement* element = parent.FirstChildElement(child);
    if (!element) return fallback;
    const auto values = numbers_of(element->GetText());
    if (!values || values->size() != count) fail(*element, "must be " + std::to_string(count) + " numbers");
    for (double v : *values)
      if (!std::isfinite(v) || std::abs(v) > kMaxCoordinate) fail(*element, "must be finite and at most 1e7");
    return *values;
  }

  std::size_t whole(const tinyxml2::XMLElement& parent, const char* child, std::size_t fallback) const {
    const tinyxml2::XMLElement* element = parent.FirstChildElement(child);
    if (!element) return fallback;
    const double value = numbers(parent, child, 1, {})[0];
    if (!(value >= 1 && value <= static_cast<double>(kMaxCopies) && value == std::floor(value)))
      fail(*element, "must be a whole number from 1 to " + std::to_string(kMaxCopies));
    return static_cast<std::size_t>(value);
  }
};

Vec3 random_offset(const SdfPopulation& p, Random& random) {
  if (p.box) return random.between(-0.5 * *p.box, 0.5 * *p.box);
  for (;;) {  // a point of a disc, by rejection
    const double x = random.between(-1, 1), y = random.between(-1, 1);
    if (x * x + y * y <= 1) return Vec3(p.radius * x, p.radius * y, random.between(-0.5 * p.length, 0.5 * p.length));
  }
}

std::vector<Vec3> random_offsets(const SdfPopulation& p, double radius, Warnings& warnings) {
  std::uint64_t seed = 0xcbf29ce484222325u;  // FNV-1a of the name
  for (char c : p.name) seed = (seed ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  Random random(seed);
  std::vector<Vec3> offsets;
  for (std::size_t i = 0; i < p.count; ++i) {
    Vec3 at = Vec3::Zero();
    bool clear = false;
    for (int attempt = 0; attempt < 100 && !clear; ++attempt) {
      at = random_offset(p, random);
      clear = true;
      for (const Vec3& other : offsets)
        if ((other - at).squaredNorm() < 4 * radius * radius) {
          clear = false;
          break;
        }
    }
    if (!clear)
      warnings.add("some models of a <population> overlap, because its region is small",
                   "population \"" + p.name + "\"");
    offsets.push_back(at);
  }
  return offsets;
}

}  // namespace

std::optional<Pose> read_plain_pose(const tinyxml2::XMLElement& element) {
  bool degrees = false, quaternion = false;
  for (const tinyxml2::XMLAttribute* a = element.FirstAttribute(); a; a = a->Next()) {
    const std::string name = a->Name(), value = a->Value();
    if (name == "degrees") {
      degrees = value == "true" || value == "1";
    } else if (name == "rotation_format" && (value == "euler_rpy" || value == "quat_xyzw")) {
      quaternion = value == "quat_xyzw";
    } else {
      return {};
    }
  }
  const auto values = numbers_of(element.GetText());
  if (!values) return {};
  if (values->empty()) return Pose{};
  if (values->size() != (quaternion ? 7 : 6) || (quaternion && degrees)) return {};
  const std::vector<double>& v = *values;
  Pose pose{Vec3(v[0], v[1], v[2]), Quat::Identity()};
  if (quaternion) {
    const Quat q(v[6], v[3], v[4], v[5]);
    if (!(q.squaredNorm() > 1e-12 && q.squaredNorm() < 1e12)) return {};
    pose.orientation = normalized(q);
  } else {
    const double unit = degrees ? std::numbers::pi / 180 : 1;
    const ignition::math::Quaterniond q(v[3] * unit, v[4] * unit, v[5] * unit);  // libsdformat's own convention
    pose.orientation = Quat(q.W(), q.X(), q.Y(), q.Z());
  }
  return pose;
}

SdfPopulation read_population(const tinyxml2::XMLElement& element, const std::string& source) {
  const char* name = element.Attribute("name");
  const Reader read{source, name ? name : ""};
  if (!name || !*name) read.fail(element, "needs a name");
  SdfPopulation p;
  p.name = name;
  if (const auto* pose = element.FirstChildElement("pose")) {
    const auto plain = read_plain_pose(*pose);
    if (!plain || !plain->position.allFinite()) read.fail(*pose, "must be x y z roll pitch yaw in the world");
    p.pose = *plain;
  }
  p.count = read.whole(element, "model_count", 1);
  std::string rule = "random";
  if (const auto* distribution = element.FirstChildElement("distribution")) {
    if (const auto* type = distribution->FirstChildElement("type")) rule = type->GetText() ? type->GetText() : "";
    p.rows = read.whole(*distribution, "rows", 1);
    p.columns = read.whole(*distribution, "cols", 1);
    const auto step = read.numbers(*distribution, "step", 3, {0.5, 0.5, 0});
    p.step = Vec3(step[0], step[1], step[2]);
    constexpr std::pair<const char*, SdfPopulation::Rule> kRules[] = {
        {"random", SdfPopulation::Rule::kRandom},    {"uniform", SdfPopulation::Rule::kUniform},
        {"grid", SdfPopulation::Rule::kGrid},        {"linear-x", SdfPopulation::Rule::kLinearX},
        {"linear-y", SdfPopulation::Rule::kLinearY}, {"linear-z", SdfPopulation::Rule::kLinearZ}};
    bool known = false;
    for (const auto& [text, value] : kRules)
      if (rule == text) p.rule = value, known = true;
    if (!known)
      read.fail(*distribution, "has the unknown type \"" + rule +
                                   "\"; there are random, uniform, grid, linear-x, linear-y and linear-z");
  }
  if (p.rule == SdfPopulation::Rule::kGrid) p.count = p.rows * p.columns;
  if (p.count > kMaxCopies) read.fail(element, "must not have more than " + std::to_string(kMaxCopies) + " models");
  if (const auto* box = element.FirstChildElement("box")) {
    const auto size = read.numbers(*box, "size", 3, {1, 1, 1});
    p.box = Vec3(size[0], size[1], size[2]);
    if ((p.box->array() < 0).any()) read.fail(*box, "must not have a negative size");
  } else if (const auto* cylinder = element.FirstChildElement("cylinder")) {
    p.radius = read.numbers(*cylinder, "radius", 1, {1})[0];
    p.length = read.numbers(*cylinder, "length", 1, {1})[0];
    if (p.radius < 0 || p.length < 0) read.fail(*cylinder, "must not have a negative size");
  } else if (p.rule != SdfPopulation::Rule::kGrid) {
    read.fail(element, "needs a region: <box> or <cylinder>");
  }
  return p;
}

std::vector<Pose> places(const SdfPopulation& p, double model_radius, Warnings& warnings) {
  using Rule = SdfPopulation::Rule;
  const Vec3 size = p.box ? *p.box : Vec3(2 * p.radius, 2 * p.radius, p.length);
  std::vector<Vec3> offsets;
  if (p.rule == Rule::kRandom) {
    offsets = random_offsets(p, model_radius, warnings);
  } else if (p.rule == Rule::kGrid) {
    for (std::size_t row = 0; row < p.rows; ++row)
      for (std::size_t column = 0; column < p.columns; ++column)
        offsets.emplace_back((static_cast<double>(column) - 0.5 * static_cast<double>(p.columns - 1)) * p.step.x(),
                             (static_cast<double>(row) - 0.5 * static_cast<double>(p.rows - 1)) * p.step.y(), 0);
  } else if (p.rule == Rule::kUniform) {
    // A square grid with about the region's proportions; in a cylinder, by rings (Vogel's spiral), which fills a disc
    // evenly.
    if (p.box) {
      const double ratio = size.y() > 0 ? size.x() / size.y() : static_cast<double>(p.count);
      const double wanted = std::sqrt(static_cast<double>(p.count) * ratio);
      const auto columns =
          static_cast<std::size_t>(std::min(std::max(1.0, std::ceil(wanted)), static_cast<double>(p.count)));
      const std::size_t rows = (p.count + columns - 1) / columns;
      for (std::size_t i = 0; i < p.count; ++i)
        offsets.emplace_back(size.x() * ((static_cast<double>(i % columns) + 0.5) / static_cast<double>(columns) - 0.5),
                             size.y() * ((static_cast<double>(i / columns) + 0.5) / static_cast<double>(rows) - 0.5),
                             0);
    } else {
      constexpr double kGoldenAngle = 2.399963229728653;  // rad
      for (std::size_t i = 0; i < p.count; ++i) {
        const double r = p.radius * std::sqrt((static_cast<double>(i) + 0.5) / static_cast<double>(p.count));
        double sine = 0, cosine = 0;
        sin_cos(std::fmod(kGoldenAngle * static_cast<double>(i), 6.283185307179586), sine, cosine);
        offsets.emplace_back(r * cosine, r * sine, 0);
      }
    }
  } else {
    const int axis = p.rule == Rule::kLinearX ? 0 : p.rule == Rule::kLinearY ? 1 : 2;
    for (std::size_t i = 0; i < p.count; ++i) {
      Vec3 at = Vec3::Zero();
      at[axis] = size[axis] * ((static_cast<double>(i) + 0.5) / static_cast<double>(p.count) - 0.5);
      offsets.push_back(at);
    }
  }
  std::vector<Pose> poses;
  for (const Vec3& offset : offsets) poses.push_back(p.pose * Pose{offset, Quat::Identity()});
  return poses;
}

}  // namespace soda
