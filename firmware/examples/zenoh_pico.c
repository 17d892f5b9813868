/* One robot over zenoh-pico 1.x, on Linux or another system with POSIX clocks.

     make -f firmware/examples/zenoh_pico.mk ZENOH_PICO=/where/its/sources/are
     robot tcp/HOST:PORT FLEET ROBOT X Y HEADING

   A task of zenoh-pico's receives: its sockets wait for up to 100 ms, which the loop must not.  The
   base is one without errors, in place of a driver. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <zenoh-pico.h>

#include "loop.h"

#define WAITING 8

typedef struct {
    int kind;
    size_t length;
    int64_t heard_ns;
    uint8_t bytes[1500];
} message;

static z_owned_session_t session;
static z_owned_mutex_t lock;
static message waiting[WAITING];
static unsigned first, count;
static const char *fleet, *name;

static int64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* Called by zenoh-pico's receive task; `context` is the kind of key. */
static void received(z_loaned_sample_t *sample, void *context) {
    z_bytes_reader_t reader = z_bytes_get_reader(z_sample_payload(sample));
    z_mutex_lock(z_loan_mut(lock));
    if (count < WAITING) {
        message *next = &waiting[(first + count) % WAITING];
        next->kind = (int)(intptr_t)context;
        next->heard_ns = now_ns();
        next->length = z_bytes_reader_read(&reader, next->bytes, sizeof next->bytes);
        if (z_bytes_reader_remaining(&reader) == 0) count++;
    }
    z_mutex_unlock(z_loan_mut(lock));
}

static int take(void *link, uint8_t *bytes, size_t most, size_t *length, int64_t *heard_ns) {
    int kind = SF_NOTHING;
    (void)link;
    z_mutex_lock(z_loan_mut(lock));
    while (count > 0 && kind == SF_NOTHING) {
        const message *next = &waiting[first];
        if (next->length <= most) {
            kind = next->kind;
            *length = next->length;
            *heard_ns = next->heard_ns;
            memcpy(bytes, next->bytes, next->length);
        }
        first = (first + 1) % WAITING;
        count--;
    }
    z_mutex_unlock(z_loan_mut(lock));
    return kind;
}

static void key_of(char *key, size_t size, const char *kind) {
    bool all = strcmp(kind, "command") == 0;
    snprintf(key, size, "splinefleet/%s/%s%s%s", fleet, kind, all ? "" : "/", all ? "" : name);
}

static void say(void *link, int kind, const uint8_t *bytes, size_t length) {
    const char *word = kind == SF_HELLO ? "hello" : kind == SF_CLOCK ? "clock" : "report";
    char key[128];
    z_view_keyexpr_t place;
    z_owned_bytes_t payload;
    (void)link;
    key_of(key, sizeof key, word);
    z_view_keyexpr_from_str(&place, key);
    z_bytes_copy_from_buf(&payload, bytes, length);
    z_put(z_loan(session), z_loan(place), z_move(payload), NULL);
}

static bool subscribe(const char *kind, int number) {
    static z_owned_subscriber_t subscribers[3];
    static char keys[3][128];
    static int declared;
    z_view_keyexpr_t place;
    z_owned_closure_sample_t callback;
    char *key = keys[declared];
    key_of(key, sizeof keys[0], kind);
    z_view_keyexpr_from_str(&place, key);
    z_closure(&callback, received, NULL, (void *)(intptr_t)number);
    z_owned_subscriber_t *subscriber = &subscribers[declared++];
    return z_declare_subscriber(z_loan(session), subscriber, z_loan(place), z_move(callback), NULL) == 0;
}

/* ---- a base without errors ---- */

typedef struct {
    sf_real x, y, heading;
} base;

static bool pose(void *self, sf_real *x, sf_real *y, sf_real *heading) {
    const base *at = self;
    *x = at->x;
    *y = at->y;
    *heading = at->heading;
    return true;
}

static void drive(void *self, sf_real speed, sf_real curvature, sf_real distance) {
    base *at = self;
    sf_real way = speed * (sf_real)0.01, half;
    if (way > distance) way = distance;
    half = way * curvature / 2;
    at->x += way * cosf(at->heading + half);
    at->y += way * sinf(at->heading + half);
    at->heading += 2 * half;
}

static void turn(void *self, sf_real angle) {
    base *at = self;
    at->heading += angle > (sf_real)0.02 ? (sf_real)0.02 : angle < (sf_real)-0.02 ? (sf_real)-0.02 : angle;
}

static bool is_well(void *self) {
    (void)self;
    return true;
}

/* `z_open` tries once, so a robot that is switched on before its coordinator tries again. */
static void open_session(const char *endpoint) {
    for (;;) {
        z_owned_config_t config;
        z_config_default(&config);
        zp_config_insert(z_loan_mut(config), Z_CONFIG_MODE_KEY, "client");
        zp_config_insert(z_loan_mut(config), Z_CONFIG_CONNECT_KEY, endpoint);
        if (z_open(&session, z_move(config), NULL) == 0) break;
        nanosleep(&(struct timespec){.tv_sec = 1}, NULL);
    }
    zp_start_read_task(z_loan_mut(session), NULL);
    zp_start_lease_task(z_loan_mut(session), NULL);
}

int main(int argc, char **argv) {
    static sf_loop loop;
    static sf_robot robot = {.radius = 0.15, .period_ns = 10000000};
    static z_owned_liveliness_token_t token;
    static char alive[128];
    if (argc != 7) {
        fprintf(stderr, "robot ENDPOINT FLEET ROBOT X Y HEADING\n");
        return 2;
    }
    fleet = argv[2];
    name = robot.id = argv[3];
    base at = {(sf_real)atof(argv[4]), (sf_real)atof(argv[5]), (sf_real)atof(argv[6])};
    srandom((unsigned)(now_ns() ^ time(NULL)));
    robot.boot = (uint32_t)random();
    z_mutex_init(&lock);
    open_session(argv[1]);
    if (!subscribe("command", SF_COMMAND) || !subscribe("plan", SF_PLAN) || !subscribe("clock", SF_CLOCK))
        return 1;
    z_view_keyexpr_t place;
    key_of(alive, sizeof alive, "alive");
    z_view_keyexpr_from_str(&place, alive);
    z_liveliness_declare_token(z_loan(session), &token, z_loan(place), NULL);
    const sf_driver driver = {&at, pose, drive, turn, is_well};
    const sf_link link = {NULL, take, say};
    sf_loop_begin(&loop, &robot, &driver, &link);
    int64_t next_ns = now_ns();
    while (sf_loop_tick(&loop, now_ns())) {
        next_ns += robot.period_ns;
        int64_t left = next_ns - now_ns();
        if (left > 0) nanosleep(&(struct timespec){.tv_nsec = (long)left}, NULL);
        else next_ns -= left; /* Ticks that were missed are not made up for. */
    }
    z_close(z_loan_mut(session), NULL);
    return 0;
}
