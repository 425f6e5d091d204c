#include "server/physics/stepper.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "common/cpu_clock.h"
#include "server/physics/tuning.h"

namespace soda::physics {
namespace {

class StageClock {
 public:
  explicit StageClock(bool on) : on_(on), last_(on ? cpu_seconds() : 0) {}
  // Adds the time since the last lap to the sum, and tells it.
  double lap(double& sum) {
    if (!on_) return 0;
    const double now = cpu_seconds(), passed = now - last_;
    sum += passed;
    last_ = now;
    return passed;
  }

 private:
  bool on_;
  double last_;
};

void forget_impulses(ContactRecord& record) {
  for (auto& point : record.points) {
    point.impulse = 0;
    if (is_joint(record)) point = {};
  }
  for (double& component : record.friction) component = 0;
  record.twist = 0;
}

std::vector<Aabb> static_boxes(const Model& model) {
  std::vector<Aabb> boxes;
  for (const StaticModel& s : model.statics()) boxes.push_back(s.box);
  return boxes;
}

// Broad-phase cells hold an ordinary body's reach box at moderate speed.
double broad_cell(const Model& model) { return 1.1 * model.largest_ordinary_diameter() + 4 * kContactMargin; }

bool may_collide(std::span<const JointModel> joints) {
  return std::all_of(joints.begin(), joints.end(), [](const JointModel& j) { return j.joint->bodies_collide; });
}

// The joint's record: as it was, or a new one.
void add_joint(BodyId a, const JointModel& joint, std::span<const ContactRecord> previous,
               std::vector<ContactRecord>& out) {
  for (const ContactRecord& record : previous) {
    if (record.part != joint.part) continue;
    out.push_back(record);
    return;
  }
  ContactRecord record;
  record.a = a;
  record.b = joint.b;
  record.part = joint.part;
  record.count = 1;
  out.push_back(record);
}

constexpr std::size_t kGroupContacts = 256;  // of islands that are solved together; their batches stay in the cache

}  // namespace

Aabb reach_box(const BodyState& state, const BodyModel& model, const Mat3& rotation, const Model& scene) {
  Aabb box = bounding_box(scene.shapes().children(model.first_child, model.children), state.x(), rotation);
  // A turned box about a shape may stick out of the sphere about the body, by which indices know how far bodies reach.
  const Vec3 x = state.x();
  const double radius = model.radius * (1 + 1e-12);
  box.min = box.min.cwiseMax((x.array() - radius).matrix());
  box.max = box.max.cwiseMin((x.array() + radius).matrix());
  for (const Anchor& anchor : scene.anchors_of(model)) {
    const Vec3 place = state.x() + rotation * anchor.place;
    box.min = box.min.cwiseMin((place.array() - anchor.reach).matrix());
    box.max = box.max.cwiseMax((place.array() + anchor.reach).matrix());
  }
  double grow = kContactMargin;
  if (!state.asleep()) {
    const Vec3 travel = scene.scene().dt * state.v();
    box.min += travel.cwiseMin(0.0);
    box.max += travel.cwiseMax(0.0);
    // Turning: no point moves further than this, nor further out than the radius.
    grow += std::min(state.w().norm() * scene.scene().dt, 1.0) * model.reach;
  }
  box.min.array() -= grow;
  box.max.array() += grow;
  return box;
}

double reach_bound(const BodyState& state, double reach, double dt) {
  return reach * (1 + std::min(1.0, state.w().norm() * dt)) + state.v().norm() * dt + kContactMargin;
}

Aabb reach_box(const BodyState& state, const Model& scene) {
  return reach_box(state, *scene.find(state.id), state.q().toRotationMatrix(), scene);
}

Stepper::Stepper(const Model& model)
    : model_(model),
      constants_(model.scene()),
      statics_(static_boxes(model), broad_cell(model)),
      order_(kBlockDiameters * model.largest_ordinary_diameter()),
      chooser_(model, constants_),
      solver_(constants_, model.scene().joint_method),
      slots_(model.bodies().size(), kStaticSlot) {}

std::uint32_t Stepper::slot_of(BodyId id) const {
  const BodyModel* m = model_.find(id);
  return m ? slots_[static_cast<std::size_t>(m - model_.bodies().data())] : kStaticSlot;
}

Party Stepper::party(const BodyState& state, std::uint32_t slot) const {
  const BodyModel& m = *models_[slot];
  return {state.id,       state.x(), state.q(), rotations_[slot], model_.shapes().children(m.first_child, m.children),
          m.inner_extent, m.radius};
}

Party Stepper::party(const StaticModel& fixed) const {
  // Only the dynamic body's size limits how long contacts are recycled.
  return {kStaticBit | fixed.id,
          fixed.pose.position,
          fixed.pose.orientation,
          fixed.rotation,
          model_.shapes().children(fixed.first_child, fixed.children),
          std::numeric_limits<double>::infinity(),
          0};
}

void Stepper::assign_slots(std::span<const BodyState> bodies) {
  for (const std::uint32_t used : slots_in_use_) slots_[used] = kStaticSlot;
  slots_in_use_.clear();
  slots_.resize(model_.bodies().size(), kStaticSlot);
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    const BodyModel* const m = model_.find(bodies[i].id);
    if (!m) throw std::invalid_argument("step: body " + std::to_string(bodies[i].id) + " is not in the scene");
    slots_in_use_.push_back(static_cast<std::uint32_t>(m - model_.bodies().data()));
    slots_[slots_in_use_.back()] = i;
  }
}

void Stepper::place_bodies(std::span<const BodyState> bodies, std::span<const std::uint8_t> roles) {
  const std::size_t n = bodies.size();
  assign_slots(bodies);
  models_.resize(n);
  rotations_.resize(n);
  boxes_.resize(n);
  roles_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const BodyState& state = bodies[i];
    models_[i] = &model_.bodies()[slots_in_use_[i]];
    rotations_[i] = state.q().toRotationMatrix();
    boxes_[i] = reach_box(state, *models_[i], rotations_[i], model_);
    roles_[i] = roles.empty() ? std::uint8_t{kRoleWanted} : roles[i];
    if (!state.asleep()) roles_[i] |= kRoleAwake;
  }
}

std::size_t Stepper::find_contacts(const BodySet& set, std::span<const std::uint8_t> roles,
                                   std::vector<ContactRecord>& out) {
  split_.assign(set.bodies.size(), {});
  const Records all = set.contacts;
  for (std::size_t i = 0, first = 0; i < set.bodies.size(); ++i) {
    std::size_t end = first;
    while (end < all.size() && all[end].a == set.bodies[i].id) ++end;
    split_[i] = all.subspan(first, end - first);
    first = end;
  }
  return find_contacts(set.bodies, split_, roles, out);
}

std::size_t Stepper::find_contacts(std::span<const BodyState> bodies, std::span<const Records> previous,
                                   std::span<const std::uint8_t> roles, std::vector<ContactRecord>& out) {
  out.clear();
  StageClock clock(timing);
  previous_ = previous;
  place_bodies(bodies, roles);
  clock.lap(times.boxes);
  broad_.find(boxes_, roles_, broad_cell(model_), pairs_);
  clock.lap(times.broad);
  for (std::uint32_t i = 0; i < bodies.size(); ++i)
    if (roles_[i] & kRoleWanted) contacts_of(bodies, i, out);
  const std::size_t wanted = out.size();
  for (std::uint32_t i = 0; i < bodies.size(); ++i)
    if (!(roles_[i] & kRoleWanted)) contacts_of(bodies, i, out);
  clock.lap(times.narrow);
  return wanted;
}

void Stepper::contacts_of(std::span<const BodyState> bodies, std::uint32_t body, std::vector<ContactRecord>& out) {
  const BodyState& state = bodies[body];
  const Records previous = previous_[body];
  const bool wanted = (roles_[body] & kRoleWanted) != 0;
  std::size_t next = 0;
  // Between two sleeping bodies nothing changes: their records stay as they are.
  const auto keep_sleeping_until = [&](BodyId end) {
    for (; next < previous.size() && previous[next].b < end; ++next) {
      if (!state.asleep()) continue;
      const std::uint32_t partner = slot_of(previous[next].b);
      if (partner == kStaticSlot || !bodies[partner].asleep()) continue;
      if (wanted || (roles_[partner] & kRoleWanted) || (roles_[body] & roles_[partner] & kRoleWide))
        out.push_back(previous[next]);
    }
  };
  const auto records_with = [&](BodyId partner) {
    while (next < previous.size() && previous[next].b < partner) ++next;
    const std::size_t first = next;
    while (next < previous.size() && previous[next].b == partner) ++next;
    return previous.subspan(first, next - first);
  };
  const Party self = party(state, body);
  auto joints = model_.joints_of(*models_[body]);
  // Those with this partner: taken off the front.
  const auto joints_with = [&](BodyId partner) {
    while (!joints.empty() && joints.front().b < partner) joints = joints.subspan(1);
    std::size_t count = 0;
    while (count < joints.size() && joints[count].b == partner) ++count;
    const auto found = joints.first(count);
    joints = joints.subspan(count);
    return found;
  };
  const double own_reach = state.w().norm() * models_[body]->radius;
  for (const std::uint32_t partner : pairs_.of(body)) {
    const BodyState& other = bodies[partner];
    keep_sleeping_until(other.id);
    const double approach = (state.v() - other.v()).norm() + own_reach + other.w().norm() * models_[partner]->radius;
    const Records old = records_with(other.id);
    const auto joined = joints_with(other.id);
    if (may_collide(joined) && models_[body]->filter.admits(models_[partner]->filter) &&
        !(models_[body]->kinematic && models_[partner]->kinematic))
      updater_.update(self, party(other, partner), old, kSpeculativeDistance + approach * constants_.dt, out);
    for (const JointModel& joint : joined) {
      const Vec3 apart =
          other.x() + rotations_[partner] * joint.at_b.position - state.x() - rotations_[body] * joint.at_a.position;
      if (apart.cwiseAbs().maxCoeff() <= joint.reach) add_joint(state.id, joint, old, out);
    }
  }
  keep_sleeping_until(kStaticBit);
  if (!wanted) return;
  if (state.asleep()) {
    out.insert(out.end(), previous.begin() + static_cast<std::ptrdiff_t>(next), previous.end());
    return;
  }
  if (models_[body]->kinematic) return;
  statics_.find(boxes_[body], near_statics_);
  const auto with_world = joints_with(kStaticBit | kWorldBody);
  if (!with_world.empty()) {
    const Records old = records_with(kStaticBit | kWorldBody);
    for (const JointModel& joint : with_world) add_joint(state.id, joint, old, out);
  }
  if (!joints.empty()) {  // static bodies at any distance
    for (const JointModel& joint : joints)
      near_statics_.push_back(
          static_cast<std::uint32_t>(model_.find_static(joint.b & ~kStaticBit) - model_.statics().data()));
    std::sort(near_statics_.begin(), near_statics_.end());
    near_statics_.erase(std::unique(near_statics_.begin(), near_statics_.end()), near_statics_.end());
  }
  const double reach = kSpeculativeDistance + (state.v().norm() + own_reach) * constants_.dt;
  for (const std::uint32_t s : near_statics_) {
    const StaticModel& fixed = model_.statics()[s];
    const Records old = records_with(kStaticBit | fixed.id);
    const auto joined = joints_with(kStaticBit | fixed.id);
    if (may_collide(joined) && models_[body]->filter.admits(fixed.filter))
      updater_.update(self, party(fixed), old, reach, out);
    for (const JointModel& joint : joined) add_joint(state.id, joint, old, out);
  }
}

void Stepper::find_islands(std::span<const BodyState> bodies, std::span<const ContactRecord> contacts,
                           std::vector<Ends>& ends, Islands& islands) {
  StageClock clock(timing);
  assign_slots(bodies);
  ends.resize(contacts.size());
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    ends[k].a = slot_of(contacts[k].a);
    ends[k].b = contacts[k].with_static() ? kStaticSlot : slot_of(contacts[k].b);
    if (ends[k].a == kStaticSlot || (ends[k].b == kStaticSlot && !contacts[k].with_static()))
      throw std::invalid_argument("step: a contact record names a body that is not in the set");
  }
  finder_.find(bodies.size(), ends, islands);
  clock.lap(times.islands);
}

// How each island is to be solved that is not asleep; those of equal sub-steps together.
void Stepper::choose(std::span<const BodyState> bodies, std::span<const ContactRecord> contacts,
                     std::span<const Ends> ends, const Islands& islands, std::span<const std::uint32_t> which) {
  chosen_.clear();
  chosen_models_.resize(bodies.size());
  for (const std::uint32_t island : which) {
    const auto members = islands.bodies_of(island);
    if (std::all_of(members.begin(), members.end(), [&](std::uint32_t i) { return bodies[i].asleep(); })) continue;
    for (const std::uint32_t i : members) chosen_models_[i] = model_.find(bodies[i].id);
    const auto touching = islands.contacts_of(island);
    const Choice choice = touching.empty()
                              ? Choice{flight_substeps(bodies[members[0]], *chosen_models_[members[0]], constants_), 0}
                              : chooser_.choose({members, touching, bodies, chosen_models_, contacts, ends});
    chosen_.push_back({island, choice});
  }
  // In the order of memory otherwise.
  const auto fewer = [](const Chosen& l, const Chosen& r) {
    return l.choice.substeps != r.choice.substeps ? l.choice.substeps < r.choice.substeps : l.island < r.island;
  };
  if (!std::is_sorted(chosen_.begin(), chosen_.end(), fewer)) std::sort(chosen_.begin(), chosen_.end(), fewer);
}

void Stepper::solve(std::span<BodyState> bodies, std::span<ContactRecord> contacts, std::span<const Ends> ends,
                    const Islands& islands, std::span<const std::uint32_t> which) {
  StageClock clock(timing);
  choose(bodies, contacts, ends, islands, which);
  centres_.resize(bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) centres_[i] = bodies[i].x();
  surfaces_.resize(contacts.size());
  island_slot_.resize(bodies.size());
  std::uint32_t substeps = 0;  // of the group
  const auto solve_group = [&] {
    if (group_.empty()) return;
    clock.lap(times.order);
    mix_group();
    solver_.solve(substeps, std::span(moving_).first(moving_used_), island_slot_, mixed_, ends, surfaces_, contacts);
    for (const Grouped& one : group_) finish(bodies, contacts, islands, one);
    ModelShare& share = shares.solved[std::min<std::size_t>(std::bit_width(substeps) - 1, kMostSubstepLevel)];
    share.islands += group_.size();
    share.bodies += moving_used_;
    share.contacts += sorted_.size();
    shares.joints_together = solver_.joints_together();
    shares.joints_alone = solver_.joints_alone();
    group_.clear();
    sorted_.clear();
    moving_used_ = 0;
    share.seconds += clock.lap(times.solve);
  };
  for (const auto& [island, choice] : chosen_) {
    if (choice.substeps != substeps) solve_group();
    substeps = choice.substeps;
    const auto members = islands.bodies_of(island);
    const auto touching = islands.contacts_of(island);
    const Grouped one{island, static_cast<std::uint32_t>(moving_used_), static_cast<std::uint32_t>(sorted_.size()),
                      static_cast<std::uint32_t>(touching.size()), choice};
    moving_used_ += members.size();
    if (moving_used_ > moving_.size()) moving_.resize(std::max(moving_used_, 2 * moving_.size()));
    for (std::uint32_t k = 0; k < members.size(); ++k) {
      island_slot_[members[k]] = one.first_body + k;
      BodyState& state = bodies[members[k]];
      if (state.asleep()) state.quiet_steps = 0;  // woken: has to come to rest anew
      begin_step(state, *chosen_models_[members[k]], moving_[one.first_body + k]);
    }
    if (touching.empty()) {
      fly(moving_[one.first_body], substeps, constants_);
      finish(bodies, contacts, islands, one);
      moving_used_ = one.first_body;
      ++shares.flights.islands;
      ++shares.flights.bodies;
      shares.turning_flights += chosen_models_[members[0]]->isotropic ? 0 : 1;
      shares.flights.seconds += clock.lap(times.solve);
      continue;
    }
    for (const std::uint32_t c : touching) {
      find_surface(contacts[c], ends[c], surfaces_[c]);
      surfaces_[c].half_octaves = choice.half_octaves();
      shares.bouncing += !surfaces_[c].joint && surfaces_[c].restitution > 0 ? 1 : 0;
    }
    sorted_.insert(sorted_.end(), touching.begin(), touching.end());
    order_.sort(std::span(sorted_).subspan(one.first_contact), ends, centres_);
    group_.push_back(one);
    ++counters.islands;
    if (sorted_.size() >= kGroupContacts) solve_group();
  }
  solve_group();
}

void Stepper::find_surface(const ContactRecord& contact, const Ends& ends, Surface& surface) const {
  surface.joint = nullptr;
  if (is_joint(contact)) {
    surface.joint = model_.find_joint(contact);
    if (!surface.joint) throw std::invalid_argument("step: a record names a joint that is not in the scene");
    return;
  }
  const BodyModel& a = *moving_[island_slot_[ends.a]].model;
  double friction, restitution;
  if (ends.b == kStaticSlot) {
    surface.fixed = model_.find_static(contact.b & ~kStaticBit);
    friction = surface.fixed->friction, restitution = surface.fixed->restitution;
  } else {
    const BodyModel& b = *moving_[island_slot_[ends.b]].model;
    surface.fixed = nullptr;
    friction = b.friction, restitution = b.restitution;
  }
  const auto kind_of = [&](std::uint32_t first, std::uint32_t child) {
    return model_.shapes().children(first + child, 1)[0].kind;
  };
  const auto is_round = [](ShapeKind kind) { return kind == ShapeKind::kSphere || kind == ShapeKind::kCapsule; };
  surface.moves_on_a = 0.5;
  if (ends.b != kStaticSlot) {
    const bool a_rolls = is_round(kind_of(a.first_child, contact.part >> 20));
    const bool b_rolls = is_round(kind_of(moving_[island_slot_[ends.b]].model->first_child, contact.part >> 8 & 0xfff));
    if (a_rolls != b_rolls) surface.moves_on_a = a_rolls ? 0 : 1;
  }
  surface.friction = std::sqrt(a.friction * friction);
  surface.restitution = std::max(a.restitution, restitution);
}

// Each island's first contact, each one's second, and so on: neighbours in the list are of different islands, and can
// be solved at once.
void Stepper::mix_group() {
  mixed_.clear();
  unmixed_ = group_;
  for (std::uint32_t k = 0; !unmixed_.empty(); ++k) {
    std::erase_if(unmixed_, [k](const Grouped& one) { return k >= one.contacts; });
    if (unmixed_.size() == 1) {
      const auto left = std::span(sorted_).subspan(unmixed_[0].first_contact + k, unmixed_[0].contacts - k);
      mixed_.insert(mixed_.end(), left.begin(), left.end());
      return;
    }
    for (const Grouped& one : unmixed_) mixed_.push_back(sorted_[one.first_contact + k]);
  }
}

void Stepper::finish(std::span<BodyState> bodies, std::span<ContactRecord> contacts, const Islands& islands,
                     const Grouped& one) {
  const auto members = islands.bodies_of(one.island);
  bool quiet = constants_.sleeping, finite = true;
  for (std::uint32_t k = 0; k < members.size(); ++k) {
    BodyState& state = bodies[members[k]];
    MovingBody& body = moving_[one.first_body + k];
    state.set_stiffness(one.choice.stiffness);
    state.set_in_heap(one.choice.heap);
    if (!end_step(body, constants_, state)) {
      ++counters.non_finite;
      finite = false;
    }
    counters.clamped += body.clamped;
    quiet = quiet && !body.model->kinematic && state.quiet_steps >= constants_.quiet_steps_to_sleep;
  }
  if (!finite)  // nor are the impulses that came with it
    for (const std::uint32_t c : islands.contacts_of(one.island)) forget_impulses(contacts[c]);
  if (!quiet) return;
  ++counters.fell_asleep;
  for (const std::uint32_t i : members) {
    bodies[i].flags |= kAsleep;
    bodies[i].set_v(Vec3::Zero());
    bodies[i].set_w(Vec3::Zero());
  }
}

void Stepper::step(BodySet& set) {
  find_contacts(set, {}, found_);
  set.contacts.swap(found_);
  find_islands(set.bodies, set.contacts, ends_, islands_);
  all_.resize(islands_.size());
  std::iota(all_.begin(), all_.end(), 0u);
  solve(set.bodies, set.contacts, ends_, islands_, all_);
}

}  // namespace soda::physics
