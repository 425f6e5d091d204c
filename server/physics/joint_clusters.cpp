// Which joints are solved together, and the matrix of each such cluster.
#include <algorithm>
#include <limits>
#include <utility>

#include "server/physics/joints.h"
#include "server/physics/solver_kernel.h"
#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

constexpr std::uint32_t kNotPlaced = std::numeric_limits<std::uint32_t>::max();

// How many rows a joint holds, wherever its bodies are.
int held_by(const Joint& joint) {
  switch (joint.kind) {
    case JointKind::kFixed:
      return 6;
    case JointKind::kBall:
      return 3;
    case JointKind::kUniversal:
      return 4;
    case JointKind::kHinge:
    case JointKind::kSlider:
      return 5;
    case JointKind::kDistance:
      return joint.limits && joint.limits->lower == joint.limits->upper ? 1 : 0;
  }
  return 0;
}

}  // namespace

std::span<const std::uint32_t> JointSolver::joints_at(std::uint32_t body) const {
  return std::span(at_).subspan(first_at_[body], first_at_[body + 1] - first_at_[body]);
}

// All joints that hang together with `start`, nearest first.
void JointSolver::gather(std::uint32_t start, std::vector<std::uint32_t>& found) {
  found.assign(1, start);
  if (!work_[start].joins) return;
  seen_[start] = ++sight_;
  for (std::size_t k = 0; k < found.size(); ++k) {
    const Work& work = work_[found[k]];
    for (const std::uint32_t body : {work.a, work.b}) {
      if (body == kNoBody || std::exchange(seen_body_[body], sight_) == sight_) continue;
      for (const std::uint32_t joint : joints_at(body)) {
        if (std::exchange(seen_[joint], sight_) == sight_) continue;
        found.push_back(joint);
      }
    }
  }
}

void JointSolver::arrange(std::span<const MovingBody> bodies) {
  if (used_ == 0) return;
  clusters_.clear();
  order_.clear();
  matrix_.clear();
  const auto by = [&](const Work& work, std::uint32_t body) {
    return work.joins && body != kNoBody && bodies[body].inverse_mass > 0;
  };
  first_at_.assign(bodies.size() + 1, 0);
  for (Work& work : std::span(work_).first(used_)) {
    work.held = held_by(*work.model->joint);
    work.joins = method_ != JointMethod::kIterated && work.held > 0 && !holds_softly(*work.model->joint);
    for (const std::uint32_t body : {work.a, work.b})
      if (by(work, body)) ++first_at_[body];
  }
  std::uint32_t sum = 0;
  for (std::uint32_t& first : first_at_) first = sum += first;  // where each ends, for now
  at_.resize(sum);
  for (std::uint32_t k = static_cast<std::uint32_t>(used_); k-- > 0;)
    for (const std::uint32_t body : {work_[k].a, work_[k].b})
      if (by(work_[k], body)) at_[--first_at_[body]] = k;
  seen_.resize(std::max(seen_.size(), used_), 0);
  seen_body_.resize(std::max(seen_body_.size(), bodies.size()), 0);
  first_row_at_.assign(bodies.size(), kNotPlaced);
  done_.assign(used_, false);
  for (std::uint32_t k = 0; k < used_; ++k) {
    if (done_[k]) continue;
    // From one end to the other, or nearly so: entries stay near the diagonal.
    gather(k, once_);
    gather(once_.back(), again_);
    for (const std::uint32_t joint : again_) done_[joint] = true;
    add_cluster(again_);
  }
  solution_.resize(matrix_.size());
  pull_.resize(matrix_.size());
}

void JointSolver::add_cluster(std::span<const std::uint32_t> members) {
  const std::uint32_t begin = matrix_.size();
  std::size_t rows = 0;
  for (const std::uint32_t k : members) rows += static_cast<std::size_t>(work_[k].held);
  const std::size_t most = std::max(kMostDirectWork, kMostDirectWorkPerRow * rows);
  std::size_t spent = 0;
  const auto add_rows = [&](Work& work, std::uint32_t reach) {
    work.first_row = matrix_.size();
    for (int i = 0; i < work.held; ++i) matrix_.add_row(reach);
  };
  const auto first_order = static_cast<std::uint32_t>(order_.size());
  bool whole = method_ != JointMethod::kIterated;
  for (const std::uint32_t k : members) {
    Work& work = work_[k];
    // It reaches back to the first one that it shares a body with.
    std::uint32_t reach = matrix_.size();
    if (members.size() > 1)
      for (const std::uint32_t body : {work.a, work.b})
        if (body != kNoBody && !joints_at(body).empty()) {
          first_row_at_[body] = std::min(first_row_at_[body], matrix_.size());
          reach = std::min(reach, first_row_at_[body]);
        }
    const std::size_t width = matrix_.size() - reach + static_cast<std::size_t>(work.held);
    spent += width * width * static_cast<std::size_t>(work.held);
    if (members.size() > 1 && method_ != JointMethod::kDirect && spent > most) {
      whole = false;
      break;
    }
    add_rows(work, reach);
  }
  if (whole || members.size() == 1) {
    order_.insert(order_.end(), members.begin(), members.end());
    clusters_.push_back({first_order, static_cast<std::uint32_t>(order_.size()), whole});
    (members.size() > 1 ? together : alone) += members.size();
    return;
  }
  matrix_.cut(begin);
  for (const std::uint32_t k : members) {
    add_rows(work_[k], matrix_.size());
    order_.push_back(k);
    clusters_.push_back(
        {static_cast<std::uint32_t>(order_.size() - 1), static_cast<std::uint32_t>(order_.size()), false});
  }
  alone += members.size();
}

// How fast the row of one joint gets by a unit impulse along the row of another that shares `body` with it.
double JointSolver::response_by(std::uint32_t body, const MovingBody& moving, const Work& l, int row, const Work& r,
                                int column) {
  const Line &at = l.row[row], &by = r.row[column];
  const Vec3& turn = l.a == body ? at.a_turn : at.b_turn;
  const Vec3& spin = r.a == body ? by.a_spin : by.b_spin;
  const double response = moving.inverse_mass * at.linear.dot(by.linear) + turn.dot(spin);
  return (l.a == body) == (r.a == body) ? response : -response;
}

// The effective inverse mass of all rows of a cluster, factored.
void JointSolver::couple(const Cluster& cluster, std::span<const MovingBody> bodies) {
  const auto row_of = [](const Work& work, int i) { return work.first_row + static_cast<std::uint32_t>(i); };
  const Work &first = work_[order_[cluster.first]], &last = work_[order_[cluster.end - 1]];
  const std::uint32_t begin = first.first_row, end = row_of(last, last.held);
  matrix_.zero(begin, end);
  for (std::uint32_t k = cluster.first; k < cluster.end; ++k) {
    const Work& work = work_[order_[k]];
    for (int i = 0; i < work.held; ++i)
      for (int j = 0; j <= i; ++j)
        matrix_.at(row_of(work, i), row_of(work, j)) = response(work.row[i], work.row[j], work.linear_mass);
    if (cluster.end - cluster.first == 1) continue;
    for (const std::uint32_t body : {work.a, work.b}) {
      if (body == kNoBody) continue;
      for (const std::uint32_t k2 : joints_at(body)) {
        const Work& other = work_[k2];
        if (other.first_row >= work.first_row) continue;
        for (int i = 0; i < work.held; ++i)
          for (int j = 0; j < other.held; ++j)
            matrix_.at(row_of(work, i), row_of(other, j)) += response_by(body, bodies[body], work, i, other, j);
      }
    }
  }
  matrix_.factor(begin, end);
}

}  // namespace soda::physics
