// All topics of a session and how their samples flow: the one place where QoS is chosen. docs/topics.md is the table
// for readers. A session is a partition named after it; all topics of this file live in it.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "common/ids.h"

namespace soda::dds {

using Millis = std::chrono::milliseconds;

struct Flow {
  bool reliable = true;
  bool late_joiners = true;  // TRANSIENT_LOCAL: who comes later gets what the writer still has
  int keep_last = 0;         // samples per instance; 0: all, up to max_samples
  int max_samples = 0;       // in a writer's or reader's history, over all instances
  int max_instances = 1;
  Millis write_at_most{100};  // a write that cannot be done waits at most that long, then fails
};

struct Topic {
  std::string name;
  Flow flow;
};

Topic session_topic();                         // Session
Topic scene_topic();                           // SceneChunk
Topic join_topic();                            // Join
Topic admission_topic();                       // Admission
Topic control_topic();                         // Control
Topic request_topic();                         // Request
Topic answer_topic();                          // Answer
Topic action_log_topic();                      // LogEntry
Topic status_topic();                          // Status
Topic digests_topic();                         // Digests
Topic states_topic();                          // StateChunk
Topic poses_topic();                           // Poses
Topic transforms_topic();                      // Transforms
Topic transfers_topic();                       // Transfer
Topic lack_topic();                            // Lack
Topic border_topic(WorldId from, WorldId to);  // Border
Topic border_datagram_topic(WorldId to);       // Border, short ones

// Reliable writers tell readers what there is this often while it is not acknowledged. 3 s by default: a reader that
// lost something would take that long to find out.
constexpr Millis kHeartbeat{50};
// Answers to heartbeats and to requests for lost samples are not delayed further (5 ms by default).
constexpr Millis kAnswerDelay{1};

// A world of which no Status came for that long is called silent. (Not left to a DDS liveliness lease: measured with
// Fast DDS 2.9, a reader with several writers is not told of the one that stopped while the others go on.)
constexpr Millis kSilence{2000};

}  // namespace soda::dds
