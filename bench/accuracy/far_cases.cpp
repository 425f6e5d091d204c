// A20: the same things far from the origin.
#include <algorithm>
#include <string>

#include "bench/accuracy/measures.h"
#include "common/scene/scene_builder.h"

namespace soda::bench {
namespace {

// m, along x and backwards along y. The last leaves room to the largest coordinate that a scene may have.
constexpr double kShifts[] = {0, 1e4, 1e5, 1e6, 9.9e6};
constexpr int kStack = 10, kMoving = 3;  // cubes; a cube on a slope, a sliding cube, a ball

void add_copy(SceneBuilder& builder, const Vec3& at) {
  const Box cube{Vec3(1, 1, 1)};
  for (int i = 0; i < kStack; ++i) builder.add(cube, at + Vec3(0, 0, i + 0.5));
  const Quat turn(Eigen::AngleAxisd(3.14159265358979 / 6, Vec3::UnitY()));
  const Vec3 slope = at + Vec3(0, 30, 20);
  builder.add(cube, slope + turn * Vec3(-10, 0, 0.5), turn);
  builder.add(cube, at + Vec3(-30, 0, 0.5)).linear_velocity = Vec3(4, 3, 0);
  builder.add(Sphere{0.1}, at + Vec3(-30, -20, 1)).linear_velocity = Vec3(5, 0, 5);
  builder.add_static(Box{Vec3(40, 10, 2)}, slope + turn * Vec3(0, 0, -1), turn);
  builder.add_static(Box{Vec3(200, 200, 2)}, at + Vec3(0, 0, -1));
}

Scene far_away(double) {
  SceneBuilder builder("far away");
  for (const double shift : kShifts) add_copy(builder, Vec3(shift, -shift, 0));
  return builder.finish();
}

// All copies are in one scene: each body against the same of the copy at the origin.
class FarProbe : public Probe {
 public:
  bool look(double, Bodies bodies) override {
    constexpr std::size_t kCopy = kStack + kMoving;
    for (std::size_t s = 1; s < std::size(kShifts); ++s)
      for (std::size_t i = 0; i < kCopy; ++i) {
        const Vec3 shift(kShifts[s], -kShifts[s], 0);
        const double difference = (bodies[s * kCopy + i].x() - shift - bodies[i].x()).norm();
        double& largest = i < kStack ? stack_[s] : moving_[s];
        largest = std::max(largest, difference);
      }
    return true;
  }
  std::vector<double> errors() const override {
    std::vector<double> e = {0};
    for (std::size_t s = 1; s < std::size(kShifts); ++s) {
      e[0] = std::max({e[0], moving_[s], stack_[s]});
      e.push_back(moving_[s]);
      e.push_back(stack_[s]);
    }
    return e;
  }

 private:
  double moving_[std::size(kShifts)] = {}, stack_[std::size(kShifts)] = {};  // m
};

}  // namespace

std::vector<Case> far_cases() {
  return {{.id = "A20",
           .name = "far away",
           .measures = {{"difference_m", "largest difference from the same at the origin", 1e-6},
                        {"moving_1e4_m", "of the moving bodies at 1e4 m"},
                        {"stack_1e4_m", "of the stack there"},
                        {"moving_1e5_m", "of the moving bodies at 1e5 m"},
                        {"stack_1e5_m", "of the stack there"},
                        {"moving_1e6_m", "of the moving bodies at 1e6 m"},
                        {"stack_1e6_m", "of the stack there"},
                        {"moving_1e7_m", "of the moving bodies at 9.9e6 m"},
                        {"stack_1e7_m", "of the stack there"}},
           .variants = {{"shifted", 5, far_away, [](const Scene&) { return std::make_unique<FarProbe>(); }}}}};
}

}  // namespace soda::bench
