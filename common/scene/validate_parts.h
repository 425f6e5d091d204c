// What the checks of validate.h are put together from. Not for others.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "common/scene/scene.h"
#include "common/scene/validate.h"

namespace soda::checks {

using MaybeProblem = std::optional<Problem>;

std::string number(double value);
// Whatever the comparison, NaN fails it.
MaybeProblem in_range(const std::string& field, double value, double low, double high, const char* unit = "");
MaybeProblem pose_problem(const std::string& field, const Pose& pose);
MaybeProblem name_problem(const std::string& name);

struct JointProblem {
  std::size_t joint;  // its place in the scene
  std::string field, reason;
};
// Of a scene whose bodies are sound.
std::optional<JointProblem> problem_in_joints(const Scene& scene);

}  // namespace soda::checks
