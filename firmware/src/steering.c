/* Where on its path a robot is, and how it steers along it: robot_agent/core/steering.py.

   The curvature is the path's own just ahead plus the linear law of Samson (1992). */

#include "core.h"

#define TICKS_TO_SETTLE R(5)
#define LEAST_LOOK_AHEAD R(5e-4)
#define SHARPEST R(1000)
#define TIGHT R(25)
#define MOST_TURN R(0.3)
#define TIGHT_WAY R(0.04)
#define LONGEST_STEP R(0.05)
#define CLOSE_ENOUGH R(2e-4)
#define STILL R(1e-9)
#define BESIDE R(2e-3)
#define SEARCH_WAY R(0.3)
#define SEARCH_STEP R(0.02)
#define SEARCH_END R(1e-4)

/* The angle from one direction to another. */
SHARED static sf_real angle(sf_real ax, sf_real ay, sf_real bx, sf_real by) {
    return SF_ATAN2(ax * by - ay * bx, ax * bx + ay * by);
}

/* Evaluate the curve at s and store its direction, unless it has none there. */
SHARED static void tangent_at(sf_course *course, sf_real s) {
    sf_follower *follower = &course->follower;
    sf_curve *curve = &course->curve;
    follower->still = false;
    if (s == follower->tangent_s) return;
    follower->tangent_s = s;
    sf_curve_place(curve, s);
    sf_real dx = curve->slope[SF_X], dy = curve->slope[SF_Y], size = sf_length(dx, dy);
    if (size > R(1e-9)) {
        follower->tx = dx / size;
        follower->ty = dy / size;
    }
}

/* See a place from the curve's point at s: how far away, to the left, and ahead; return the first. */
SHARED static sf_real see(sf_course *course, sf_real s, const sf_real *place) {
    sf_follower *follower = &course->follower;
    tangent_at(course, s);
    sf_real dx = place[SF_X] - course->curve.at[SF_X], dy = place[SF_Y] - course->curve.at[SF_Y];
    sf_real tx = follower->tx, ty = follower->ty;
    follower->seen_lateral = dy * tx - dx * ty;
    follower->seen_along = dx * tx + dy * ty;
    return follower->seen_off = sf_length(dx, dy);
}

SHARED static sf_real turn_from_tangent(const sf_course *course, const sf_real *way) {
    const sf_follower *follower = &course->follower;
    return angle(follower->tx, follower->ty, way[SF_X], way[SF_Y]);
}

SHARED static void direction(sf_real heading, sf_real *way) {
    way[SF_X] = SF_COS(heading);
    way[SF_Y] = SF_SIN(heading);
}

bool sf_start_pose(sf_agent *agent, sf_real *x, sf_real *y, sf_real *heading) {
    sf_course *course = agent->ride;
    if (!course) return false;
    tangent_at(course, R(0));
    *x = course->curve.at[SF_X];
    *y = course->curve.at[SF_Y];
    *heading = SF_ATAN2(course->follower.ty, course->follower.tx);
    return true;
}

sf_apart sf_joint(sf_course *course, sf_real s, sf_course *other, sf_real there) {
    const sf_follower *a = &course->follower, *b = &other->follower;
    tangent_at(course, s);
    sf_real off = see(other, there, course->curve.at);
    return (sf_apart){off, angle(a->tx, a->ty, b->tx, b->ty)};
}

sf_apart sf_start_from(sf_course *course, const sf_pose *pose) {
    sf_real off = see(course, R(0), pose->at), way[2];
    direction(pose->heading, way);
    return (sf_apart){off, -turn_from_tangent(course, way)};
}

/* Let the robot be at follower->s, with its pose as it was seen last. */
SHARED static void take(sf_course *course) {
    sf_follower *follower = &course->follower;
    follower->off = follower->seen_off;
    follower->lateral = follower->seen_lateral;
    follower->beyond = follower->seen_along;
    follower->heading_error = turn_from_tangent(course, follower->way);
}

/* See the last pose from where the robot is, and take that. */
SHARED static void look(sf_course *course) {
    see(course, course->follower.s, course->follower.pose.at);
    take(course);
}

/* Take s for the place if the path's pose there is nearer to the robot's than that found before; a
   heading error e counts 2 LED_OFF sin(e / 2) if it counts. */
SHARED static bool go_nearer(sf_course *course, sf_real s) {
    sf_follower *follower = &course->follower;
    s = sf_on_curve(&course->curve, s);
    see(course, s, follower->pose.at);
    sf_real along = follower->tx * follower->way[SF_X] + follower->ty * follower->way[SF_Y];
    sf_real apart = follower->seen_off * follower->seen_off - follower->led * along;
    if (!(apart < follower->nearest)) return false;
    follower->nearest = apart;
    follower->s = s;
    return true;
}

/* Begin a search where the robot was. */
SHARED static void look_near(sf_course *course, sf_real led) {
    course->follower.led = led;
    course->follower.nearest = SF_INF;
    go_nearer(course, course->follower.s);
}

/* Go to the nearest place up to a step away along the path. */
SHARED static void search(sf_course *course, sf_real step) {
    while (step > SEARCH_END) {
        step *= R(0.5);
        if (!go_nearer(course, course->follower.s - step)) go_nearer(course, course->follower.s + step);
    }
    look(course);
}

void sf_locate(sf_course *course, const sf_pose *pose) {
    sf_follower *follower = &course->follower;
    sf_real x = pose->at[SF_X], y = pose->at[SF_Y], heading = pose->heading, began = follower->s, before;
    if (follower->still && x == follower->pose.at[SF_X] && y == follower->pose.at[SF_Y] &&
        heading == follower->pose.heading)
        return;
    follower->still = false;
    follower->located = sf_abs(x) + sf_abs(y) + sf_abs(heading) < R(1e9);
    if (!follower->located) {
        follower->lateral = follower->off = SF_INF;
        return;
    }
    follower->pose = *pose;
    direction(heading, follower->way);
    if (follower->clear < TIGHT_WAY) {
        look_near(course, R(2) * LED_OFF * LED_OFF);
        search(course, R(2) * TIGHT_WAY);
    } else {
        int tries = 4;
        do {
            before = follower->s;
            see(course, before, pose->at);
            sf_real step = sf_clamp(follower->seen_along, -LONGEST_STEP, LONGEST_STEP);
            follower->s = sf_on_curve(&course->curve, before + step);
        } while (--tries > 0 && !(sf_abs(follower->s - before) < CLOSE_ENOUGH));
        take(course);
    }
    follower->still = sf_abs(follower->s - began) < STILL;
}

sf_real sf_away_from(sf_course *course, sf_real s) {
    sf_real away = see(course, s, course->follower.pose.at);
    tangent_at(course, course->follower.s);
    return away;
}

void sf_find(sf_course *course) {
    sf_follower *follower = &course->follower;
    sf_real place = sf_on_curve(&course->curve, follower->s - SEARCH_WAY), end = follower->s + SEARCH_WAY;
    if (!follower->located) return;
    look(course);
    sf_real off = follower->off, lateral = follower->lateral;
    if (off * off <= lateral * lateral + BESIDE * BESIDE) return;
    look_near(course, R(0));
    for (; place <= end; place += SEARCH_STEP) go_nearer(course, place);
    search(course, SEARCH_STEP);
}

/* The offset in a report; all zeros for a robot that is far away. */
void sf_offset(const sf_follower *follower, sf_rest *rest) {
    rest->off = rest->turn = rest->beyond = 0;
    if (!(sf_abs(follower->lateral) + sf_abs(follower->beyond) < R(32))) return;
    rest->turn = (int16_t)sf_milli(follower->heading_error);
    rest->off = (int16_t)sf_milli(follower->lateral);
    rest->beyond = (int16_t)sf_milli(follower->beyond);
}

void sf_steer(sf_course *course) {
    sf_follower *follower = &course->follower;
    bool still = follower->still;
    sf_real bend = R(0), tx = follower->tx, ty = follower->ty, reach = SF_INF;
    sf_real travel = course->speed * course->period; /* until the next tick */
    sf_real ahead = sf_most(travel, LEAST_LOOK_AHEAD);
    if (ahead > follower->clear) ahead = reach = follower->clear;
    ahead = sf_least(ahead, course->curve.length - follower->s);
    if (ahead > CLOSE_ENOUGH) {
        for (;;) {
            tangent_at(course, follower->s + ahead);
            bend = angle(tx, ty, follower->tx, follower->ty);
            if (!(sf_abs(bend) > MOST_TURN) || !(ahead > LEAST_LOOK_AHEAD)) break;
            ahead = reach = R(0.5) * ahead;
        }
        bend /= ahead;
        if (sf_abs(bend) > TIGHT)
            follower->clear = R(2) * ahead;
        else if (!still)
            follower->clear *= R(2);
        if (still) { /* The next `sf_locate` may leave all as it is. */
            follower->tx = tx;
            follower->ty = ty;
            follower->still = true;
            follower->tangent_s = SF_INF;
        }
    }
    if (follower->located) {
        sf_real rate = R(1) / sf_most(SETTLING_LENGTH, TICKS_TO_SETTLE * travel);
        bend -= rate * (rate * follower->lateral + R(2) * follower->heading_error);
    }
    course->curvature = sf_clamp(bend, -SHARPEST, SHARPEST);
    if (travel > reach) course->speed = reach / course->period;
    course->distance = sf_least(course->distance, R(2) * reach);
}

#include "core_end.h"
