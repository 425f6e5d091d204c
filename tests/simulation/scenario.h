// Everything about one simulated session, out of one number.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/simulation/simulated_session.h"

namespace soda::test {

struct Reference {
  Scene scene;
  std::vector<StepDigest> steps;  // of the step alone, again and again
};
// Of a hard scene; made at its first use. From any thread.
const Reference& reference(const std::string& name);

// A network between benign and horrible, a mode and a window.
NetworkSettings network_of(std::uint64_t seed);

// Even slabs across x, whatever lies on the cuts; empty where the grid is too narrow.
std::vector<WorldId> slabs(const Scene& scene, WorldId worlds);
// Any cell to anybody: territories that are not even connected, and everybody has something.
std::vector<WorldId> confetti(const Scene& scene, WorldId worlds, std::uint64_t seed);

// Cells that change hands at random steps, a few or many at a time, from anybody to anybody.
std::vector<border::Transfer> random_transfers(const Scene& scene, WorldId worlds, const std::vector<WorldId>& owner,
                                               Step steps, std::uint64_t seed);

struct Scenario {
  std::string scene;  // of hard_scenes()
  WorldId worlds = 2;
  Step steps = 0;
  std::vector<WorldId> owner;  // territories; empty: those that a session would have
  NetworkSettings network;
  Actions actions;
  std::vector<border::Transfer> transfers;
  std::string text() const;  // for people
};
Scenario scenario_of(std::uint64_t seed);

// Runs it. `failure` is also set where a step differs from the reference.
SessionResult run_scenario(const Scenario& scenario);

}  // namespace soda::test
