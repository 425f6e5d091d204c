#include "common/dds/topics.h"

#include "common/dds/checks.h"

namespace soda::dds {
namespace {

constexpr int kManyWorlds = static_cast<int>(kMaxWorlds);
constexpr int kTransfersKept = 4096;  // of each giver

// The newest sample of each instance, for whoever comes.
Flow newest(int instances) {
  Flow flow;
  flow.keep_last = 1;
  flow.max_instances = instances;
  flow.max_samples = instances;
  return flow;
}

// The newest so many, in order; a write does not wait for readers that acknowledge nothing.
Flow last(int samples) {
  Flow flow;
  flow.keep_last = samples;
  flow.max_samples = samples;
  return flow;
}

// Every sample, in order; a write waits when the history is full of samples that were not acknowledged.
Flow all(int max_samples, Millis write_at_most) {
  Flow flow;
  flow.max_samples = max_samples;
  flow.write_at_most = write_at_most;
  return flow;
}

}  // namespace

Topic session_topic() { return {"soda/session", newest(1)}; }

// Holds the whole scene, for worlds that join late: as many chunks as the largest scene has.
Topic scene_topic() { return {"soda/scene", all(static_cast<int>(kMaxSceneBytes / kMaxChunkBytes) + 1, Millis(1000))}; }

Topic join_topic() { return {"soda/join", newest(kManyWorlds)}; }

Topic admission_topic() { return {"soda/admission", newest(kManyWorlds)}; }

Topic control_topic() { return {"soda/control", newest(1)}; }

// A client's requests wait for a world 0 that is not there yet; what cannot be written at once is kept by the client,
// which may be a viewer with one thread for all.
Topic request_topic() { return {"soda/request", all(1024, Millis(5))}; }

// Nobody waits for a client that does not listen: who lacks an answer asks again.
Topic answer_topic() { return {"soda/answer", last(1024)}; }

// The newest; who lacks older ones says so in its Status, and is told again.
Topic action_log_topic() { return {"soda/action_log", last(4096)}; }

Topic status_topic() { return {"soda/status", newest(kManyWorlds)}; }

// Two minutes of history at 20 samples a second for those who come late; afterwards the oldest acknowledged go.
Topic digests_topic() { return {"soda/digests", all(2400, Millis(1000))}; }

// At most 16 MiB in flight.
Topic states_topic() { return {"soda/states", all(32, Millis(1000))}; }

Topic poses_topic() { return {"soda/poses", all(256, Millis(1000))}; }

// A viewer that is too slow misses samples and says so; nobody waits for it.
Topic transforms_topic() {
  Topic topic{"soda/transforms", newest(kManyWorlds)};
  topic.flow.keep_last = 32;
  topic.flow.max_samples = 32 * kManyWorlds;
  return topic;
}

// Who comes later needs them all to know who owns what; a crowd that walks makes about one per second and world, of
// some dozens of cells. The newest push out the oldest, so that a write does not wait for viewers.
Topic transfers_topic() {
  Topic topic{"soda/transfers", newest(kManyWorlds)};
  topic.flow.keep_last = kTransfersKept;
  topic.flow.max_samples = kTransfersKept * kManyWorlds;
  return topic;
}

Topic lack_topic() { return {"soda/lack", last(256)}; }

// For messages that do not fit into a datagram. The core keeps what was not acknowledged by the neighbour's core and
// sends it again when asked, so that this history only has to hold what is under way. A write must not hold up the
// loop, which then treats the connection as interrupted. TRANSIENT_LOCAL: VOLATILE writers of Fast DDS 2.9 drop a
// sample when a full history drains.
Topic border_topic(WorldId from, WorldId to) {
  return {"soda/border/" + std::to_string(from) + "/" + std::to_string(to), all(64, Millis(30))};
}

// Not reliable: each message costs both ends less than half of what a reliable one does (bench/message_costs), for half
// of that is acknowledgements. What is lost is missing in the core's own numbering, and asked for.
Topic border_datagram_topic(WorldId to) {
  Flow flow;
  flow.reliable = false;
  flow.late_joiners = false;
  flow.max_samples = 1024;
  return {"soda/border/" + std::to_string(to), flow};
}

}  // namespace soda::dds
