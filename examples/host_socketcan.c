/* A complete host for two ODrives on SocketCAN: arm, ramp the torque, read the encoders, stop.
 *
 *     cc -std=c11 -Wall -Wextra -Werror -o host_socketcan host_socketcan.c
 *     ./host_socketcan can0 0.02          # interface, peak torque at the shafts [N m]; nodes 0 and 1
 *
 * The same as host.py. Frames are those of ODrive's CANSimple (firmware 0.6): the identifier is
 * node << 5 | command, numbers are little endian, torques are the shaft's. It waits for the heartbeats
 * of both drives, clears old errors, sends set-points all the time (the watchdog of an armed drive
 * waits for them), stops both wheels if one drive reports an error, leaves closed loop or falls
 * silent, and leaves the drives idle however it ends, by Ctrl-C or SIGTERM too.
 *
 * Exit status: 0 all well, 1 a drive failed, 2 usage or no such interface, 128 + its number after a
 * signal.
 */
#define _DEFAULT_SOURCE
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <math.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum command {
    HEARTBEAT = 0x01,
    SET_AXIS_STATE = 0x07,
    ENCODER = 0x09,
    SET_MODE = 0x0B,
    SET_INPUT_TORQUE = 0x0E,
    CLEAR_ERRORS = 0x18,
};
enum { IDLE = 1, CLOSED_LOOP = 8 };               /* axis states */
enum { TORQUE_CONTROL = 1, PASSTHROUGH = 1 };     /* modes */
enum { AXES = 2 };

static const double PERIOD_S = 0.01, SILENT_S = 0.5, WITHIN_S = 2.0;
static const double UP_S = 0.5, HOLD_S = 1.0;

struct axis {
    uint32_t node, errors;
    uint8_t state;
    double heard_s; /* of the last heartbeat; 0: none yet */
    float position_rev, velocity_rev_s;
};

struct host {
    int socket;
    struct axis axes[AXES];
};

static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    interrupted = number;
}

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* --- bytes: little endian whatever the processor is ------------------------------------------- */

static void put_u32(uint8_t *at, uint32_t value)
{
    for (int n = 0; n < 4; n++)
        at[n] = (uint8_t)(value >> 8 * n);
}

static uint32_t get_u32(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static void put_float(uint8_t *at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_u32(at, bits);
}

static float get_float(const uint8_t *at)
{
    uint32_t bits = get_u32(at);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* --- the bus ------------------------------------------------------------------------------------ */

static int open_bus(const char *interface)
{
    struct sockaddr_can address = {.can_family = AF_CAN};
    struct ifreq request = {0};
    int opened = socket(PF_CAN, SOCK_RAW, CAN_RAW);

    if (opened < 0 || strlen(interface) >= sizeof request.ifr_name)
        return -1;
    strcpy(request.ifr_name, interface);
    if (ioctl(opened, SIOCGIFINDEX, &request) < 0)
        return -1;
    address.can_ifindex = request.ifr_ifindex;
    return bind(opened, (struct sockaddr *)&address, sizeof address) < 0 ? -1 : opened;
}

/* A full queue is no reason to stop here: what the drives miss, their watchdogs and we notice. */
static void say(struct host *host, enum command command, const uint8_t *data, uint8_t size)
{
    for (int n = 0; n < AXES; n++) {
        struct can_frame frame = {.can_id = host->axes[n].node << 5 | (uint32_t)command};
        frame.can_dlc = size;
        memcpy(frame.data, data, size);
        if (write(host->socket, &frame, sizeof frame) < 0 && errno != ENOBUFS && errno != EINTR)
            perror("host_socketcan: send");
    }
}

static void say_u32(struct host *host, enum command command, uint32_t value)
{
    uint8_t data[4];
    put_u32(data, value);
    say(host, command, data, sizeof data);
}

static void hear(struct axis *axis, const struct can_frame *frame)
{
    const uint8_t *data = frame->data;
    uint32_t command = frame->can_id & 0x1F;

    if (command == HEARTBEAT && frame->can_dlc >= 7) {
        axis->errors = get_u32(data);
        axis->state = data[4];
        axis->heard_s = now_s();
    } else if (command == ENCODER && frame->can_dlc >= 8) {
        axis->position_rev = get_float(data);
        axis->velocity_rev_s = get_float(data + 4);
    }
}

static void listen_until(struct host *host, double deadline_s)
{
    struct pollfd readable = {.fd = host->socket, .events = POLLIN};
    double left_s;

    while ((left_s = deadline_s - now_s()) > 0.0) {
        struct can_frame frame;
        if (poll(&readable, 1, (int)(1e3 * left_s) + 1) <= 0)
            continue;
        if (read(host->socket, &frame, sizeof frame) != (ssize_t)sizeof frame)
            continue;
        if (frame.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG))
            continue;
        for (int n = 0; n < AXES; n++)
            if (frame.can_id >> 5 == host->axes[n].node)
                hear(&host->axes[n], &frame);
    }
}

static void torque(struct host *host, float torque_N_m)
{
    double deadline_s = now_s() + PERIOD_S;
    uint8_t data[4];

    put_float(data, torque_N_m);
    say(host, SET_INPUT_TORQUE, data, sizeof data);
    listen_until(host, deadline_s);
}

/* --- what a host does --------------------------------------------------------------------------- */

static bool is_heard(const struct axis *axis) { return axis->heard_s > 0.0; }
static bool has_no_errors(const struct axis *axis) { return axis->errors == 0; }
static bool is_armed(const struct axis *axis) { return axis->state == CLOSED_LOOP; }
static bool is_disarmed(const struct axis *axis) { return axis->state != CLOSED_LOOP; }

/* Zero torque until `done` holds for both drives, which feeds their watchdogs. */
static bool await(struct host *host, bool (*done)(const struct axis *), const char *complaint)
{
    double deadline_s = now_s() + WITHIN_S;
    for (;;) {
        const struct axis *waiting = NULL;
        for (int n = 0; n < AXES; n++)
            if (!done(&host->axes[n]))
                waiting = &host->axes[n];
        if (waiting == NULL)
            return true;
        if (now_s() > deadline_s) {
            fprintf(stderr, "host_socketcan: node %u: %s, errors 0x%08x\n", waiting->node, complaint,
                    waiting->errors);
            return false;
        }
        torque(host, 0.0f);
    }
}

static bool arm(struct host *host)
{
    uint8_t modes[8], nothing[1] = {0};

    if (!await(host, is_heard, "no heartbeat"))
        return false;
    put_u32(modes, TORQUE_CONTROL);
    put_u32(modes + 4, PASSTHROUGH);
    say(host, CLEAR_ERRORS, nothing, sizeof nothing);
    say(host, SET_MODE, modes, sizeof modes);
    if (!await(host, has_no_errors, "errors stay"))
        return false;
    say_u32(host, SET_AXIS_STATE, CLOSED_LOOP);
    if (!await(host, is_armed, "does not arm"))
        return false;
    puts("armed");
    return true;
}

static bool stop(struct host *host)
{
    uint8_t zero[4] = {0};

    say(host, SET_INPUT_TORQUE, zero, sizeof zero);
    say_u32(host, SET_AXIS_STATE, IDLE);
    if (!await(host, is_disarmed, "does not become idle"))
        return false;
    puts("idle");
    return true;
}

static bool may_go_on(const struct host *host)
{
    for (int n = 0; n < AXES; n++) {
        const struct axis *axis = &host->axes[n];
        const char *what = NULL;
        if (axis->errors != 0)
            what = "errors";
        else if (!is_armed(axis))
            what = "left closed loop";
        else if (now_s() - axis->heard_s > SILENT_S)
            what = "no heartbeat";
        if (what != NULL) {
            fprintf(stderr, "host_socketcan: node %u: %s, state %u, errors 0x%08x\n", axis->node,
                    what, axis->state, axis->errors);
            return false;
        }
    }
    return true;
}

static double ramp(double t_s, double peak_N_m)
{
    double share = t_s < UP_S ? t_s / UP_S : (2.0 * UP_S + HOLD_S - t_s) / UP_S;
    return peak_N_m * (share > 1.0 ? 1.0 : share < 0.0 ? 0.0 : share);
}

static bool drive(struct host *host, double peak_N_m)
{
    int periods = (int)((2.0 * UP_S + HOLD_S) / PERIOD_S);

    for (int n = 0; n <= periods && !interrupted; n++) {
        double torque_N_m = ramp(n * PERIOD_S, peak_N_m);
        torque(host, (float)torque_N_m);
        if (!may_go_on(host))
            return false;
        if (n % 10 == 0)
            printf("%5.2f s  %+6.3f N m  %+8.3f rev %+7.3f rev/s  %+8.3f rev %+7.3f rev/s\n",
                   n * PERIOD_S, torque_N_m, host->axes[0].position_rev,
                   host->axes[0].velocity_rev_s, host->axes[1].position_rev,
                   host->axes[1].velocity_rev_s);
    }
    return true;
}

int main(int count, char **arguments)
{
    struct host host = {.axes = {{.node = 0}, {.node = 1}}};
    struct sigaction action = {.sa_handler = on_signal};
    double torque_N_m;
    char *end;
    bool well;

    if (count != 3) {
        fprintf(stderr, "usage: host_socketcan INTERFACE TORQUE_N_M\n");
        return 2;
    }
    torque_N_m = strtod(arguments[2], &end);
    if (end == arguments[2] || *end || !isfinite(torque_N_m)) {
        fprintf(stderr, "%s: not a torque in N m\n", arguments[2]);
        return 2;
    }
    host.socket = open_bus(arguments[1]);
    if (host.socket < 0) {
        perror(arguments[1]);
        return 2;
    }
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    well = arm(&host) && drive(&host, torque_N_m);
    well = stop(&host) && well;
    close(host.socket);
    return interrupted ? 128 + interrupted : well ? 0 : 1;
}
