/* One robot: core, driver and link, a tick every 10 ms. */

#ifndef SPLINEFLEET_LOOP_H
#define SPLINEFLEET_LOOP_H

#include "driver.h"

typedef struct {
    void *link; /* handed to both functions */

    /* Copy the next message that has arrived to `bytes`, and say when it arrived on the robot's
       clock; return its kind of key, SF_NOTHING when none waits.  Does not block. */
    int (*receive)(void *link, uint8_t *bytes, size_t most, size_t *length, int64_t *heard_ns);

    /* Send bytes on splinefleet/FLEET/KIND/ROBOT.  Does not block. */
    void (*send)(void *link, int kind, const uint8_t *bytes, size_t length);
} sf_link;

typedef struct {
    sf_agent agent;
    const sf_driver *driver;
    const sf_link *link;
    uint8_t plan[SF_BYTES], other[1500], sent[SF_LONGEST_SENT];
} sf_loop;

void sf_loop_begin(sf_loop *loop, const sf_robot *robot, const sf_driver *driver, const sf_link *link);

/* One tick, called by a timer every robot->period_ns with the robot's monotonic clock; false when
   nothing is left to do. */
bool sf_loop_tick(sf_loop *loop, int64_t now_ns);

#endif
