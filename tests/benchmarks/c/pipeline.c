/* One process of the pipeline as a C program on Cyclone DDS: what the middleware costs without any Python. */

#include "process.h"

#include <stdlib.h>
#include <string.h>

#include "pipeline.h"

static dds_qos_t *qos;
static dds_entity_t forward_to; /* of the middle process */

static void publish(void) {
    dds_entity_t writer = create_writer(&Octets_desc, job.topic, qos);
    uint8_t *octets = calloc(job.size, 1);
    Octets item = {{job.size, job.size, octets, false}};
    int64_t due = monotonic_ns();
    while (!ended) {
        int64_t now = monotonic_ns();
        memcpy(octets, &now, sizeof now);
        write_item(writer, &item);
        pace(&due);
    }
}

static void forward(int reader, const void *item) {
    (void)reader;
    write_item(forward_to, item);
}

static void on_last(int reader, const void *item) {
    (void)reader;
    int64_t sent;
    memcpy(&sent, ((const Octets *)item)->data._buffer, sizeof sent);
    receive(sent, 0);
}

static void listen_to(const char *topic, void (*on_item)(int, const void *)) {
    dds_entity_t reader = create_reader(&Octets_desc, topic, qos);
    report_ready();
    spin(&reader, 1, on_item);
}

int main(int count_of_arguments, char **arguments) {
    begin(count_of_arguments, arguments);
    qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, job.depth);
    if (is_role("source")) {
        publish();
    } else if (is_role("middle")) {
        forward_to = create_writer(&Octets_desc, "last", qos);
        listen_to("first", forward);
    } else {
        listen_to("last", on_last);
    }
    dds_delete(DDS_CYCLONEDDS_HANDLE);
    return 0;
}
