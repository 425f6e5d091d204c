/* Reads a session's transforms with Cyclone DDS, which knows nothing of SODA but idl/soda.idl: whoever has another
 * vendor's DDS can do the same. Follows every world as docs/topics.md says, and prints a line for each step of which it
 * has all of them at once, "STEP BODIES SUM_OF_X", the last one when step LAST is final in all.
 *
 *   cyclone_subscriber SESSION WORLDS LAST [SECONDS]
 *
 * Exit codes: 0; 1 if that did not come in time; 2 for wrong arguments. CYCLONEDDS_URI may name cyclonedds.xml, for sessions on this machine. */
#include <dds/dds.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "soda.h"

enum { kMostWorlds = 64, kMostBodies = 4096, kAtOnce = 64 };

/* What a world has told last: its bodies at its newest step. */
struct world {
  uint64_t instance; /* of the session, as heard of last */
  uint64_t next;     /* number of the sample that comes next; 0: a whole one is needed */
  dds_time_t asked;  /* when that was asked for */
  int64_t step, final_step;
  size_t bodies;
  uint64_t id[kMostBodies];
  double x[kMostBodies];
};
static struct world worlds[kMostWorlds];

static void put(struct world *w, uint64_t id, double x) {
  size_t i = 0;
  while (i < w->bodies && w->id[i] != id) ++i;
  if (i == kMostBodies) exit(1);
  if (i == w->bodies) w->id[w->bodies++] = id;
  w->x[i] = x;
}

static void drop(struct world *w, uint64_t id) {
  for (size_t i = 0; i < w->bodies; ++i)
    if (w->id[i] == id) {
      --w->bodies;
      w->id[i] = w->id[w->bodies];
      w->x[i] = w->x[w->bodies];
      return;
    }
}

/* Returns whether that was news of the world. */
static bool take(const soda_wire_Transforms *s, uint32_t count) {
  if (s->world >= count) return false;
  struct world *w = &worlds[s->world];
  w->instance = s->instance;
  if (s->kind == soda_wire_VIEW_WHOLE)
    w->bodies = 0;
  else if (w->next == 0 || s->number != w->next) {
    w->next = 0;
    return false;
  }
  w->next = s->number + 1;
  w->final_step = s->final_step;
  if (s->kind == soda_wire_VIEW_AGAIN && s->step != w->step) return true; /* of the past: this one keeps no steps */
  for (uint32_t i = 0; i < s->ids._length; ++i) put(w, s->ids._buffer[i], s->positions._buffer[3 * i]);
  for (uint32_t i = 0; i < s->gone._length; ++i) drop(w, s->gone._buffer[i]);
  w->step = s->step;
  return true;
}

/* Asks each world of which something is missing for all of it, twice a second. */
static void ask(dds_entity_t writer, uint32_t count) {
  const dds_time_t now = dds_time();
  for (uint32_t w = 0; w < count; ++w) {
    if (worlds[w].next > 0 || worlds[w].instance == 0 || now - worlds[w].asked < DDS_MSECS(500)) continue;
    worlds[w].asked = now;
    soda_wire_Lack lack = {.instance = worlds[w].instance, .world = w};
    (void)dds_write(writer, &lack);
  }
}

int main(int argc, char **argv) {
  if (argc < 4) {
    fprintf(stderr, "usage: cyclone_subscriber SESSION WORLDS LAST [SECONDS]\n");
    return 2;
  }
  const uint32_t count = (uint32_t)atoi(argv[2]);
  const int64_t last = atoll(argv[3]);
  int64_t printed = -1;
  bool ended = false;
  const double patience = argc > 4 ? atof(argv[4]) : 60;
  if (count == 0 || count > kMostWorlds) return 2;

  const dds_entity_t participant = dds_create_participant(DDS_DOMAIN_DEFAULT, NULL, NULL);
  dds_qos_t *qos = dds_create_qos();
  const char *partitions[] = {argv[1]};
  dds_qset_partition(qos, 1, partitions);
  const dds_entity_t subscriber = dds_create_subscriber(participant, qos, NULL);
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_ALL, 0);
  const dds_entity_t topic =
      dds_create_topic(participant, &soda_wire_Transforms_desc, "soda/transforms", NULL, NULL);
  const dds_entity_t reader = dds_create_reader(subscriber, topic, qos, NULL);
  const dds_entity_t lack_topic = dds_create_topic(participant, &soda_wire_Lack_desc, "soda/lack", NULL, NULL);
  const dds_entity_t publisher = dds_create_publisher(participant, qos, NULL);
  const dds_entity_t writer = dds_create_writer(publisher, lack_topic, qos, NULL);
  dds_delete_qos(qos);
  if (reader < 0 || writer < 0) {
    fprintf(stderr, "error: %s\n", dds_strretcode(reader < 0 ? -reader : -writer));
    return 1;
  }

  void *samples[kAtOnce] = {NULL};
  dds_sample_info_t infos[kAtOnce];
  const dds_time_t end = dds_time() + (dds_time_t)(patience * 1e9);
  while (!ended && dds_time() < end) {
    const dds_return_t n = dds_take(reader, samples, infos, kAtOnce, kAtOnce);
    ask(writer, count);
    if (n <= 0) {
      dds_sleepfor(DDS_MSECS(5));
      continue;
    }
    for (dds_return_t i = 0; i < n && !ended; ++i) {
      if (!infos[i].valid_data || !take(samples[i], count)) continue;
      bool same = true, final = true;
      size_t bodies = 0;
      double x = 0;
      for (uint32_t w = 0; w < count; ++w) {
        same = same && worlds[w].next > 0 && worlds[w].step == worlds[0].step;
        final = final && worlds[w].final_step >= last;
        bodies += worlds[w].bodies;
        for (size_t b = 0; b < worlds[w].bodies; ++b) x += worlds[w].x[b];
      }
      ended = same && final && worlds[0].step == last;
      if (!same || !isfinite(x) || (worlds[0].step == printed && !ended)) continue;
      printed = worlds[0].step;
      printf("%" PRId64 " %zu %.3f\n", worlds[0].step, bodies, x);
      fflush(stdout);
    }
    dds_return_loan(reader, samples, n);
  }
  dds_delete(participant);
  return !ended;
}
