/* The agent core of a splinefleet robot: phases, authority, clock, steering.

   Pure: no allocation, no operating system, no input or output.  The program around it hands in the
   bytes of messages, the time and the measured pose; it sends the bytes it is given back and
   drives as it is told.  Times are integer nanoseconds of the robot's own monotonic clock,
   |now_ns| < 2^61.  Lengths are metres, angles radians, counter-clockwise from +x.

   One robot is one `sf_agent`, which the program allocates (statically, as a rule) and does not
   copy or move.  Nothing here is reentrant: call it from one task or loop. */

#ifndef SPLINEFLEET_H
#define SPLINEFLEET_H

#include "splinefleet_state.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SF_IDLE, SF_ARMED, SF_MOVING, SF_BRAKING, SF_FROZEN, SF_DONE }; /* agent->phase */
enum { SF_NO_FAULT, SF_OFF_PATH, SF_DRIVER_ERROR, SF_CLOCK_UNSURE, SF_BAD_PLAN }; /* ->fault */

/* Kinds of key: splinefleet/FLEET/command, and splinefleet/FLEET/KIND/ROBOT for the others. */
enum { SF_NOTHING, SF_HELLO, SF_PLAN, SF_COMMAND, SF_REPORT, SF_CLOCK };

enum { SF_LONGEST_SENT = 96 }; /* No message from the robot is longer [bytes]. */

/* What the robot is.  A limit of 0 is not stated: the robot can do what the scenario asks.  The
   limits are double in both builds because they are sent as given; no arithmetic is done in double. */
typedef struct {
    const char *id;        /* 1 to 32 of A-Z a-z 0-9 _ . -; stays valid as long as the agent */
    double radius;         /* m */
    double max_speed;      /* m/s */
    double max_accel;      /* m/s^2 */
    sf_real speed_limit;   /* m/s, max_speed once more: what the robot catches up with; 0: by plan */
    uint32_t boot;         /* a random number, another one after every start */
    int64_t period_ns;     /* between ticks; 10 ms is usual */
} sf_robot;

/* Begin.  `robot` stays valid as long as the agent. */
void sf_init(sf_agent *agent, const sf_robot *robot);

/* Hand in the bytes that arrived on a key of this kind at now_ns.  Return whether the message was
   acceptable.  Bytes of kind SF_PLAN are read over several ticks: keep them unchanged as long as
   `sf_is_reading`; a Plan that arrives meanwhile is ignored and comes again. */
bool sf_hear(sf_agent *agent, int kind, const uint8_t *bytes, size_t length, int64_t now_ns);
static inline bool sf_is_reading(const sf_agent *agent) { return agent->plan.stage != 0; }

/* Decide what the robot at this pose does until the next tick; once every period.  A robot that has
   no pose yet says x = NAN.  To be read afterwards, for the driver (firmware/README.md):
     agent->drive_turn       rad; not 0: turn on the spot by this, and do not drive
     agent->drive_speed      m/s, not negative
     agent->drive_curvature  rad/m, positive to the left
     agent->drive_distance   m; stop after this distance, even if no tick follows */
void sf_tick(sf_agent *agent, int64_t now_ns, sf_real x, sf_real y, sf_real heading);

/* Write the next message that is due to `bytes` (SF_LONGEST_SENT of them) and its length, and
   return its kind of key; SF_NOTHING if none is due.  Call after every tick until then. */
int sf_speak(sf_agent *agent, int64_t now_ns, uint8_t *bytes, size_t *length);

/* The base failed, or the program around the core: the robot brakes, and reports it. */
void sf_driver_failed(sf_agent *agent, int64_t now_ns);

/* Where the robot's course begins; false while it has none.  For a robot that a person puts there
   and that has no measured pose of its own before. */
bool sf_start_pose(sf_agent *agent, sf_real *x, sf_real *y, sf_real *heading);

/* Whether nothing is left to do: the fleet has ended, or the coordinator refused this robot
   (agent->refused). */
bool sf_may_leave(const sf_agent *agent);

/* The arc length [m] at which the robot is on its course; 0 while it has none. */
static inline sf_real sf_place_on_path(const sf_agent *agent) {
    return agent->ride ? agent->ride->follower.s : 0;
}

/* The coordinator's time [ns] as the robot knows it; false while it does not know it. */
static inline bool sf_coordinator_time(const sf_agent *agent, int64_t now_ns, int64_t *time_ns) {
    *time_ns = now_ns + agent->clock.offset_ns;
    return agent->clock.good > 0;
}

#ifdef __cplusplus
}
#endif

#endif
