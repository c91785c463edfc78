/* One process of a measurement as a C program on Cyclone DDS: what the middleware costs without any Python.
 *
 *   peer ROLE TOPIC SIZE RATE WARM_UP SECONDS DEPTH REPORTS CONFIGURATION
 *
 * The first arguments are those of a Job (deploy/benchmarks/link.py); REPORTS is the path of the measurement's
 * socket, CONFIGURATION that of Cyclone DDS as XML. The domain is ROS_DOMAIN_ID. The program does what
 * deploy/benchmarks/worker.py does, and reports the same events and figures.
 */

#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "dds/dds.h"
#include "octets.h"

#define BATCH 64            /* samples that one call takes */
#define TURN DDS_MSECS(100) /* at most between two looks whether to end */
#define SECOND 1000000000LL

static struct {
    const char *role;
    const char *topic;
    uint32_t size;   /* octets */
    double rate;     /* Hz; 0 is as fast as it can */
    double warm_up;  /* s */
    double seconds;  /* s */
    int32_t depth;
    const char *reports;
} job;

static volatile sig_atomic_t ended = 0;
static int reports = -1;
static dds_entity_t participant;
static dds_entity_t forward_to; /* of the middle process */

static void end(int number) {
    (void)number;
    ended = 1;
}

static void fail(const char *what, dds_return_t code) {
    fprintf(stderr, "%s: %s\n", what, dds_strretcode(code));
    exit(1);
}

static int64_t monotonic_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * SECOND + now.tv_nsec;
}

static void open_reports(void) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    snprintf(address.sun_path, sizeof address.sun_path, "%s", job.reports);
    reports = socket(AF_UNIX, SOCK_DGRAM, 0);
    if (connect(reports, (struct sockaddr *)&address, sizeof address) != 0) {
        perror(job.reports);
        exit(1);
    }
}

/* Sends an event with its figures, the inner part of a JSON object that begins with a comma. */
static void report(const char *event, const char *figures, ...) {
    char inner[256], text[384];
    va_list values;
    va_start(values, figures);
    vsnprintf(inner, sizeof inner, figures, values);
    va_end(values);
    int length = snprintf(text, sizeof text, "{\"role\": \"%s\", \"event\": \"%s\"%s}", job.role, event, inner);
    if (send(reports, text, (size_t)length, 0) < 0)
        perror("report");
}

static int64_t *latencies;
static size_t count, room;
static int64_t phase_began;
static int measuring;

static int ascending(const void *left, const void *right) {
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return (a > b) - (a < b);
}

static void report_end(double seconds) {
    qsort(latencies, count, sizeof *latencies, ascending);
    report("end", ", \"seconds\": %.6f, \"count\": %zu, \"p50\": %.6f, \"p99\": %.6f", seconds, count,
           (double)latencies[count / 2] / 1e6, (double)latencies[count * 99 / 100] / 1e6);
}

/* Notes the latency of an item in the sink. */
static void receive(const Octets *item) {
    int64_t now = monotonic_ns(), sent;
    memcpy(&sent, item->data._buffer, sizeof sent);
    if (count == room) {
        room = room ? 2 * room : 4096;
        latencies = realloc(latencies, room * sizeof *latencies);
    }
    latencies[count++] = now - sent;
    if (phase_began == 0) {
        phase_began = now;
        report("first", ", \"time\": %.6f", (double)now / 1e9);
    }
    double seconds = (double)(now - phase_began) / 1e9;
    if (!measuring && seconds >= job.warm_up) {
        measuring = 1;
        phase_began = now;
        count = 0;
        report("begin", "");
    } else if (measuring && seconds >= job.seconds) {
        report_end(seconds);
        phase_began = INT64_MAX / 2; /* once */
    }
}

static void forward(const Octets *item) {
    dds_return_t code = dds_write(forward_to, item);
    if (code < 0)
        fail("write", code);
}

static dds_entity_t create_topic(const char *name) {
    dds_entity_t topic = dds_create_topic(participant, &Octets_desc, name, NULL, NULL);
    if (topic < 0)
        fail(name, topic);
    return topic;
}

static dds_qos_t *quality(void) {
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, job.depth);
    return qos;
}

static dds_entity_t create_writer(const char *topic) {
    dds_entity_t writer = dds_create_writer(participant, create_topic(topic), quality(), NULL);
    if (writer < 0)
        fail("writer", writer);
    return writer;
}

static void publish(void) {
    dds_entity_t writer = create_writer(job.topic);
    uint8_t *octets = calloc(job.size, 1);
    Octets item = {{job.size, job.size, octets, false}};
    int64_t due = monotonic_ns();
    while (!ended) {
        int64_t now = monotonic_ns();
        memcpy(octets, &now, sizeof now);
        dds_return_t code = dds_write(writer, &item);
        if (code < 0 && code != DDS_RETCODE_TIMEOUT)
            fail("write", code);
        if (job.rate > 0) {
            due += (int64_t)(1e9 / job.rate);
            struct timespec until = {due / SECOND, due % SECOND};
            clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        }
    }
}

static void listen_to(const char *topic, void (*on_item)(const Octets *)) {
    dds_entity_t reader = dds_create_reader(participant, create_topic(topic), quality(), NULL);
    if (reader < 0)
        fail("reader", reader);
    dds_entity_t arrivals = dds_create_waitset(participant);
    dds_waitset_attach(arrivals, dds_create_readcondition(reader, DDS_ANY_STATE), 0);
    report("ready", ", \"pid\": %d", (int)getpid());
    while (!ended) {
        void *items[BATCH] = {NULL};
        dds_sample_info_t infos[BATCH];
        dds_waitset_wait(arrivals, NULL, 0, TURN);
        dds_return_t taken = dds_take(reader, items, infos, BATCH, BATCH);
        if (taken < 0)
            fail("take", taken);
        for (dds_return_t i = 0; i < taken; i++)
            if (infos[i].valid_data)
                on_item(items[i]);
        if (taken > 0)
            dds_return_loan(reader, items, taken);
    }
}

int main(int count_of_arguments, char **arguments) {
    const char *domain_id = getenv("ROS_DOMAIN_ID");
    if (count_of_arguments != 10 || domain_id == NULL) {
        fprintf(stderr, "only for make bench\n");
        return 2;
    }
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    signal(SIGTERM, end);
    job.role = arguments[1];
    job.topic = arguments[2];
    job.size = (uint32_t)atoi(arguments[3]);
    job.rate = atof(arguments[4]);
    job.warm_up = atof(arguments[5]);
    job.seconds = atof(arguments[6]);
    job.depth = atoi(arguments[7]);
    job.reports = arguments[8];
    open_reports();
    dds_domainid_t domain = (dds_domainid_t)atoi(domain_id);
    dds_entity_t created = dds_create_domain(domain, arguments[9]);
    if (created < 0)
        fail("domain", created);
    participant = dds_create_participant(domain, NULL, NULL);
    if (participant < 0)
        fail("participant", participant);
    if (strcmp(job.role, "source") == 0) {
        publish();
    } else if (strcmp(job.role, "middle") == 0) {
        forward_to = create_writer("last");
        listen_to("first", forward);
    } else {
        listen_to("last", receive);
    }
    dds_delete(DDS_CYCLONEDDS_HANDLE);
    return 0;
}
