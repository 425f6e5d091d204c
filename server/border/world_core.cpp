#include "server/border/world_core.h"

#include <algorithm>
#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "common/state_hash.h"
#include "server/border/announcer.h"
#include "server/border/closings.h"
#include "server/border/context.h"
#include "server/border/credible.h"
#include "server/border/held_back.h"
#include "server/border/link.h"
#include "server/border/settler.h"
#include "server/border/trade.h"

namespace soda::border {

class WorldCore::Impl final : timeline::Arbiter {
 public:
  Impl(physics::Model& model, const TerritoryMap& map, const CoreSettings& settings, Observer& observer)
      : model_(model),
        territories_(map, settings.transfers),
        settings_(settings),
        observer_(observer),
        closings_(settings.actions),
        neighbourhood_(model, territories_, settings.me),
        links_(make_links()),
        context_{model_, settings_, neighbourhood_, timeline_, links_, stats_, final_},
        announcer_(context_),
        settler_(context_),
        trade_(context_, territories_),
        timeline_(model, settings.me, links_.size(), *this,
                  settings.sync == Sync::kConservative ? timeline::Timeline::kWhole : settings.piece_bodies) {
    for (const Link& link : links_) neighbours_.push_back(link.peer());
    timeline_.stepper().timing = settings.measure;
    final_ = 0;  // the scene
  }

  // ---- what comes in
  bool receive(std::span<const std::byte> bytes) {
    try {
      const Header h = decode_header(bytes);
      if (h.session != settings_.session)
        throw CodecError("border message of another session (scene, worlds or steps differ)");
      if (h.to != settings_.me) throw CodecError("border message for world " + std::to_string(h.to));
      Link* const link = context_.link_to(h.from);
      if (!link || link->since() == Neighbourhood::kNever)
        throw CodecError("border message from world " + std::to_string(h.from) + ", which is no neighbour");
      if (h.logged > logged_) {
        ++stats_.held_back;
        held_back_.keep(h.logged, bytes);
        return true;
      }
      Message& message = decoder_.decode(bytes, model_);
      check(message, settings_.me, territories_.worlds());
      return take(*link, message);
    } catch (const CodecError& error) {
      return refuse(error);
    }
  }

  bool refuse(const CodecError& error) {
    ++stats_.refused;
    refusal_ = error.what();
    return false;
  }

  // Whatever of the stream could be delivered counts, also where a later message is refused.
  bool take(Link& link, Message& message) {
    const std::uint64_t before = link.duplicates();
    const Step near_final = link.near_final();
    bool good = true;
    try {
      link.receive(message, [&](Message& m) { deliver(link, m); });
    } catch (const CodecError& error) {
      good = refuse(error);
    }
    changed();
    stats_.duplicates += link.duplicates() - before;
    settler_.finals_due(near_final + 1, link.near_final());
    settler_.reconsider();
    settler_.retry_all();
    finalise();
    return good;
  }

  void ask(WorldId neighbour) {
    if (Link* link = context_.link_to(neighbour)) link->ask();
  }

  void reconnect(WorldId neighbour) {
    if (Link* link = context_.link_to(neighbour)) link->interrupted();
  }

  void set_limit(Step newest) {
    if (std::exchange(limit_, newest) != newest) changed();
  }

  // ---- actions
  bool act(const LoggedAction& action) {
    if (action.number != logged_ + 1) return false;
    if (action.step <= std::max(closings_.closed(), final_))
      throw ProtocolError("action " + std::to_string(action.number) + " is for step " + std::to_string(action.step) +
                          ", which is closed");
    if (const auto* spawn = std::get_if<Spawn>(&action.action)) model_.add(spawn->body);
    timeline_.act(action);
    settler_.hurry(timeline_.newest());
    ++logged_;
    ++stats_.actions;
    settler_.reconsider();
    closings_.release(logged_);
    changed();
    held_back_.release(logged_, [&](const auto& bytes) { (void)receive(bytes); });  // refusals are counted
    return true;
  }

  void close_actions(Step step, ActionNumber logged) {
    closings_.add(step, logged);
    if (closings_.release(logged_)) changed();
  }

  // ---- work
  Progress work(bool patient) {
    if (!std::exchange(begun_, true)) observer_.finalised(0, Produced(timeline_, 0));
    const bool worked = idle_ ? false : advance(patient);
    if (worked) changed();
    const Step final_before = final_;
    if (!idle_) finalise();
    const bool more_final = final_ != final_before;  // which is to be told, and gives room for more
    if (more_final) changed();
    idle_ = !worked && !more_final && !holding_;
    if (worked || more_final) return Progress::kWorked;
    if (holding_) return Progress::kHolding;
    if (final_ == settings_.last_step && context_.near_final(final_)) return Progress::kDone;
    // Whoever lacks something from others must say so, wherever the clock may go.
    if (final_ < std::min(timeline_.newest(), closings_.closed())) return Progress::kWaiting;
    const bool limited = timeline_.newest() >= limit_ && limit_ < settings_.last_step;
    return limited || (final_ >= closings_.closed() && final_ < settings_.last_step) ? Progress::kAtLimit
                                                                                     : Progress::kWaiting;
  }

  // The earliest step first, newer ones while nothing can be done there.
  bool advance(bool patient) {
    holding_ = false;
    if (const Step step = timeline_.unfinished(); step >= 0) {
      // Others wait for what is told of mixed islands, and for nothing that is left of the round after its first piece.
      if (timeline_.unfinished_outside() >= 0 || !try_settle(step)) timeline_.finish();
      return true;
    }
    Step end = std::min({settings_.last_step, limit_, final_ + settings_.window});
    if (settings_.sync == Sync::kConservative) end = std::min(end, closings_.closed());
    for (Step step = final_; step < end && step <= timeline_.newest(); ++step) {
      if (!may_process(step) || (step == timeline_.newest() && had_better_listen())) return false;
      if (step == timeline_.newest() && patient && !context_.all_have_reached(step) &&
          context_.all_have_reached(step - 1)) {
        holding_ = true;
        return false;
      }
      if ((timeline_.has_pending(step) || step == timeline_.newest()) && settler_.is_worth_doing(step)) {
        if (step == timeline_.newest() && !context_.all_have_reached(step)) ++stats_.anticipated;
        timeline_.process(step);
        settler_.retry_all();  // who waited for islands that were found anew may not need to any more
        return true;
      }
      if (step < timeline_.newest() && try_settle(step)) return true;
    }
    return false;
  }

  bool try_settle(Step step) {
    return !timeline_.has_pending(step) && settler_.try_settle(step, [&](const BodySet& results) {
      timeline_.settle(step, results);
      settler_.retry_all();  // who waited for these bodies need not any more
    });
  }

  // With the window nearly full, the next step is not needed for long, and what others say, which makes steps final,
  // would have to wait until it is done.
  bool had_better_listen() const {
    constexpr Step kNearly = 8;
    return settings_.window > 2 * kNearly && timeline_.newest() + kNearly >= final_ + settings_.window &&
           final_ < std::min(timeline_.newest(), closings_.closed()) && !links_.empty();
  }

  bool may_process(Step step) const {
    // Of the first state of a neighbour nothing can be assumed.
    return std::all_of(links_.begin(), links_.end(), [&](const Link& link) {
      return link.reached(settings_.sync == Sync::kConservative ? step : std::min(step, link.since()));
    });
  }

  // Something is to be looked at again.
  void changed() {
    idle_ = false;
    untold_ = true;
    front_.reset();
    told_front_.reset();
  }

  // ---- what goes out
  std::vector<Outgoing> take_outgoing() {
    const bool waiting = idle_;
    if (const std::optional<Transfer> transfer = trade_.agreed()) {
      ++stats_.transfers;
      stats_.cells_given += transfer->cells.size();
      learn(*transfer, nullptr);
    }
    if (!links_.empty() && std::exchange(untold_, false)) {
      const Step now = told_front();
      if (now > front() && std::exchange(told_early_, now) != now) ++stats_.told_early;
      announcer_.tell(now);
      for (Step step = timeline_.oldest(); step <= std::min(now, settings_.last_step - 1); ++step) {
        if (step == timeline_.newest() || timeline_.has_pending(step) || !context_.all_have_reached(step)) break;
        settler_.tell(step);
      }
      // Parts of steps up to this one will not change any more.
      while (near_final_ + 1 < settings_.last_step && context_.near_final(near_final_ + 1) && near_final_ + 1 < now &&
             settler_.told(near_final_ + 1))
        ++near_final_;
    }
    std::vector<Outgoing> out;
    std::vector<std::vector<std::byte>> messages;
    for (Link& link : links_) {
      if (!link.may_send(told_front())) continue;
      messages.clear();
      const std::uint64_t resent = link.resent();
      link.collect(messages);
      stats_.messages_resent += link.resent() - resent;
      // The next message carries news of what is final. They are worth one of their own where there will be none soon,
      // or where this world is so far ahead of what is final that such news are what everybody waits for.
      constexpr Step kFarAhead = 4;
      const bool final_news = (waiting || timeline_.newest() > final_ + kFarAhead) &&
                              (link.told_final() != final_ || link.told_near_final() != near_final_);
      if (link.has_content() || link.told_upto() != told_front() || final_news)
        link.send(told_front(), final_, near_final_, logged_, messages);
      for (auto& bytes : messages) {
        ++stats_.messages_sent;
        stats_.bytes_sent += bytes.size();
        out.push_back({link.peer(), std::move(bytes)});
      }
    }
    release();
    return out;
  }

  // ---- what is known
  Step front() const {
    if (!front_) front_ = front_before(timeline_.unfinished());
    return *front_;
  }

  // The same for what others hear of.
  Step told_front() const {
    if (!told_front_) {
      told_front_ = front_before(timeline_.unfinished_outside());
      // What is left of a round makes work for the steps after it.
      if (timeline_.unfinished() >= 0) told_front_ = std::min(*told_front_, timeline_.unfinished() + 1);
    }
    return *told_front_;
  }

  Step front_before(Step unfinished) const {
    Step step = final_;
    while (step < timeline_.newest() && !timeline_.has_pending(step) && step != unfinished && !settler_.has_open(step))
      ++step;
    return step;
  }

  std::vector<WorldId> waiting_for() const {
    std::vector<WorldId> worlds, others;
    for (const Link& link : links_) {
      const bool behind = !link.finished(final_) || !link.reached(std::min(timeline_.newest(), settings_.last_step));
      (behind ? worlds : others).push_back(link.peer());
    }
    // A part that is missing, or word that it is final, may have to come from somebody else: all neighbours are asked.
    if (context_.near_final(final_) && (worlds.empty() ? final_ < settings_.last_step : !settler_.all_final(final_)))
      worlds.insert(worlds.end(), others.begin(), others.end());
    return worlds;
  }

  std::string why_not_final() const {
    std::string text = "front " + std::to_string(front()) + ", near final " + std::to_string(near_final_) + "; ";
    for (const Link& link : links_)
      text += "world " + std::to_string(link.peer()) + ": upto " + std::to_string(link.upto()) + ", final " +
              std::to_string(link.final_step()) + ", near final " + std::to_string(link.near_final()) + "; ";
    if (closings_.closed() <= final_)
      text += "actions are closed up to step " + std::to_string(closings_.closed()) + "; ";
    if (timeline_.unfinished() == final_) text += "a round is not finished; ";
    if (timeline_.has_pending(final_)) text += std::to_string(timeline_.pending(final_).size()) + " bodies to do; ";
    return text + settler_.why_not_final(final_);
  }

  void touch(Step step, std::span<const BodyId> bodies) {
    if (step < final_ || step >= timeline_.newest()) return;
    std::vector<timeline::Slot> slots;
    for (const BodyId id : bodies)
      if (const timeline::Slot slot = timeline_.slot_of(id); slot != timeline::kNoSlot) slots.push_back(slot);
    timeline_.touch(step, slots);
    changed();
  }

  const CoreStats& stats() {
    stats_.steps = static_cast<std::uint64_t>(timeline_.newest());
    stats_.clamped = timeline_.stepper().counters.clamped;
    stats_.non_finite = timeline_.stepper().counters.non_finite;
    stats_.shares = timeline_.stepper().shares;
    stats_.timeline = timeline_.stats();
    return stats_;
  }

 private:
  friend class WorldCore;

  Link make_link(WorldId world, std::size_t index) const {
    Link link(settings_.session, settings_.me, settings_.epoch, world, index);
    link.set_since(neighbourhood_.neighbour_since(world));
    return link;
  }

  std::deque<Link> make_links() const {
    std::deque<Link> links;
    for (WorldId world = 0; world < territories_.worlds(); ++world)
      if (neighbourhood_.neighbour_since(world) != Neighbourhood::kNever)
        links.push_back(make_link(world, links.size()));
    return links;
  }

  Link& open_link(WorldId world) {
    Link& link = links_.emplace_back(make_link(world, links_.size()));
    neighbours_.push_back(world);
    timeline_.add_source();
    announcer_.add_link(timeline_.newest());
    settler_.add_link();
    ++stats_.links_opened;
    return link;
  }

  // ---- cells that change hands
  void learn(const Transfer& transfer, const Link* from) {
    if (!territories_.add(transfer)) return;
    trade_.learnt(transfer);
    learnt_.push_back(transfer);
    for (Link& link : links_)
      if (&link != from && link.since() != Neighbourhood::kNever) link.add(transfer);
    neighbourhood_.territories_change(transfer.step);
    for (WorldId world = 0; world < territories_.worlds(); ++world) {
      const Step since = neighbourhood_.neighbour_since(world);
      Link* link = context_.link_to(world);
      const bool begins = since != Neighbourhood::kNever && (!link || link->since() == Neighbourhood::kNever);
      if (begins && !link) link = &open_link(world);
      if (link) link->set_since(since);
      if (begins) link->tell_all(territories_.transfers());
    }
    changed();
  }

  // ---- Arbiter
  timeline::Place place(const BodyState& body, Step step) const override { return neighbourhood_.place(body, step); }
  bool places_change(Step step) const override { return neighbourhood_.places_change(step); }
  bool place_changes(const BodyState& body, Step step) const override {
    return neighbourhood_.place_changes(body, step);
  }
  void extended(Step step) override {
    settler_.extended(step);
    announcer_.extend(step);
  }
  bool finding(Step step, bool all) override { return settler_.finding(step, all); }
  void dropped(Step step, const timeline::Island& island) override { settler_.dropped(step, island); }
  bool must_wait(Step, std::span<const Aabb> boxes) override { return settler_.must_wait(boxes); }
  void keep(Step step, timeline::Found found) override { settler_.keep(step, std::move(found)); }

  void deliver(const Link& link, Message& message) {
    check_steps(context_, link, message);
    for (const Transfer& transfer : message.transfers) {
      check_transfer(context_, territories_, transfer);
      learn(transfer, &link);  // before what rests on it
    }
    std::vector<Ref<timeline::NearSet>> sets;
    for (const Frame& frame : message.frames) {
      sets.push_back(timeline_.near_set(frame.set, frame.step));
      for (const timeline::NearSet::Body& b : sets.back()->bodies) check_body(context_, *b.record);
    }
    for (std::size_t i = 0; i < sets.size(); ++i) {
      const Frame& frame = message.frames[i];
      timeline_.hear(link.index(), frame.step, std::move(sets[i]));
      // What was told of one step says something of those after it.
      for (Step step = std::max(frame.step, timeline_.oldest()); step <= timeline_.newest(); ++step)
        settler_.part_due(step);
    }
    for (Part& part : message.parts) settler_.part_came(link, std::move(part));
    for (const FinalPart& part : message.finals) settler_.final_part_came(part);
    for (Offer& offer : message.offers) trade_.offered(link, std::move(offer));
    for (const Answer& answer : message.answers) trade_.answered(link, answer);
    if (message.load) loads_[link.peer()] = *message.load;
  }

  // ---- finality
  // State t + 1 is final when state t is final here and with every neighbour, nothing of step t is to be done, and all
  // that others have told for it is final.
  void finalise() {
    while (final_ < std::min(timeline_.newest(), closings_.closed()) && context_.near_final(final_) &&
           !timeline_.has_pending(final_) && timeline_.unfinished() != final_ && settler_.all_final(final_))
      make_final(final_ + 1);
  }

  void make_final(Step step) {
    if (step > 0) settler_.count(step - 1);
    final_ = step;
    observer_.finalised(step, Produced(timeline_, step));
  }

  // What is final, and told to be so (where there is anybody to tell), is not needed any more; the newest final state
  // is where the next step starts from.
  void release() {
    Step keep = final_;
    if (!links_.empty()) {
      keep = std::min(keep, near_final_ + 1);
      for (Step step = timeline_.oldest(); step < keep; ++step)
        if (!settler_.all_told(step)) keep = step;
    }
    for (Step step = timeline_.oldest(); step < keep; ++step) count(step);
    timeline_.release_before(keep);
    announcer_.release_before(keep);
    settler_.release_before(keep);
    if (settings_.balance) territories_.release_before(keep, 8 * trade_.steps_to_transfer());
  }

  void count(Step step) {
    announcer_.count(step);
    for (std::size_t source = 0; source < links_.size(); ++source)
      for (const timeline::NearSet::Body& b : timeline_.heard(source, step)->bodies)
        stats_.arrived += b.record->place.owner == settings_.me;
  }

  physics::Model& model_;
  Territories territories_;
  const CoreSettings settings_;
  Observer& observer_;
  CoreStats stats_;
  std::string refusal_;
  Decoder decoder_;
  Step final_ = -1, near_final_ = -1, limit_ = std::numeric_limits<Step>::max();
  ActionNumber logged_ = 0;
  Closings closings_;
  HeldBack held_back_;
  bool begun_ = false;
  bool idle_ = false;                               // nothing can be done before something comes
  bool holding_ = false;                            // a step could be begun, with some patience better than now
  Step told_early_ = -1;                            // the newest step that counts as told early
  bool untold_ = true;                              // something has changed since it was last looked at what to tell
  mutable std::optional<Step> front_, told_front_;  // as long as nothing changes
  Neighbourhood neighbourhood_;
  std::deque<Link> links_;
  std::vector<WorldId> neighbours_;  // by link
  std::vector<Transfer> learnt_;     // that nobody has taken notice of yet
  std::map<WorldId, Load> loads_;
  Context context_;
  Announcer announcer_;
  Settler settler_;
  Trade trade_;
  timeline::Timeline timeline_;
};

WorldCore::WorldCore(physics::Model& model, const TerritoryMap& map, const CoreSettings& settings, Observer& observer)
    : impl_(std::make_unique<Impl>(model, map, settings, observer)) {}
WorldCore::~WorldCore() = default;
bool WorldCore::receive(std::span<const std::byte> message) { return impl_->receive(message); }
const std::string& WorldCore::last_refusal() const { return impl_->refusal_; }
void WorldCore::ask(WorldId neighbour) { impl_->ask(neighbour); }
std::uint64_t WorldCore::delivered(WorldId neighbour) const {
  const Link* const link = impl_->context_.link_to(neighbour);
  return link ? link->delivered() : 0;
}
void WorldCore::reconnect(WorldId neighbour) { impl_->reconnect(neighbour); }
bool WorldCore::act(const LoggedAction& action) { return impl_->act(action); }
void WorldCore::close_actions(Step step, ActionNumber logged) { impl_->close_actions(step, logged); }
ActionNumber WorldCore::logged() const { return impl_->logged_; }
void WorldCore::set_limit(Step newest) { impl_->set_limit(newest); }
bool WorldCore::give(WorldId taker, std::vector<std::uint32_t> cells, double cost) {
  return impl_->settings_.balance && impl_->trade_.offer(taker, std::move(cells), cost);
}
bool WorldCore::may_give_to(WorldId taker) const { return impl_->trade_.may_give_to(taker); }
Step WorldCore::steps_to_transfer() const { return impl_->trade_.steps_to_transfer(); }
bool WorldCore::offering() const { return impl_->trade_.offering(); }
bool WorldCore::has_cell(std::size_t cell) const {
  return impl_->territories_.owner(cell, front()) == impl_->settings_.me;
}
bool WorldCore::may_give(std::size_t cell) const { return impl_->trade_.may_give(cell); }
std::vector<Asked> WorldCore::take_offers() { return impl_->trade_.take_offers(); }
void WorldCore::answer(const Asked& asked, bool accept) { impl_->trade_.answer(asked, accept); }
std::vector<WorldId> WorldCore::owners_ahead() const { return impl_->trade_.owners_ahead(); }
std::vector<Transfer> WorldCore::take_transfers() { return std::exchange(impl_->learnt_, {}); }
void WorldCore::tell_load(WorldId neighbour, const Load& load) {
  if (Link* const link = impl_->context_.link_to(neighbour)) link->add(load);
}
const std::map<WorldId, Load>& WorldCore::loads() const { return impl_->loads_; }
Progress WorldCore::work(bool patient) { return impl_->work(patient); }
std::vector<Outgoing> WorldCore::take_outgoing() { return impl_->take_outgoing(); }
Step WorldCore::clock() const { return impl_->timeline_.newest(); }
Step WorldCore::front() const { return impl_->front(); }
Step WorldCore::final_step() const { return impl_->final_; }
const std::vector<WorldId>& WorldCore::neighbours() const { return impl_->neighbours_; }
std::vector<WorldId> WorldCore::waiting_for() const { return impl_->waiting_for(); }
std::string WorldCore::why_not_final() const { return impl_->why_not_final(); }
Step WorldCore::oldest() const { return impl_->timeline_.oldest(); }
const Table<timeline::Record>& WorldCore::states(Step step) const { return impl_->timeline_.states(step); }
bool WorldCore::touches_foreign(Step step, timeline::Slot slot) const {
  return impl_->timeline_.touches_foreign(step, slot);
}
std::size_t WorldCore::own_bodies() const { return impl_->timeline_.count(impl_->timeline_.newest()); }
std::size_t WorldCore::own_cells() const { return impl_->neighbourhood_.own_cells(impl_->timeline_.newest()); }
const CoreStats& WorldCore::stats() const { return impl_->stats(); }
void WorldCore::touch(Step step, std::span<const BodyId> bodies) { impl_->touch(step, bodies); }
bool WorldCore::is_indexed() const { return impl_->timeline_.is_indexed(); }
std::uint64_t WorldCore::digest(Step step) const { return full_hash(impl_->timeline_.all_produced(step)); }

}  // namespace soda::border
