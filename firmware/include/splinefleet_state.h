/* Sizes, the number type, and the state of an agent.  Change sizes by macros, leave the state alone.

   State in bytes at the default sizes: see firmware/README.md. */

#ifndef SPLINEFLEET_STATE_H
#define SPLINEFLEET_STATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The number type: float, or double where SF_DOUBLE is defined (bit for bit the Python agent). */
#ifdef SF_DOUBLE
typedef double sf_real;
#else
typedef float sf_real;
#endif

#ifndef SF_POINTS
#define SF_POINTS 64 /* control points of a course */
#endif
#ifndef SF_STOPS
#define SF_STOPS 16 /* stops of a course */
#endif
#ifndef SF_SPEEDS
#define SF_SPEEDS 96 /* speed knots of a course; a stop may add one more */
#endif
#ifndef SF_BYTES
#define SF_BYTES 1400 /* longest Plan message, the length of the receive buffer */
#endif
#ifndef SF_CELLS
#ifdef SF_DOUBLE
#define SF_CELLS (16 * SF_POINTS) /* cells of the arc-length table: what the Python agent has */
#else
#define SF_CELLS 192 /* cells of the arc-length table, at least SF_POINTS */
#endif
#endif
#ifndef SF_WORK
#define SF_WORK 24 /* work per tick on reading a Plan, in units of up to 80 instructions; 0: all at once */
#endif

#if SF_CELLS < SF_POINTS
#error "SF_CELLS is less than SF_POINTS: no cell would be left for a span"
#endif

#define SF_DEGREE 7 /* the highest degree on the wire */
#define SF_QUESTIONS 16 /* about the time, that may be open at once */
#define SF_REPORTED 5 /* numbers whose change is reported at once */
#define SF_LEGS (SF_SPEEDS + SF_STOPS)

/* A point in homogeneous coordinates: x and y times the weight, the weight. */
enum { SF_X, SF_Y, SF_WEIGHT, SF_AXES };

typedef struct {
    const sf_real *knot; /* where it begins */
    sf_real powers[SF_AXES][SF_DEGREE + 1];
} sf_piece;

/* A place on the curve: parameter, arc length, and du/ds there. */
typedef struct {
    sf_real u, s;
    float slope;
} sf_cell;

/* A speed knot, and from when to when the leg lasts that it begins. */
typedef struct {
    sf_real s, v, t0, t1;
} sf_knot;

/* Small fields stand first in every struct, and arrays last: short offsets make short code. */

/* Of a curve, all but its arrays. */
typedef struct {
    const sf_cell *cell; /* where the curve was evaluated last */
    sf_cell *last;       /* of the table: where the curve ends */
    const sf_real *knot; /* where the piece begins that was evaluated last */
    const sf_real *end;  /* the first knot at the curve's end */
    sf_piece *piece, *spare;
    sf_real at[SF_AXES], slope[SF_AXES], length; /* slope: of at, by the parameter */
} sf_curve;

typedef struct {
    const sf_knot *leg; /* where the robot was last */
    sf_knot *next;      /* the leg to be added; behind the last one */
    sf_knot *knots, *end; /* those of the course */
    sf_real v, length, finish, most_v;
} sf_timeline;

typedef struct {
    sf_real at[2], heading;
} sf_pose;

typedef struct {
    sf_real s, tangent_s, tangent[2]; /* tangent: the path's direction at tangent_s */
    sf_real clear;        /* how far ahead it may look; it doubles each tick after a tight bend */
    sf_real way[2];       /* the robot's direction */
    sf_real nearest, led; /* of a search: how near it came, squared; what its direction counts */
    sf_real seen_off, seen_lateral, seen_along; /* a pose, from where the tangent is */
    sf_real off, lateral, beyond, heading_error;
    sf_pose pose;
} sf_follower;

/* What a course's watch tells the age of: that it brakes, has this pace, rests, is stuck. */
enum { SF_BRAKES, SF_PACED, SF_RESTS, SF_STUCK, SF_SINCE };

/* One course and the robot on it.  Times are seconds of plan time after origin_ms. */
typedef struct {
    bool halted, holds, may_turn, turns, from_rest, at_once; /* at_once: it starts and stops so */
    bool located; /* whether the follower's pose is one */
    bool still;   /* whether the follower's s hardly changed then, and still holds */
    uint8_t degree, axes; /* axes: without SF_WEIGHT for a cubic whose weights are all 1 */
    uint16_t count, clock_ms, late; /* count: of control points */
    int32_t begin_ms, origin_ms, stamp_ms;
    sf_real speed, curvature, distance, turn; /* the command */
    sf_real watch, since[SF_SINCE], rest_x, rest_y, pace, brake_speed;
    sf_timeline timeline;
    sf_curve curve;
    sf_follower follower;
    int64_t told_ms;
    sf_real track, brake, period, catch_up, slack, limit, reaction, foresight;
    sf_real until, rests, stuck_s, pace_s, authority, granted, time, begin;
    sf_piece pieces[2]; /* of the curve; `curve` points to them */
    sf_real knots[SF_POINTS + SF_DEGREE + 1];
    sf_real points[SF_AXES][SF_POINTS];
    sf_cell table[SF_CELLS + 1];
    sf_knot legs[SF_LEGS + 1]; /* the timeline's knots */
} sf_course;

typedef struct {
    int64_t low_ns, high_ns;
} sf_interval;

typedef struct {
    uint8_t place; /* in open_ns, of the next question */
    bool slewing, compares;
    uint32_t good, asked;
    int64_t now_ns, offset_ns, at_ns, middle_ns, asked_ns, since_ns, followed_ns;
    sf_interval interval;          /* where the offset lay at at_ns */
    int64_t open_ns[SF_QUESTIONS]; /* when open questions were asked; a ring */
} sf_clock;

/* What a Command tells every robot, and this one: whether it asks where that is. */
typedef struct {
    bool asks;
    uint32_t boot, term, sequence, epoch, run, phase;
} sf_order;

typedef struct {
    bool known, heard; /* who it is, and a Command from it */
    sf_order order;    /* the last that was obeyed */
    int64_t heard_ns;
} sf_leader;

typedef struct {
    bool tell;
    uint32_t revision;
    int16_t off, turn, beyond;
    sf_real s;
    uint32_t epoch;
} sf_rest;

/* A Plan message that is being read. */
typedef struct {
    uint8_t stage;
    bool next; /* of the epoch that the robot drives in */
    uint16_t counts[6];
    uint32_t degree, track_mm, clock_ms;
    uint16_t length;
    int32_t begin_ms;
    uint32_t at, stop, parts;
    uint32_t crc, epoch, boot, number, revision, brake_mmps2;
    sf_course *course;
    const uint8_t *bytes;
    const sf_real *knot; /* up to which the curve is measured now */
    int64_t tau_ns;
    const uint8_t *packed[6]; /* points, knots, weights, speeds, profile, stops */
} sf_plan;

typedef struct {
    uint8_t phase, fault;
    bool finished, refused, has_pose;
    sf_leader leader;
    sf_rest rest;
    uint32_t epoch, number, revision, next_number, holds;
    uint32_t taken; /* the newest course that it has held; one that it dropped is gone for good */
    const void *robot; /* the sf_robot */
    sf_course *ride, *coming;
    uint32_t spent_epoch, report_sequence, hellos;
    uint32_t reported[SF_REPORTED], newest_term, newest_boot;
    sf_real unsure, passed;
    sf_real drive_speed, drive_curvature, drive_distance, drive_turn;
    sf_pose pose;
    int64_t ticked_ns, start_ns, reported_ns, hello_ns;
    int64_t next_sequence; /* of the newest Command, + 1 */
    sf_clock clock;
    sf_plan plan;
    sf_course courses[2];
} sf_agent;

#endif
