/* What a base has to do: the C form of robot_agent/driver.py.

   Obligations of every driver:
   - It never travels farther than the distance commanded last, even if the loop stops.
   - It stops by itself when neither `drive` nor `turn` has been called for 50 ms.
   - It never reverses.
   - No function blocks for longer than a millisecond. */

#ifndef SPLINEFLEET_DRIVER_H
#define SPLINEFLEET_DRIVER_H

#include "splinefleet.h"

typedef struct {
    void *base; /* handed to every function */

    /* The robot's own estimate of its pose on the floor [m, m, rad]; false while it has none. */
    bool (*pose)(void *base, sf_real *x, sf_real *y, sf_real *heading);

    /* Travel along an arc at this speed [m/s, not negative] and curvature [rad/m, positive to the
       left] for at most this distance [m], then hold.  Speed 0 brakes and holds. */
    void (*drive)(void *base, sf_real speed, sf_real curvature, sf_real distance);

    /* Turn on the spot by this angle [rad, positive to the left] and hold. */
    void (*turn)(void *base, sf_real angle);

    /* Whether the base can do what it should; false once makes the robot brake and say so. */
    bool (*is_well)(void *base);
} sf_driver;

#endif
