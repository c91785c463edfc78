/* What every process of a measurement in C does: its job, its reports, its DDS entities. */

#ifndef PROCESS_H
#define PROCESS_H

#include <signal.h>
#include <stdint.h>

#include "dds/dds.h"

#define BATCH 64            /* samples that one call takes */
#define TURN DDS_MSECS(100) /* at most between two looks whether to end */
#define SECOND 1000000000LL

/* A Job of tests/benchmarks/link.py. */
extern struct job {
    const char *role;
    const char *topic;
    uint32_t size;  /* octets */
    double rate;    /* Hz; 0 is as fast as it can */
    double warm_up; /* s */
    double seconds; /* s */
    int32_t depth;
    const char *directory;
} job;

extern volatile sig_atomic_t ended;

/* Read the job, connect with the measurement, and join the domain.
 *
 *   PROGRAM ROLE TOPIC SIZE RATE WARM_UP SECONDS DEPTH DIRECTORY CONFIGURATION
 *
 * CONFIGURATION is that of Cyclone DDS as XML. The domain is ROS_DOMAIN_ID. */
void begin(int count_of_arguments, char **arguments);
void fail(const char *what, dds_return_t code);
int is_role(const char *role);
int64_t monotonic_ns(void);

/* Wait until an item is due. */
void pace(int64_t *due);

dds_entity_t create_writer(const dds_topic_descriptor_t *type, const char *topic, const dds_qos_t *qos);
dds_entity_t create_reader(const dds_topic_descriptor_t *type, const char *topic, const dds_qos_t *qos);
void write_item(dds_entity_t writer, const void *item);

/* Take items from readers until the end: `on_item` gets each with the index of its reader. */
void spin(const dds_entity_t *readers, int count, void (*on_item)(int reader, const void *item));

/* Report that this process listens; the others may start. */
void report_ready(void);

/* Note the latency of an item in the sink, as tests/benchmarks/worker.py does. */
void receive(int64_t sent_at, int64_t sent_so_far);

#endif
