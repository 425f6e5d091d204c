// Mechanics of some bodies, from their states.
#pragma once

#include <vector>

#include "bench/accuracy/accuracy.h"

namespace soda::bench {

// Mass and inertia of a scene's dynamic bodies, in their order; and what follows from them with states.
class Mechanics {
 public:
  explicit Mechanics(const Scene& scene);

  double kinetic(Bodies bodies) const;    // J
  double potential(Bodies bodies) const;  // J, zero with all centres at the origin
  double energy(Bodies bodies) const { return kinetic(bodies) + potential(bodies); }
  Vec3 momentum(Bodies bodies) const;                        // kg m/s
  Vec3 angular_momentum(Bodies bodies) const;                // kg m^2/s, about the origin
  Vec3 spin_of(const BodyState& body, std::size_t i) const;  // kg m^2/s, about its centre of mass

  std::size_t size() const { return masses_.size(); }
  double mass(std::size_t i) const { return masses_[i]; }

 private:
  Vec3 gravity_;
  std::vector<double> masses_;
  std::vector<Mat3> inertias_;  // body axes
};

// The largest rise of the energy above its first value, and the last value, relative to the first.
class EnergyWatch {
 public:
  explicit EnergyWatch(const Scene& scene) : mechanics_(scene) {}
  void look(Bodies bodies);
  double rise() const { return rise_; }
  double end() const { return last_ / first_ - 1; }
  double mean_square() const { return looks_ ? squares_ / looks_ : 0; }  // J^2, of E - E0
  const Mechanics& mechanics() const { return mechanics_; }

 private:
  Mechanics mechanics_;
  bool started_ = false;
  double first_ = 0, last_ = 0, rise_ = 0, squares_ = 0, looks_ = 0;
};

// How deep bodies of one shape each (spheres, boxes) and the static boxes of their scene are in each other.
class Penetration {
 public:
  explicit Penetration(const Scene& scene);  // throws std::invalid_argument for other shapes
  struct Depth {
    double largest = 0;         // m
    double sum_of_squares = 0;  // m^2, over pairs
  };
  Depth of(Bodies bodies) const;

 private:
  struct Solid {
    bool sphere = false;
    double radius = 0;  // m, of the sphere, or of that about the box
    Vec3 half = Vec3::Zero();
  };
  struct Placed {
    Solid solid;
    Vec3 at;
    Mat3 turn;
  };
  static Solid solid_of(const Scene& scene, const Body& body);
  static double depth(const Placed& a, const Placed& b);
  std::vector<Solid> dynamic_;
  std::vector<Placed> static_;
};

// How far a body is from where it was, in three parts.
struct Displacement {
  double aside = 0;  // m, across z
  double down = 0;   // m, along -z
  double total = 0;  // m
};
Displacement displacement(const Body& from, const BodyState& now);

// Bodies of a scene that move.
std::vector<const Body*> dynamic_bodies(const Scene& scene);

}  // namespace soda::bench
