#include "process.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

struct job job;
volatile sig_atomic_t ended = 0;
static int reports = -1;
static dds_entity_t participant;

static void end(int number) {
    (void)number;
    ended = 1;
}

void fail(const char *what, dds_return_t code) {
    fprintf(stderr, "%s: %s\n", what, dds_strretcode(code));
    exit(1);
}

int is_role(const char *role) {
    return strcmp(job.role, role) == 0;
}

int64_t monotonic_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * SECOND + now.tv_nsec;
}

void pace(int64_t *due) {
    if (job.rate <= 0)
        return;
    int64_t now = monotonic_ns();
    *due += (int64_t)(1e9 / job.rate);
    if (*due < now)
        *due = now; /* one that is late shifts the following ones */
    struct timespec until = {*due / SECOND, *due % SECOND};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

static void open_reports(void) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    snprintf(address.sun_path, sizeof address.sun_path, "%s/reports", job.directory);
    reports = socket(AF_UNIX, SOCK_DGRAM, 0);
    if (connect(reports, (struct sockaddr *)&address, sizeof address) != 0) {
        perror(address.sun_path);
        exit(1);
    }
}

void begin(int count_of_arguments, char **arguments) {
    const char *domain_id = getenv("ROS_DOMAIN_ID");
    if (count_of_arguments != 10 || domain_id == NULL) {
        fprintf(stderr, "only for make bench\n");
        exit(2);
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
    job.directory = arguments[8];
    open_reports();
    dds_domainid_t domain = (dds_domainid_t)atoi(domain_id);
    dds_entity_t created = dds_create_domain(domain, arguments[9]);
    if (created < 0)
        fail("domain", created);
    participant = dds_create_participant(domain, NULL, NULL);
    if (participant < 0)
        fail("participant", participant);
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

void report_ready(void) {
    report("ready", ", \"pid\": %d", (int)getpid());
}

static int64_t *latencies;
static size_t count, room;

static int ascending(const void *left, const void *right) {
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return (a > b) - (a < b);
}

static void report_end(double seconds, int64_t sent) {
    qsort(latencies, count, sizeof *latencies, ascending);
    report("end", ", \"seconds\": %.6f, \"count\": %zu, \"sent\": %lld, \"p50\": %.6f, \"p99\": %.6f", seconds, count,
           (long long)sent, (double)latencies[count / 2] / 1e6, (double)latencies[count * 99 / 100] / 1e6);
}

void receive(int64_t sent_at, int64_t sent_so_far) {
    static int64_t phase_began, sent_before;
    static int measuring;
    int64_t now = monotonic_ns();
    if (count == room) {
        room = room ? 2 * room : 4096;
        latencies = realloc(latencies, room * sizeof *latencies);
    }
    latencies[count++] = now - sent_at;
    if (phase_began == 0) {
        phase_began = now;
        report("first", ", \"time\": %.6f", (double)now / 1e9);
    }
    double seconds = (double)(now - phase_began) / 1e9;
    if (!measuring && seconds >= job.warm_up) {
        measuring = 1;
        phase_began = now;
        sent_before = sent_so_far;
        count = 0;
        report("begin", "");
    } else if (measuring && seconds >= job.seconds) {
        report_end(seconds, sent_so_far - sent_before);
        phase_began = INT64_MAX / 2; /* once */
    }
}

static dds_entity_t create_topic(const dds_topic_descriptor_t *type, const char *name) {
    dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
    if (topic < 0)
        fail(name, topic);
    return topic;
}

dds_entity_t create_writer(const dds_topic_descriptor_t *type, const char *topic, const dds_qos_t *qos) {
    dds_entity_t writer = dds_create_writer(participant, create_topic(type, topic), qos, NULL);
    if (writer < 0)
        fail("writer", writer);
    return writer;
}

dds_entity_t create_reader(const dds_topic_descriptor_t *type, const char *topic, const dds_qos_t *qos) {
    dds_entity_t reader = dds_create_reader(participant, create_topic(type, topic), qos, NULL);
    if (reader < 0)
        fail("reader", reader);
    return reader;
}

void write_item(dds_entity_t writer, const void *item) {
    dds_return_t code = dds_write(writer, item);
    if (code < 0 && code != DDS_RETCODE_TIMEOUT)
        fail("write", code);
}

static void take(dds_entity_t reader, int index, void (*on_item)(int reader, const void *item)) {
    void *items[BATCH] = {NULL};
    dds_sample_info_t infos[BATCH];
    dds_return_t taken = dds_take(reader, items, infos, BATCH, BATCH);
    if (taken < 0)
        fail("take", taken);
    for (dds_return_t i = 0; i < taken; i++)
        if (infos[i].valid_data)
            on_item(index, items[i]);
    if (taken > 0)
        dds_return_loan(reader, items, taken);
}

void spin(const dds_entity_t *readers, int count_of_readers, void (*on_item)(int reader, const void *item)) {
    dds_entity_t arrivals = dds_create_waitset(participant);
    for (int i = 0; i < count_of_readers; i++)
        dds_waitset_attach(arrivals, dds_create_readcondition(readers[i], DDS_ANY_STATE), i);
    while (!ended) {
        dds_attach_t triggered[BATCH];
        dds_return_t ready = dds_waitset_wait(arrivals, triggered, BATCH, TURN);
        for (dds_return_t i = 0; i < ready && i < BATCH; i++)
            take(readers[triggered[i]], (int)triggered[i], on_item);
    }
}
