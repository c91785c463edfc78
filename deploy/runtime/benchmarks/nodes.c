/* The round trip and the 100 Hz timer of nodes.py as a C program on Cyclone DDS: the least that they can cost.
 *
 *   idlc float64.idl && cc -O2 -I. -o nodes nodes.c float64.c -lddsc
 *   python run.py C=./nodes rclpy=python3
 *
 * The arguments are those of nodes.py, with its path before the role. Other roles end without figures.
 */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "dds/dds.h"
#include "float64.h"

#define PINGS 3000
#define SECOND 1000000000LL
#define MEASUREMENT (5 * SECOND)

static const char *configuration =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>";

static dds_entity_t participant;

static void check(const char *what, dds_return_t code) {
    if (code < 0) {
        fprintf(stderr, "%s: %s\n", what, dds_strretcode(code));
        exit(1);
    }
}

static int64_t now(clockid_t clock) {
    struct timespec time;
    clock_gettime(clock, &time);
    return time.tv_sec * SECOND + time.tv_nsec;
}

static dds_entity_t create_topic(const char *name) {
    dds_entity_t topic = dds_create_topic(participant, &Float64_desc, name, NULL, NULL);
    check(name, topic);
    return topic;
}

static dds_qos_t *queue(void) {
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1000);
    return qos;
}

/* Wait for one message; whether there is one. */
static int receive(dds_entity_t waitset, dds_entity_t reader, Float64 *message) {
    void *item = message;
    dds_sample_info_t info;
    check("wait", dds_waitset_wait(waitset, NULL, 0, DDS_SECS(1)));
    dds_return_t taken = dds_take(reader, &item, &info, 1, 1);
    check("take", taken);
    return taken == 1 && info.valid_data;
}

static int is_matched(dds_entity_t writer, dds_entity_t reader) {
    dds_publication_matched_status_t readers;
    dds_subscription_matched_status_t writers;
    check("matched", dds_get_publication_matched_status(writer, &readers));
    check("matched", dds_get_subscription_matched_status(reader, &writers));
    return readers.current_count && writers.current_count;
}

static int ascending(const void *left, const void *right) {
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return (a > b) - (a < b);
}

/* Answer each message (`is_ping` is 0), or send them and measure the time until the answer. */
static void exchange(int is_ping) {
    static int64_t times[PINGS];
    Float64 message = {1.0};
    dds_entity_t writer = dds_create_writer(participant, create_topic(is_ping ? "ping" : "pong"), queue(), NULL);
    dds_entity_t reader = dds_create_reader(participant, create_topic(is_ping ? "pong" : "ping"), queue(), NULL);
    check("writer", writer);
    check("reader", reader);
    dds_entity_t waitset = dds_create_waitset(participant);
    check("attach", dds_waitset_attach(waitset, dds_create_readcondition(reader, DDS_ANY_STATE), 0));
    while (!is_matched(writer, reader))
        dds_sleepfor(DDS_MSECS(10));
    if (!is_ping) {
        while (is_matched(writer, reader))
            if (receive(waitset, reader, &message))
                check("write", dds_write(writer, &message));
        return;
    }
    dds_sleepfor(DDS_MSECS(500)); /* until both directions are matched on both sides */
    for (int i = 0; i < PINGS; i++) {
        int64_t sent = now(CLOCK_MONOTONIC);
        check("write", dds_write(writer, &message));
        while (!receive(waitset, reader, &message))
            ;
        times[i] = now(CLOCK_MONOTONIC) - sent;
    }
    qsort(times + 100, PINGS - 100, sizeof *times, ascending);
    printf("{\"p50\": %.3f, \"p99\": %.3f}\n", (double)times[100 + (PINGS - 100) / 2] / 1e3,
           (double)times[100 + (PINGS - 100) / 100 * 99] / 1e3);
}

/* Wait for DDS until each tick is due, as an executor does; nothing else happens. */
static void timer(void) {
    dds_entity_t reader = dds_create_reader(participant, create_topic("unread"), queue(), NULL);
    dds_entity_t waitset = dds_create_waitset(participant);
    check("attach", dds_waitset_attach(waitset, dds_create_readcondition(reader, DDS_ANY_STATE), 0));
    dds_sleepfor(DDS_SECS(2));
    int64_t cpu = now(CLOCK_PROCESS_CPUTIME_ID), began = now(CLOCK_MONOTONIC), due = began, time = began;
    while (time < began + MEASUREMENT) {
        due += SECOND / 100;
        check("wait", dds_waitset_wait(waitset, NULL, 0, due > time ? due - time : 0));
        time = now(CLOCK_MONOTONIC);
    }
    double busy = (double)(now(CLOCK_PROCESS_CPUTIME_ID) - cpu) / (double)(time - began);
    printf("{\"cpu_percent\": %.4f}\n", 100 * busy);
}

int main(int count, char **arguments) {
    const char *role = arguments[count - 1], *domain = getenv("ROS_DOMAIN_ID");
    int is_ping = strcmp(role, "ping") == 0, is_timer = strcmp(role, "timer") == 0;
    if (!is_ping && !is_timer && strcmp(role, "echo") != 0)
        return 0;
    dds_domainid_t domain_id = (dds_domainid_t)atoi(domain ? domain : "0");
    check("domain", dds_create_domain(domain_id, configuration));
    participant = dds_create_participant(domain_id, NULL, NULL);
    check("participant", participant);
    if (is_timer)
        timer();
    else
        exchange(is_ping);
    dds_delete(DDS_CYCLONEDDS_HANDLE);
    return 0;
}
