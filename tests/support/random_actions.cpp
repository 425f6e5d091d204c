#include "tests/support/random_actions.h"

#include <algorithm>
#include <memory>
#include <random>
#include <variant>

#include "common/actions/action_log.h"
#include "common/grid.h"
#include "common/scene/scene_builder.h"

namespace soda::test {
namespace {

class Actor {
 public:
  Actor(const Scene& scene, Step steps, std::uint64_t seed) : scene_(scene), steps_(steps), random_(seed), log_(scene) {
    for (const Body& body : scene.bodies)
      if (!body.is_static) targets_.push_back({body.id, body.inertial.mass, bounding_radius(scene, body)});
  }

  std::vector<LoggedAction> run(std::size_t count, bool ascending) {
    std::vector<Step> at(count);
    // Half of the time all at a body or two, and within some steps: what is done later meets what was done before.
    Step first = 1, steps = steps_;
    if (random_() % 2 == 0) {
      steps = std::max<Step>(1, std::min<Step>(steps_ / 2, 25));
      first = 1 + static_cast<Step>(random_() % static_cast<std::uint64_t>(steps_ - steps + 1));
      std::swap(targets_[0], targets_[random_() % targets_.size()]);
      std::swap(targets_.back(), targets_[random_() % targets_.size()]);
      if (targets_.size() > 2) targets_.erase(targets_.begin() + 1, targets_.end() - 1);
    }
    for (Step& step : at) step = first + static_cast<Step>(random_() % static_cast<std::uint64_t>(steps));
    if (ascending) std::sort(at.begin(), at.end());
    for (const Step step : at) {
      auto result = log_.add({one(), step, {}}, ascending ? step : 1);
      if (const auto* entry = std::get_if<LoggedAction>(&result)) note(*entry);
    }
    return log_.entries();
  }

 private:
  struct Target {
    BodyId id;
    double mass, radius;
  };

  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53;
  }
  Vec3 vector(double most) { return Vec3(between(-most, most), between(-most, most), between(-most, most)); }
  const Target& anyone() { return targets_[random_() % targets_.size()]; }
  // Over, or next to, some body's first place.
  Vec3 somewhere() {
    const auto dynamic = std::find_if(scene_.bodies.begin(), scene_.bodies.end(),
                                      [id = anyone().id](const Body& b) { return b.id == id; });
    const Vec3 near = dynamic == scene_.bodies.end() ? Vec3::Zero() : dynamic->pose.position;
    return near + Vec3(between(-1, 1), between(-1, 1), between(0.5, 3));
  }

  Action one() {
    const Target& t = anyone();
    switch (random_() % 10) {
      case 0:
      case 1:
        return Push{t.id, t.mass * vector(8), 0.5 * vector(t.radius)};
      case 2:
        return SetVelocity{t.id, vector(10), vector(5)};
      case 3:
        return SetPose{t.id, somewhere(), normalized(Quat(1, between(-1, 1), between(-1, 1), between(-1, 1)))};
      case 4:
        return Remove{t.id};
      case 5:
      case 6:
        return Grab{t.id, 0.5 * vector(t.radius), somewhere(), between(0.5, 6), between(0, 2), between(10, 300)};
      case 7:
        if (!grabs_.empty()) return MoveGrab{grabs_[random_() % grabs_.size()], somewhere()};
        [[fallthrough]];
      case 8:
        if (!grabs_.empty()) return Release{grabs_[random_() % grabs_.size()]};
        [[fallthrough]];
      default: {
        SceneBuilder builder("spawned");
        const double size = between(0.2, 0.7);
        const Geometry shape = random_() % 2 ? Geometry(Box{Vec3::Constant(size)}) : Geometry(Sphere{0.5 * size});
        builder.add(shape, somewhere()).linear_velocity = vector(2);
        return Spawn{std::make_shared<const Scene>(builder.finish())};
      }
    }
  }

  void note(const LoggedAction& entry) {
    if (std::holds_alternative<Grab>(entry.action)) grabs_.push_back(entry.number);
    if (const auto* spawn = std::get_if<Spawn>(&entry.action)) {
      const Body& body = spawn->body->bodies.front();
      targets_.push_back({body.id, body.inertial.mass, bounding_radius(*spawn->body, body)});
    }
  }

  const Scene& scene_;
  Step steps_;
  std::mt19937_64 random_;
  ActionLog log_;
  std::vector<Target> targets_;
  std::vector<ActionNumber> grabs_;
};

}  // namespace

std::vector<LoggedAction> random_actions(const Scene& scene, Step steps, std::size_t count, bool ascending,
                                         std::uint64_t seed) {
  return Actor(scene, steps, seed).run(count, ascending);
}

}  // namespace soda::test
