#include "server/physics/joints.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/physics/solver_kernel.h"
#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

Vec3 vec(const double* p) { return Vec3(p[0], p[1], p[2]); }
void put(const Vec3& v, double* p) { p[0] = v.x(), p[1] = v.y(), p[2] = v.z(); }

// One end of a joint as it is now.
struct End {
  Vec3 arm, place;  // m: from the centre of mass to the frame's origin; in the world
  Quat frame;       // to the world
  Mat3 inverse_inertia = Mat3::Zero();
  double inverse_mass = 0;
};

End end_of(const MovingBody& body, const Pose& at) {
  End end;
  end.arm = body.q * at.position;
  end.place = body.x + body.moved + end.arm;
  end.frame = body.q * at.orientation;
  end.inverse_mass = body.inverse_mass;
  end.inverse_inertia = inverse_inertia_in_world(*body.model, body.q);
  return end;
}

End end_of(const Pose& in_world) {
  End end;
  end.arm = Vec3::Zero();
  end.place = in_world.position;
  end.frame = in_world.orientation;
  return end;
}

// An angle as near to the middle of its limits as whole turns can bring it: so that what overshoots a limit is brought
// back to that one.
double unwound(double angle, const std::optional<JointLimits>& limits) {
  using std::numbers::pi;
  const double middle = limits ? 0.5 * (limits->lower + limits->upper) : 0;
  if (angle - middle > pi) return angle - 2 * pi;
  if (angle - middle < -pi) return angle + 2 * pi;
  return angle;
}

}  // namespace

void JointSolver::clear(std::uint32_t substeps) {
  used_ = 0;
  substeps_ = substeps;
}

void JointSolver::add(const JointModel& model, std::uint32_t a, std::uint32_t b, std::uint32_t index,
                      const ContactRecord& record) {
  if (used_ == work_.size()) work_.emplace_back();
  Work& work = work_[used_++];
  work.model = &model;
  work.a = a;
  work.b = b;
  work.index = index;
  const double share = 1.0 / substeps_;
  work.linear = share * vec(record.points[0].arm_a);
  work.angular = share * vec(record.points[0].arm_b);
  work.extra = {record.points[0].impulse, record.friction[0], record.friction[1], record.friction[2], record.twist};
  for (double& impulse : work.extra) impulse *= share;
}

void JointSolver::store(std::span<ContactRecord> records) const {
  const double whole = substeps_;
  for (const Work& work : std::span(work_).first(used_)) {
    ContactRecord& record = records[work.index];
    put(whole * work.linear, record.points[0].arm_a);
    put(whole * work.angular, record.points[0].arm_b);
    record.points[0].impulse = whole * work.extra[kLower];
    for (int i = 0; i < 3; ++i) record.friction[i] = whole * work.extra[static_cast<std::size_t>(kUpper + i)];
    record.twist = whole * work.extra[kCone];
  }
}

void JointSolver::prepare(Work& work, std::span<const MovingBody> bodies) const {
  const JointModel& model = *work.model;
  const Joint& joint = *model.joint;
  const End a = end_of(bodies[work.a], model.at_a);
  const End b = work.b == kNoBody ? end_of(model.at_b) : end_of(bodies[work.b], model.at_b);
  const double linear_mass = work.linear_mass = a.inverse_mass + b.inverse_mass;
  const Vec3 apart = b.place - a.place;
  const Vec3 half = work.b == kNoBody ? Vec3(Vec3::Zero()) : Vec3(0.5 * apart);
  // Both bodies are pushed in one place, half way between (of a static one it does not matter): turning momentum is
  // kept.
  const auto linear_row = [&](const Vec3& direction) {
    Line row{direction, (a.arm + half).cross(direction), (b.arm - half).cross(direction), {}, {}};
    row.a_spin = a.inverse_inertia * row.a_turn;
    row.b_spin = b.inverse_inertia * row.b_turn;
    return row;
  };
  const auto angular_row = [&](const Vec3& axis) {
    return Line{Vec3::Zero(), axis, axis, a.inverse_inertia * axis, b.inverse_inertia * axis};
  };
  const Mat3 axes_a = a.frame.toRotationMatrix();
  work.held = 0;
  const auto hold = [&](const Line& row, double error) {
    work.row[work.held] = row;
    work.error[work.held++] = error;
  };
  std::fill_n(work.used, static_cast<int>(kExtras), false);
  const auto extra = [&](Extra which, const Line& row, double error) {
    work.used[which] = true;
    work.along[which] = row;
    work.extra_mass[which] = 1 / response(row, row, linear_mass);
    work.extra_error[which] = error;
  };
  // Limits, motor and spring along one freedom at `position`.
  const auto free_along = [&](const Line& row, double position) {
    if (joint.limits) {
      extra(kLower, row, position - joint.limits->lower);
      extra(kUpper, row, position - joint.limits->upper);
    }
    if (joint.motor) extra(kMotor, row, 0);
    if (joint.spring)
      extra(kSpring, row, position - (joint.limits ? 0.5 * (joint.limits->lower + joint.limits->upper) : 0.0));
  };
  // The turn of b against a, as a quaternion in a's frame with w >= 0.
  Quat turn = a.frame.conjugate() * b.frame;
  if (turn.w() < 0) turn.coeffs() = -turn.coeffs();

  if (joint.kind != JointKind::kSlider && joint.kind != JointKind::kDistance)
    for (int i = 0; i < 3; ++i) hold(linear_row(Vec3::Unit(i)), apart[i]);
  switch (joint.kind) {
    case JointKind::kFixed: {
      const Vec3 error = axes_a * (2 * turn.vec());
      for (int i = 0; i < 3; ++i) hold(angular_row(Vec3::Unit(i)), error[i]);
      break;
    }
    case JointKind::kBall: {
      const Vec3 z_a = axes_a.col(2), z_b = b.frame * Vec3::UnitZ();
      if (joint.cone_limit) {
        const Vec3 cross = z_a.cross(z_b);
        const double sine = cross.norm();
        // Anti-parallel, or parallel: any axis across will do.
        const Vec3 axis = sine > 1e-9 ? Vec3(cross / sine) : Vec3(axes_a.col(0));
        extra(kCone, angular_row(axis), angle_of(sine, z_a.dot(z_b)) - *joint.cone_limit);
      }
      if (joint.limits) {
        const double twist = unwound(2 * angle_of(turn.z(), turn.w()), joint.limits);
        const Line row = angular_row(z_b);
        extra(kLower, row, twist - joint.limits->lower);
        extra(kUpper, row, twist - joint.limits->upper);
      }
      break;
    }
    case JointKind::kUniversal: {
      const Vec3 x_a = axes_a.col(0), y_b = b.frame * Vec3::UnitY();
      const Vec3 cross = y_b.cross(x_a);
      const double sine = cross.norm();
      // Parallel, any axis across will do to part them.
      const Vec3 axis = sine > 1e-9 ? Vec3(cross / sine) : Vec3(axes_a.col(2));
      hold(angular_row(axis), 0.5 * std::numbers::pi - angle_of(sine, x_a.dot(y_b)));
      break;
    }
    case JointKind::kHinge: {
      const Vec3 error = axes_a.col(2).cross(Vec3(b.frame * Vec3::UnitZ()));
      for (int i = 0; i < 2; ++i) hold(angular_row(axes_a.col(i)), error.dot(axes_a.col(i)));
      free_along(angular_row(axes_a.col(2)), unwound(2 * angle_of(turn.z(), turn.w()), joint.limits));
      break;
    }
    case JointKind::kSlider: {
      const Vec3 error = axes_a * (2 * turn.vec());
      for (int i = 1; i < 3; ++i) hold(linear_row(axes_a.col(i)), apart.dot(axes_a.col(i)));
      for (int i = 0; i < 3; ++i) hold(angular_row(Vec3::Unit(i)), error[i]);
      free_along(linear_row(axes_a.col(0)), apart.dot(axes_a.col(0)));
      break;
    }
    case JointKind::kDistance: {
      const double length = apart.norm();
      const Line row = linear_row(length > 1e-9 ? Vec3(apart / length) : Vec3(Vec3::UnitZ()));
      if (joint.limits && joint.limits->lower == joint.limits->upper)
        hold(row, length - joint.limits->lower);
      else
        free_along(row, length);
      break;
    }
  }
}

void JointSolver::prepare(std::span<const MovingBody> bodies) {
  for (Work& work : std::span(work_).first(used_)) prepare(work, bodies);
  for (const Cluster& cluster : clusters_) couple(cluster, bodies);
}

void JointSolver::begin(std::span<MovingBody> bodies, double h) {
  if (used_ == 0) return;
  h_ = h;
  stiff_ = soften(kJointHertzPerSubstepRate / h, kJointDampingRatio, h);
  stiff_whole_ = soften(kDirectHertzPerSubstepRate / h, kJointDampingRatio, h);
  prepare(bodies);
  for (Work& work : std::span(work_).first(used_)) {
    MovingBody& a = bodies[work.a];
    MovingBody* const b = work.b == kNoBody ? nullptr : &bodies[work.b];
    const auto push = [&](const Line& row, double impulse) { push_along(row, impulse, a, b); };
    // What was carried, along the rows as they are now.
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    for (int i = 0; i < work.held; ++i) {
      const Line& row = work.row[i];
      const bool pushes = !row.linear.isZero(0);
      const double impulse = pushes ? row.linear.dot(work.linear) : row.a_turn.dot(work.angular);
      push(row, impulse);
      (pushes ? linear : angular) += impulse * (pushes ? row.linear : row.a_turn);
    }
    work.linear = linear;
    work.angular = angular;
    for (std::size_t e = 0; e < kExtras; ++e) {
      if (work.used[e])
        push(work.along[e], work.extra[e]);
      else
        work.extra[e] = 0;
    }
  }
}

void JointSolver::pass(std::span<MovingBody> bodies, bool bias) {
  if (used_ == 0) return;
  if (!bias) prepare(bodies);  // they have moved
  for (const Cluster& cluster : clusters_) {
    for (std::uint32_t k = cluster.first; k < cluster.end; ++k) push_extras(work_[order_[k]], bodies, bias);
    push_held(cluster, bodies, bias);
  }
}

void JointSolver::push_extras(Work& work, std::span<MovingBody> bodies, bool bias) const {
  const Joint& joint = *work.model->joint;
  MovingBody& a = bodies[work.a];
  MovingBody* const b = work.b == kNoBody ? nullptr : &bodies[work.b];
  const auto push = [&](const Line& row, double impulse) { push_along(row, impulse, a, b); };
  const auto add = [&](Extra which, const Softness& soft, double wanted, double least, double most) {
    const Line& row = work.along[which];
    double& sum = work.extra[static_cast<std::size_t>(which)];
    const double change =
        -soft.mass_scale * work.extra_mass[which] * (speed_along(row, a, b) + wanted) - soft.impulse_scale * sum;
    const double now = std::clamp(sum + change, least, most);
    push(row, now - sum);
    sum = now;
  };
  constexpr Softness kRigid{0, 1, 0};

  if (work.used[kSpring]) {
    const Softness soft = soften(joint.spring->frequency, joint.spring->damping_ratio, h_);
    add(kSpring, soft, soft.bias_rate * work.extra_error[kSpring], -HUGE_VAL, HUGE_VAL);
  }
  if (work.used[kMotor])
    add(kMotor, kRigid, -joint.motor->target_velocity, -joint.motor->max_effort * h_, joint.motor->max_effort * h_);
  // One-sided: what is within its limits may reach them within the sub-step, no more.
  const auto limit = [&](Extra which, double sign) {
    if (!work.used[which]) return;
    const double error = work.extra_error[which];
    const bool within = sign * error > 0;
    const Softness& soft = bias && !within ? stiff_ : kRigid;
    const double wanted = within ? error / h_ : soft.bias_rate * error;
    if (sign > 0)
      add(which, soft, wanted, 0, HUGE_VAL);
    else
      add(which, soft, wanted, -HUGE_VAL, 0);
  };
  limit(kLower, 1);
  limit(kUpper, -1);
  limit(kCone, -1);
}

void JointSolver::push_held(const Cluster& cluster, std::span<MovingBody> bodies, bool bias) {
  const Work& first = work_[order_[cluster.first]];
  const Work& last = work_[order_[cluster.end - 1]];
  const std::uint32_t begin = first.first_row, end = last.first_row + static_cast<std::uint32_t>(last.held);
  if (begin == end) return;
  // What holds softly is alone in its cluster.
  constexpr Softness kRigid{0, 1, 0};
  const Joint& joint = *first.model->joint;
  const Softness soft = holds_softly(joint) ? soften(joint.spring->frequency, joint.spring->damping_ratio, h_)
                        : !bias             ? kRigid
                        : cluster.whole     ? stiff_whole_
                                            : stiff_;
  // What stops them moving apart, and what pulls them together.
  const std::span x(solution_.data(), end - begin), pull(pull_.data(), end - begin);
  double mass = 0;
  bool pulls = false;
  for (std::uint32_t k = cluster.first; k < cluster.end; ++k) {
    const Work& work = work_[order_[k]];
    const MovingBody& a = bodies[work.a];
    const MovingBody* const b = work.b == kNoBody ? nullptr : &bodies[work.b];
    for (const MovingBody* body : {&a, b})
      if (body && body->inverse_mass > 0) mass += 1 / body->inverse_mass;
    for (int i = 0; i < work.held; ++i) {
      const std::uint32_t at = work.first_row - begin + static_cast<std::uint32_t>(i);
      x[at] = speed_along(work.row[i], a, b);
      pull[at] = soft.bias_rate * work.error[i];
      pulls = pulls || pull[at] != 0;
    }
  }
  matrix_.solve(begin, end, x);
  if (pulls) {
    // Where rows say nearly the same, as in closed rings, a small gap would take a large motion: the energy of it is
    // limited.
    solution_of_pull_.assign(pull.begin(), pull.end());
    matrix_.solve(begin, end, solution_of_pull_);
    double twice_energy = 0;
    for (std::size_t i = 0; i < pull.size(); ++i) twice_energy += pull[i] * solution_of_pull_[i];
    const double most = mass * kPullTogetherSpeed * kPullTogetherSpeed;
    const double share = twice_energy > most ? std::sqrt(most / twice_energy) : 1;
    for (std::size_t i = 0; i < pull.size(); ++i) x[i] += share * solution_of_pull_[i];
  }
  for (std::uint32_t k = cluster.first; k < cluster.end; ++k) {
    Work& work = work_[order_[k]];
    MovingBody& a = bodies[work.a];
    MovingBody* const b = work.b == kNoBody ? nullptr : &bodies[work.b];
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    for (int i = 0; i < work.held; ++i) {
      const Line& row = work.row[i];
      const bool pushes = !row.linear.isZero(0);
      const double before = pushes ? row.linear.dot(work.linear) : row.a_turn.dot(work.angular);
      const double impulse =
          -soft.mass_scale * x[work.first_row - begin + static_cast<std::uint32_t>(i)] - soft.impulse_scale * before;
      push_along(row, impulse, a, b);
      (pushes ? linear : angular) += impulse * (pushes ? row.linear : row.a_turn);
    }
    work.linear += linear;
    work.angular += angular;
  }
}

}  // namespace soda::physics
