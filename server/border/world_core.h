// One world of a session as a pure protocol machine: bodies and messages in, bodies and messages out. It knows neither
// clocks nor networks and never blocks, so that the same code runs over DDS, in one process under a simulated network,
// and alone as the reference (one world, no neighbours).
//
// A world goes on under assumptions about its neighbours and repairs what turns out to be wrong (server/timeline), or,
// in the conservative mode, assumes nothing: step t is computed once every neighbour's stream has reached t.
// docs/architecture.md tells the protocol as a whole.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/actions/action.h"
#include "common/body_set.h"
#include "common/ids.h"
#include "common/territory.h"
#include "server/border/message.h"
#include "server/border/territories.h"
#include "server/physics/model.h"
#include "server/timeline/timeline.h"

namespace soda::border {

enum class Sync { kConservative, kAnticipative };

struct CoreSettings {
  WorldId me = 0;
  std::uint32_t epoch = 0;    // of this start of the world
  std::uint64_t session = 0;  // what all worlds of a session have in common (a hash of scene and settings); others'
                              // messages are refused
  Step last_step = 0;         // the run ends when this step is final
  Sync sync = Sync::kAnticipative;
  Step window = 48;                      // K: steps beyond the final one that may be computed
  std::size_t piece_bodies = 200;        // others' news are looked at after so many results, or more in large worlds,
                                         // of bodies of which nobody hears; in the anticipative mode
  bool measure = false;                  // keep the CPU time of CoreStats::shares
  std::vector<Transfer> transfers = {};  // of cells, that all worlds know of from the start
  bool balance = false;                  // cells may change hands while the session runs
  bool actions = false;  // no step becomes final before close_actions() has said that nothing will be done at it
};

struct CoreStats {
  std::uint64_t steps = 0;          // steps computed
  std::uint64_t syncs = 0;          // steps for which island parts were exchanged
  std::uint64_t mixed_islands = 0;  // islands solved together with other worlds, summed over steps
  std::uint64_t arrived = 0;        // bodies that came into the territory
  std::uint64_t departed = 0;       // bodies that left it
  std::uint64_t wide_bodies = 0;    // bodies sent as wide, summed over steps
  std::uint64_t messages_sent = 0, bytes_sent = 0;
  std::uint64_t frames_sent = 0, frame_bodies_sent = 0;  // frames that held bodies, and how many
  std::uint64_t frames_corrected = 0;                    // of those, of steps that had been told otherwise before
  std::uint64_t parts_sent = 0;                          // own parts and parts passed on
  std::uint64_t parts_passed = 0, parts_left = 0;  // of others: passed on; times that it was left to somebody else
  std::uint64_t messages_resent = 0;
  std::uint64_t duplicates = 0;  // messages received again, ignored
  std::uint64_t refused = 0;     // malformed or foreign messages, and protocol errors
  // Results computed here that were slowed to the scene's largest speed, or held because they were not finite: those of
  // other worlds' bodies in mixed islands and those done again count, too.
  std::uint64_t clamped = 0, non_finite = 0;
  std::uint64_t actions = 0;      // entries of the action log acted on
  std::uint64_t held_back = 0;    // messages that came before actions which they presuppose
  std::uint64_t anticipated = 0;  // steps computed before all neighbours were known to have reached them
  std::uint64_t told_early = 0;   // steps told before all that nobody hears of was computed
  std::uint64_t offers = 0, offers_declined = 0;  // of cells, made by this world
  std::uint64_t transfers = 0, cells_given = 0;   // by this world, while the session runs
  std::uint64_t links_opened = 0;                 // to worlds that became neighbours while the session runs
  physics::ModelShares shares;                    // how islands were solved
  timeline::TimelineStats timeline;
};

// A final state, valid for the call.
class Produced {
 public:
  Produced(const timeline::Timeline& timeline, Step step) : timeline_(timeline), step_(step) {}
  std::size_t bodies() const { return timeline_.count(step_); }
  std::uint64_t hash() const { return timeline_.hash(step_); }  // bodies_hash
  BodySet all() const { return timeline_.all_produced(step_); }
  const Table<timeline::Record>& states() const { return timeline_.states(step_); }

 private:
  const timeline::Timeline& timeline_;
  Step step_;
};

// Told what a world computes. All calls come from within WorldCore::work or receive, on the caller's thread.
class Observer {
 public:
  virtual ~Observer() = default;
  // State `step` of the bodies that this world produced there (see "producer" in docs/architecture.md) has become
  // final: called once for each step from 0 on, in order.
  virtual void finalised(Step /*step*/, const Produced& /*produced*/) {}
};

struct Outgoing {
  WorldId to = 0;
  std::vector<std::byte> bytes;
};

enum class Progress {
  kWorked,   // something was done; call again, with what has come and gone in between
  kHolding,  // could begin a step that some neighbours are about to reach: call without patience when they have not
             // soon
  kWaiting,  // nothing to do until a message comes
  kAtLimit,  // the clock is at the limit set by set_limit, or the next final step is not closed for actions
  kDone,     // last_step is final here, and every neighbour has said the same
};

// For how much of the time that a step takes it should be waited for news that are on their way, before a step is begun
// without them: who is as fast as this world is late by less, mostly, and looking at a step twice costs both (measured
// with 64 worlds: a quarter made steps a seventh longer). It is waited once only for who falls behind.
constexpr double kPatienceShare = 1;

class WorldCore {
 public:
  // `model`, `map` and `observer` must outlive the core; bodies that are spawned are added to the model. The bodies of
  // state 0 are the scene's whose centres of mass lie in this world's territory.
  WorldCore(physics::Model& model, const TerritoryMap& map, const CoreSettings& settings, Observer& observer);
  ~WorldCore();

  // ---- in
  // A message as it came, from whichever neighbour, in any order, any number of times. False: it was refused
  // (malformed, not for this world or epoch, or contrary to the protocol); last_refusal() says why, and nothing has
  // changed (but for transfers that have been said along with what was refused).
  bool receive(std::span<const std::byte> message);
  const std::string& last_refusal() const;
  // Nothing new has come from that neighbour for some time: finds out whether something is missing here, and asks for
  // it if so. Harmless at any time.
  void ask(WorldId neighbour);
  std::uint64_t delivered(WorldId neighbour) const;  // of its messages, so many, in order
  // The connection with it was interrupted, or nothing has come for long: asks, and sends again what it has not
  // acknowledged. Harmless likewise.
  void reconnect(WorldId neighbour);
  // The clock does not pass this step (pacing). By default there is no limit.
  void set_limit(Step newest);

  // The session's action log, entry by entry. False: it is not the next one (known already, or others are missing), and
  // nothing has changed; `logged()` entries are known. Throws ProtocolError where it is for a step that is closed.
  bool act(const LoggedAction& action);
  // Everything that is done at steps up to `step` is among the first `logged` entries of the log.
  void close_actions(Step step, ActionNumber logged);
  ActionNumber logged() const;

  // ---- cells that change hands: see trade.h
  // Asks a neighbour to take cells, ascending. False, and nothing has happened: some cannot be given, the two are not
  // neighbours yet, or something is being offered already.
  bool give(WorldId taker, std::vector<std::uint32_t> cells, double cost = 0);
  bool offering() const;  // an offer has not become a transfer, or been declined, yet
  bool may_give(std::size_t cell) const;
  bool may_give_to(WorldId taker) const;
  bool has_cell(std::size_t cell) const;  // at the front
  Step steps_to_transfer() const;         // from the final step to when cells that are offered now would change hands
  // What neighbours would like to give since the last call, each to be answered.
  std::vector<Asked> take_offers();
  void answer(const Asked& asked, bool accept);
  // By cell: owners after all that is known and agreed.
  std::vector<WorldId> owners_ahead() const;
  // Transfers that have become known since the last call.
  std::vector<Transfer> take_transfers();
  void tell_load(WorldId neighbour, const Load& load);  // with the next message
  const std::map<WorldId, Load>& loads() const;         // what neighbours told last

  // ---- work: at most one step's worth, then returns. `patient`: does not begin a step for which news are on their
  // way, from all neighbours who have not reached it (kHolding).
  Progress work(bool patient = false);

  // ---- out: what has become ready to send since the last call, in order for each neighbour
  std::vector<Outgoing> take_outgoing();

  Step clock() const;       // newest step computed
  Step front() const;       // everything up to this step is computed, and nothing of it is to be done again
  Step final_step() const;  // newest step that can never change
  const std::vector<WorldId>& neighbours() const;  // may grow, at the end, while cells change hands
  // Neighbours whose messages the next piece of work lacks, or may lack: those first who are behind.
  std::vector<WorldId> waiting_for() const;
  std::string why_not_final() const;  // what the next final step lacks, in words, for logs
  // ---- for those who watch: what this world produced at a step from oldest() to clock(), final or not
  Step oldest() const;
  const Table<timeline::Record>& states(Step step) const;
  bool touches_foreign(Step step, timeline::Slot slot) const;

  std::size_t own_bodies() const;  // bodies whose centre lies in the territory at the clock
  std::size_t own_cells() const;
  const CoreStats& stats() const;

  // ---- for tests
  // Does step -> step + 1 of these bodies, and whatever that affects, again at the next work(), as if they had changed:
  // what comes out must be what is there. `step` from final_step() to below front(); unknown bodies do nothing.
  void touch(Step step, std::span<const BodyId> bodies);
  // Whether all that is known would be found where it is looked for.
  bool is_indexed() const;
  // Hash of all that was produced at a step from final_step() to clock(), contact records included.
  std::uint64_t digest(Step step) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace soda::border
