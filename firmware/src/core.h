/* What the parts of the core share.  Not for the program around it. */

#ifndef SPLINEFLEET_CORE_H
#define SPLINEFLEET_CORE_H

#include "splinefleet.h"

/* Of the C library, declared here because a freestanding compiler has no string.h and math.h. */
void *memset(void *memory, int byte, size_t bytes);
#ifdef SF_DOUBLE
double fabs(double), sqrt(double), sin(double), cos(double), atan2(double, double);
#define SF_NAME(function) function
#else
float fabsf(float), sqrtf(float), sinf(float), cosf(float), atan2f(float, float);
#define SF_NAME(function) function##f
#endif
#define SF_SIN SF_NAME(sin)
#define SF_COS SF_NAME(cos)
#define SF_ATAN2 SF_NAME(atan2)
#if defined(__GNUC__) /* One instruction each, which a freestanding compiler does not know. */
#define SF_INF ((sf_real)__builtin_inff())
#define sf_abs SF_NAME(__builtin_fabs)
#define SF_SQRT SF_NAME(__builtin_sqrt)
#else
#define SF_INF ((sf_real)(1.0f / 0.0f))
#define sf_abs SF_NAME(fabs)
#define SF_SQRT SF_NAME(sqrt)
#endif

/* For functions that make callers longer where compilers copy them in, even with -Os. */
#if defined(__GNUC__)
#define SHARED __attribute__((noinline))
#else
#define SHARED
#endif

#define R(number) ((sf_real)(number))

#define MILLISECOND ((int64_t)1000000)
#define SECOND ((int64_t)1000000000)
#define COMMAND_PERIOD (100 * MILLISECOND)
#define SEND_PERIOD (200 * MILLISECOND) /* of Reports, and of Hellos */
#define COORDINATOR_TIMEOUT (2 * SECOND)
#define CLOCK_ERROR_MS 10
#define CLOCK_RESERVE_MS 2
#define CLOCK_PERIOD_FAST (40 * MILLISECOND)
#define CLOCK_PERIOD (2 * SECOND)
#define CLOCK_SAMPLES 8
#define LATE_STEP_MS 50
#define SETTLING_LENGTH R(0.1)
#define LED_OFF (R(0.37) * SETTLING_LENGTH)

#ifdef SF_DOUBLE
typedef int64_t sf_int;
#else
typedef int32_t sf_int; /* Conversions to 64 bits take double arithmetic in some libraries. */
#endif

#define SF_UNKNOWN ((int64_t)1 << 62)
#define SF_NEVER (-SF_UNKNOWN)
#define SF_NO_STAMP INT32_MIN

enum { HOLD, GO, FREEZE, OVER, STOP }; /* the phase in a Command */
enum { HELLO = SF_HELLO, PLAN, COMMAND, REPORT, CLOCK, REFUSAL }; /* tags, mostly as their keys */

/* numbers.c */
sf_real sf_least(sf_real a, sf_real b);
sf_real sf_most(sf_real a, sf_real b);
sf_real sf_positive(sf_real value); /* or 0 */
static inline sf_real sf_length(sf_real x, sf_real y) { return SF_SQRT(x * x + y * y); }
sf_real sf_clamp(sf_real value, sf_real low, sf_real high);
sf_real sf_within(sf_real value, sf_real most); /* on either side of 0 */
/* Of times that may be centuries apart, where somebody sends absurd stamps: wraps around.  Stamps are at
   most 2^62 and the robot's own times below 2^61, so that other differences do not overflow. */
static inline int64_t sf_difference(int64_t a, int64_t b) {
    return (int64_t)((uint64_t)a - (uint64_t)b);
}
int64_t sf_floor_ratio(int64_t a, int64_t b);
sf_int sf_whole(sf_real value);   /* towards 0; saturates */
sf_int sf_milli(sf_real value); /* thousandths, half to even */
sf_real sf_seconds_of_ns(int64_t ns);

enum { FAILED, AGAIN, NEXT }; /* what a piece of work on a Plan says of its stage */

/* curve.c */
int sf_curve_begin(sf_plan *plan, sf_course *course); /* of plan->parts spans */
sf_real sf_on_curve(const sf_course *course, sf_real s); /* s, limited to the curve's length */
int sf_measure_cell(sf_plan *plan, sf_course *course);
void sf_curve_place(sf_course *course, sf_real s);

/* timeline.c */

sf_real sf_slope(const sf_knot *leg); /* how the square of the speed grows, by arc length */
bool sf_timeline_leg(sf_course *course); /* adds the leg to the next knot, from `finish` on */
sf_real sf_s_at(sf_course *course, sf_real time); /* and the speed there, to timeline.v */
sf_real sf_time_at(const sf_course *course, sf_real s);
sf_real sf_rest_until(sf_course *course, sf_real time);

/* steering.c: the curve of a follower is that of its course */
/* The turn at a joint, and the one needed at a start; how far off that is, is the last one's seen_off. */
sf_real sf_joint(sf_course *course, sf_real s, sf_course *other, sf_real there);
sf_real sf_start_from(sf_course *course, const sf_pose *pose);
void sf_locate(sf_course *course, const sf_pose *pose);
void sf_find(sf_course *course);
sf_real sf_away_from(sf_course *course, sf_real s);
void sf_offset(const sf_course *course, sf_rest *rest);
/* Drive on, by a distance at most: the curvature for the speed, which tight bends lower. */
void sf_steer(sf_course *course, sf_real distance);

/* ride.c */
int sf_ride_begin(const sf_plan *plan, sf_course *course, const sf_robot *robot);
sf_real sf_time_of_ms(const sf_course *course, int64_t plan_ms);
void sf_grant(sf_course *course, int64_t authority_ms);
bool sf_leads_into(sf_course *course, sf_course *coming, bool at_goal);
bool sf_rests_where(const sf_course *course, sf_course *coming);
void sf_end_with(sf_course *course, sf_course *coming);
bool sf_is_over(sf_course *course, sf_course *coming, sf_real now, bool at_goal);
void sf_follow(sf_course *course, sf_course *before);
uint8_t sf_turn_before_start(sf_course *course);
void sf_reckon(sf_course *course, int64_t now_ms);
uint8_t sf_fault_at_start(sf_course *course); /* or a turn */
uint8_t sf_trouble(sf_course *course);
bool sf_arrived(const sf_course *course);
bool sf_at_goal(const sf_course *course);
bool sf_is_near_goal(const sf_course *course);
void sf_keep_to_plan(sf_course *course, sf_real now);
void sf_begin_to_brake(sf_course *course);
bool sf_brakes_to_rest(sf_course *course); /* brakes on; whether it rests */
void sf_stand(sf_course *course);

/* clock_sync.c: all of it at clock->now_ns */
typedef struct {
    int64_t sent_ns, received_ns, answered_ns;
    uint32_t boot, coordinator;
} sf_answer;

void sf_clock_start_over(sf_clock *clock);
void sf_clock_doubt(sf_clock *clock);
bool sf_clock_add(sf_clock *clock, const sf_answer *answer);
bool sf_is_said_in_future(const sf_clock *clock, int64_t said_ns);
void sf_clock_follow(sf_clock *clock, bool slewing);
bool sf_clock_asks(sf_clock *clock, int enough_ms, bool moving);
bool sf_clock_within(const sf_clock *clock, int limit_ms);

/* agent.c: at agent->clock.now_ns, which every call from outside sets */
#define ROBOT(agent) ((const sf_robot *)(agent)->robot)

/* How far the course of a number may be driven; 0: no farther than it was. */
typedef struct {
    int64_t authority_ms;
    uint32_t number;
    bool said; /* of this one, not of all */
} sf_granted;

typedef struct {
    sf_granted granted[2]; /* of the present course, of the newer one */
    uint32_t first, last;
    int32_t headroom_ms;
    sf_order order;
    int64_t start_ns, said_ns;
} sf_command;

void sf_hear_command(sf_agent *agent, const sf_command *command);
void sf_hear_clock(sf_agent *agent, const sf_answer *answer);
bool sf_takes_plan(sf_agent *agent, sf_plan *plan);
void sf_plan_taken(sf_agent *agent, sf_course *course, bool valid);
int64_t sf_plan_time_ms(const sf_agent *agent, const sf_course *ride); /* now, or driven by last */
static inline bool sf_is_on_its_way(const sf_agent *agent) {
    return agent->phase == SF_MOVING || agent->phase == SF_BRAKING;
}

/* plan.c: `plan` is the agent's */
bool sf_hear_plan(sf_plan *plan, const uint8_t *bytes, size_t length); /* keeps `bytes` */
void sf_read_plan(sf_plan *plan, sf_agent *agent, int work); /* goes on with the Plan that is being read */

/* reader.c */
typedef struct {
    const uint8_t *at, *end, *content; /* content: the bytes or text that were read last */
    uint32_t length;
    uint32_t left; /* elements of the present array that have not been read */
    uint8_t type;
    bool bad;
} sf_reader;

/* An integer in a message, and its place in a struct. */
typedef struct {
    uint8_t kind, at;
} sf_field;

enum { SF_U32 = 1, SF_I32, SF_STAMP, SF_OPTIONAL = 8, SF_NULLABLE = 16 };

int sf_open(sf_reader *reader, const uint8_t *bytes, size_t length); /* the message's tag */
int64_t sf_get_int(sf_reader *reader);
const sf_field *sf_get_fields(sf_reader *reader, void *into, const sf_field *fields);
uint32_t sf_get_array(sf_reader *reader);
void sf_get_bytes(sf_reader *reader); /* to reader->content */
void sf_get_text(sf_reader *reader);
bool sf_close(sf_reader *reader); /* skips further fields; whether all was well */
bool sf_is_id(const sf_reader *reader); /* whether the text is one */
bool sf_is_named(const sf_reader *reader, const char *id); /* whether it is this one */

/* What other compilers call -Os clang calls minsize; core_end.h ends it.  Code that may lie anywhere
   would get a table of addresses by it. */
#if defined(__clang__) && defined(__OPTIMIZE_SIZE__) && !defined(__PIC__)
#define SF_MINSIZE
#pragma clang attribute push(__attribute__((minsize)), apply_to = function)
#endif

#endif
