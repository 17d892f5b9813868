/* What core.c and its callers share: firmware/micropython/native_robot.py in Python, and in C
   benchmarks/firmware/native.c. */

#ifndef SPLINEFLEET_EXCHANGE_H
#define SPLINEFLEET_EXCHANGE_H

#include "splinefleet.h"

enum { SIZE, BEGIN, HEAR, TICK, SPEAK, FAILED }; /* act */

/* Packed and unpacked in Python; there is no padding. */
typedef struct {
    int64_t now_ns;
    float x, y, heading, speed, curvature, distance, turn, place;
    uint32_t kind, length, epoch, revision, holds;
    uint8_t phase, fault, flags, unused;
    uint8_t bytes[SF_LONGEST_SENT];
} exchange;

typedef struct {
    sf_agent agent;
    sf_robot robot;
    char id[40];
} memory;

/* MicroPython's functions for native code that convert: words of the objects that a native function
   is handed, and objects of words.  Their places in its table, and the types that they know. */
enum { FROM_OBJECT = 3, TO_OBJECT = 4, INT = 2, POINTER = 4 };

#endif
