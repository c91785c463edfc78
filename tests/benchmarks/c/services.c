/* One process of the arm's own chain, or a reader of the operator's heartbeats, as a C program on Cyclone DDS. */

#include "process.h"

#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "services.h"

static int64_t *memory; /* as in links/chain.py: the time of the latest item, and how many there were */

static void share_memory(void) {
    char path[256];
    snprintf(path, sizeof path, "%s/sent", job.directory);
    int file = open(path, O_RDWR | O_CREAT, 0600);
    if (file < 0 || ftruncate(file, 16) != 0) {
        perror(path);
        exit(1);
    }
    memory = mmap(NULL, 16, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
}

/* The QoS of most topics of the contract. */
static dds_qos_t *keep_last(int depth, dds_durability_kind_t durability) {
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_durability(qos, durability);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
    return qos;
}

static dds_qos_t *state(void) {
    return keep_last(1, DDS_DURABILITY_TRANSIENT_LOCAL);
}

static dds_qos_t *events(void) {
    return keep_last(10, DDS_DURABILITY_VOLATILE);
}

static const char *angles[] = {"l1", "l2", "theta1", "theta2"};
enum { L1, L2, THETA1, THETA2 };

static void turn(void) {
    const Number one = {1.0};
    for (int i = L1; i <= THETA2; i++)
        if (i != THETA1)
            write_item(create_writer(&Number_desc, angles[i], state()), &one);
    dds_entity_t writer = create_writer(&Number_desc, angles[THETA1], state());
    int64_t due = monotonic_ns();
    while (!ended) {
        memory[0] = monotonic_ns();
        memory[1] += 1;
        Number angle = {(double)(memory[1] % 1000) / 1000};
        write_item(writer, &angle);
        pace(&due);
    }
}

static dds_entity_t output;

static void on_angle(int reader, const void *item) {
    static double known[4];
    static unsigned present;
    known[reader] = ((const Number *)item)->data;
    present |= 1u << reader;
    if (present != 15)
        return;
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    double heading = known[THETA1] + known[THETA2];
    Position position = {.sec = (int32_t)now.tv_sec, .nanosec = (uint32_t)now.tv_nsec, .frame_id = "base"};
    position.x = known[L1] * cos(known[THETA1]) + known[L2] * cos(heading);
    position.y = known[L1] * sin(known[THETA1]) + known[L2] * sin(heading);
    write_item(output, &position);
}

static void on_position(int reader, const void *item) {
    static double x, y, time;
    static int known;
    const Position *now = item;
    double then = time, moved = hypot(now->x - x, now->y - y);
    (void)reader;
    x = now->x, y = now->y, time = now->sec + now->nanosec / 1e9;
    if (known && time > then) {
        Number speed = {moved / (time - then)};
        write_item(output, &speed);
    }
    known = 1;
}

static void on_speed(int reader, const void *item) {
    (void)reader;
    (void)item;
    receive(memory[0], memory[1]);
}

static void kinematics(void) {
    dds_entity_t readers[4];
    output = create_writer(&Position_desc, "position", state());
    for (int i = L1; i <= THETA2; i++)
        readers[i] = create_reader(&Number_desc, angles[i], state());
    report_ready();
    spin(readers, 4, on_angle);
}

static void velocity(void) {
    output = create_writer(&Number_desc, "speed", events());
    dds_entity_t reader = create_reader(&Position_desc, "position", state());
    report_ready();
    spin(&reader, 1, on_position);
}

static void sink(void) {
    dds_entity_t reader = create_reader(&Number_desc, "speed", events());
    report_ready();
    spin(&reader, 1, on_speed);
}

/* The QoS and the names of the heartbeats are those of ROS 2: the services hear them. */
static dds_qos_t *heartbeats(void) {
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
    dds_qset_lifespan(qos, DDS_MSECS(500));
    return qos;
}

#define HEARTBEATS &std_msgs_msg_dds__Bool__desc, "rt/operator_heartbeat", heartbeats()

static void press(void) {
    const std_msgs_msg_dds__Bool_ pressed = {true};
    dds_entity_t writer = create_writer(HEARTBEATS);
    int64_t due = monotonic_ns();
    while (!ended) {
        write_item(writer, &pressed);
        pace(&due);
    }
}

static void source(void) {
    if (strcmp(job.topic, "operator_heartbeat") == 0)
        press();
    else
        turn();
}

/* Do what the service does, which reads the newest heartbeat ten times a second, and nothing else. */
static void watch(void) {
    dds_entity_t reader = create_reader(HEARTBEATS);
    report_ready();
    while (!ended) {
        void *item[1] = {NULL};
        dds_sample_info_t info[1];
        dds_sleepfor(TURN);
        dds_return_t taken = dds_take(reader, item, info, 1, 1);
        if (taken > 0)
            dds_return_loan(reader, item, taken);
    }
}

int main(int count_of_arguments, char **arguments) {
    static const struct {
        const char *name;
        void (*work)(void);
    } roles[] = {
        {"source", source}, {"kinematics", kinematics}, {"velocity", velocity},
        {"sink", sink},     {"watchdog", watch},
    };
    begin(count_of_arguments, arguments);
    share_memory();
    for (size_t i = 0; i < sizeof roles / sizeof *roles; i++)
        if (is_role(roles[i].name))
            roles[i].work();
    dds_delete(DDS_CYCLONEDDS_HANDLE);
    return 0;
}
