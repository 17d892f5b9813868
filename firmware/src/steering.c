/* Where on its path a robot is, and how it steers along it: robot_agent/core/steering.py.

   The curvature is the path's own just ahead plus the linear law of Samson (1992). */

#include "core.h"

#define TICKS_TO_SETTLE R(5)
#define LEAST_LOOK_AHEAD R(5e-4)
#define SHARPEST R(1000)
#define TIGHT R(25)
#define MOST_TURN R(0.3)
#define TIGHT_WAY R(0.04)
#define PLACE_NOISE R(4e-3)
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
    const sf_real *slope = course->curve.slope;
    course->still = false;
    if (s == follower->tangent_s) return;
    follower->tangent_s = s;
    sf_curve_place(course, s);
    sf_real dx = slope[SF_X], dy = slope[SF_Y], size = sf_length(dx, dy);
    if (size > R(1e-9)) {
        follower->tangent[SF_X] = dx / size;
        follower->tangent[SF_Y] = dy / size;
    }
}

/* See a place from the curve's point at s: how far away, to the left, and ahead; return the first. */
SHARED static sf_real see(sf_course *course, sf_real s, const sf_real *place) {
    sf_follower *follower = &course->follower;
    tangent_at(course, s);
    sf_real dx = place[SF_X] - course->curve.at[SF_X], dy = place[SF_Y] - course->curve.at[SF_Y];
    sf_real tx = follower->tangent[SF_X], ty = follower->tangent[SF_Y];
    follower->seen_lateral = dy * tx - dx * ty;
    follower->seen_along = dx * tx + dy * ty;
    return follower->seen_off = sf_length(dx, dy);
}

/* The same for the robot's last pose. */
SHARED static sf_real see_robot(sf_course *course, sf_real s) {
    return see(course, s, course->follower.pose.at);
}

SHARED static sf_real turn_from_tangent(const sf_course *course, const sf_real *way) {
    const sf_follower *follower = &course->follower;
    return angle(follower->tangent[SF_X], follower->tangent[SF_Y], way[SF_X], way[SF_Y]);
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
    *heading = SF_ATAN2(course->follower.tangent[SF_Y], course->follower.tangent[SF_X]);
    return true;
}

sf_real sf_joint(sf_course *course, sf_real s, sf_course *other, sf_real there) {
    tangent_at(course, s);
    see(other, there, course->curve.at);
    return turn_from_tangent(course, other->follower.tangent);
}

sf_real sf_start_from(sf_course *course, const sf_pose *pose) {
    sf_real way[2];
    see(course, R(0), pose->at);
    direction(pose->heading, way);
    return -turn_from_tangent(course, way);
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
    see_robot(course, course->follower.s);
    take(course);
}

/* Take s for the place if the path's pose there is nearer to the robot's than that found before; a
   heading error e counts 2 LED_OFF sin(e / 2) if it counts. */
SHARED static bool go_nearer(sf_course *course, sf_real s) {
    sf_follower *follower = &course->follower;
    const sf_real *tangent = follower->tangent, *way = follower->way;
    s = sf_on_curve(course, s);
    see_robot(course, s);
    sf_real along = tangent[SF_X] * way[SF_X] + tangent[SF_Y] * way[SF_Y];
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
    if (course->still && x == follower->pose.at[SF_X] && y == follower->pose.at[SF_Y] &&
        heading == follower->pose.heading)
        return;
    follower->pose = *pose;
    course->still = false;
    course->located = sf_abs(x) + sf_abs(y) + sf_abs(heading) < R(1e9);
    if (!course->located) {
        follower->lateral = follower->off = SF_INF;
        return;
    }
    direction(heading, follower->way);
    if (follower->clear < TIGHT_WAY) {
        look_near(course, R(2) * LED_OFF * LED_OFF);
        search(course, R(3) * follower->clear + PLACE_NOISE);
    } else {
        int tries = 4;
        bool near;
        do {
            before = follower->s;
            see_robot(course, before);
            sf_real step = sf_within(follower->seen_along, LONGEST_STEP);
            follower->s = sf_on_curve(course, before + step);
            near = sf_abs(follower->s - before) < CLOSE_ENOUGH;
        } while (--tries > 0 && !near);
        if (!near) see_robot(course, follower->s);
        take(course);
    }
    course->still = sf_abs(follower->s - began) < STILL;
}

sf_real sf_away_from(sf_course *course, sf_real s) {
    sf_real away = see_robot(course, s);
    tangent_at(course, course->follower.s);
    return away;
}

void sf_find(sf_course *course) {
    sf_follower *follower = &course->follower;
    if (!course->located) return;
    look(course);
    sf_real off = follower->off, lateral = follower->lateral;
    if (off * off <= lateral * lateral + BESIDE * BESIDE) return;
    sf_real place = sf_on_curve(course, follower->s - SEARCH_WAY), end = follower->s + SEARCH_WAY;
    look_near(course, R(0));
    for (; place <= end; place += SEARCH_STEP) go_nearer(course, place);
    search(course, SEARCH_STEP);
}

/* The offset in a report; all zeros for a robot that is far away. */
void sf_offset(const sf_course *course, sf_rest *rest) {
    const sf_follower *follower = &course->follower;
    rest->off = rest->turn = rest->beyond = 0;
    if (!(sf_abs(follower->lateral) + sf_abs(follower->beyond) < R(32))) return;
    rest->turn = (int16_t)sf_milli(follower->heading_error);
    rest->off = (int16_t)sf_milli(follower->lateral);
    rest->beyond = (int16_t)sf_milli(follower->beyond);
}

void sf_steer(sf_course *course, sf_real distance) {
    sf_follower *follower = &course->follower;
    bool still = course->still;
    sf_real bend = R(0), tx = follower->tangent[SF_X], ty = follower->tangent[SF_Y], reach = SF_INF;
    sf_real travel = course->speed * course->period; /* until the next tick */
    sf_real ahead = sf_most(travel, LEAST_LOOK_AHEAD);
    if (ahead > follower->clear) ahead = reach = follower->clear;
    ahead = sf_least(ahead, course->curve.length - follower->s);
    if (ahead > CLOSE_ENOUGH) {
        for (;;) {
            tangent_at(course, follower->s + ahead);
            bend = angle(tx, ty, follower->tangent[SF_X], follower->tangent[SF_Y]);
            if (!(sf_abs(bend) > MOST_TURN) || !(ahead > LEAST_LOOK_AHEAD)) break;
            ahead = reach = R(0.5) * ahead;
        }
        bend /= ahead;
        follower->clear = R(2) * (sf_abs(bend) > TIGHT ? ahead : follower->clear);
        if (still) { /* The next `sf_locate` may leave all as it is. */
            follower->tangent[SF_X] = tx;
            follower->tangent[SF_Y] = ty;
            course->still = true;
            follower->tangent_s = SF_INF;
        }
    }
    if (course->located) {
        sf_real rate = R(1) / sf_most(SETTLING_LENGTH, TICKS_TO_SETTLE * travel);
        bend -= rate * (rate * follower->lateral + R(2) * follower->heading_error);
    }
    course->curvature = sf_within(bend, SHARPEST);
    if (travel > reach) course->speed = reach / course->period;
    course->distance = sf_least(sf_positive(distance), R(2) * reach);
    /* While it turns on the spot, its heading does not tell where it is. */
    if (course->may_turn) follower->clear = SF_INF;
}

#include "core_end.h"
