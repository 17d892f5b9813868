/* Where on its path a robot is, and how it steers along it: robot_agent/core/steering.py.

   The curvature is the path's own just ahead plus the linear law of Samson (1992). */

#include "core.h"

#define TICKS_TO_SETTLE R(5)
#define LOOK_AHEAD_TICKS R(1.5)
#define LEAST_LOOK_AHEAD R(0.002)
#define SHARPEST R(250)
#define LONGEST_STEP R(0.05)
#define CLOSE_ENOUGH R(2e-4)
#define STILL R(1e-9)
#define BESIDE R(2e-3)
#define SEARCH_WAY R(0.3)
#define SEARCH_STEP R(0.02)
#define SEARCH_END R(1e-5)

SHARED static sf_real length_of(sf_real x, sf_real y) { return SF_SQRT(x * x + y * y); }

/* The angle from one direction to another. */
SHARED static sf_real angle(sf_real ax, sf_real ay, sf_real bx, sf_real by) {
    return SF_ATAN2(ax * by - ay * bx, ax * bx + ay * by);
}

/* Of a follower that is all zeros. */
void sf_follower_begin(sf_follower *follower) {
    follower->pose.x = follower->pose.y = follower->pose.heading = SF_INF;
    follower->tangent_s = follower->still_at = SF_INF;
    follower->tx = R(1);
}

/* Evaluate the curve at s and store its direction, unless it has none there. */
SHARED static void tangent_at(sf_course *course, sf_real s) {
    sf_follower *follower = &course->follower;
    sf_curve *curve = &course->curve;
    follower->still_at = SF_INF;
    if (s == follower->tangent_s) return;
    follower->tangent_s = s;
    sf_curve_place(curve, s);
    sf_real size = length_of(curve->dx, curve->dy);
    if (size > R(1e-9)) {
        follower->tx = curve->dx / size;
        follower->ty = curve->dy / size;
    }
}

SHARED static sf_real turned_from_tangent(const sf_follower *follower, const sf_pose *pose) {
    return angle(follower->tx, follower->ty, SF_COS(pose->heading), SF_SIN(pose->heading));
}

void sf_start_of(sf_course *course, sf_pose *pose) {
    tangent_at(course, R(0));
    pose->x = course->curve.x;
    pose->y = course->curve.y;
    pose->heading = SF_ATAN2(course->follower.ty, course->follower.tx);
}

sf_real sf_joint(sf_course *course, sf_real s, sf_course *other, sf_real there, sf_real *turn) {
    tangent_at(course, s);
    tangent_at(other, there);
    const sf_follower *a = &course->follower, *b = &other->follower;
    *turn = angle(a->tx, a->ty, b->tx, b->ty);
    return length_of(other->curve.x - course->curve.x, other->curve.y - course->curve.y);
}

SHARED static sf_real distance(const sf_curve *curve, const sf_pose *pose) {
    return length_of(pose->x - curve->x, pose->y - curve->y);
}

sf_real sf_turn_at_start(sf_course *course, const sf_pose *pose, sf_real *turn) {
    tangent_at(course, R(0));
    *turn = -turned_from_tangent(&course->follower, pose);
    return distance(&course->curve, pose);
}

/* Set the robot's place to s, which must be where the tangent was last evaluated. */
SHARED static void take(sf_course *course, sf_real s) {
    sf_follower *follower = &course->follower;
    const sf_curve *curve = &course->curve;
    sf_real dx = follower->pose.x - curve->x, dy = follower->pose.y - curve->y;
    sf_real tx = follower->tx, ty = follower->ty;
    follower->s = s;
    follower->lateral = dy * tx - dx * ty;
    follower->off = distance(curve, &follower->pose);
    follower->beyond = s <= R(0) || s >= curve->length ? dx * tx + dy * ty : R(0);
    follower->heading_error = turned_from_tangent(follower, &follower->pose);
}

void sf_locate(sf_course *course, const sf_pose *pose) {
    sf_follower *follower = &course->follower;
    const sf_curve *curve = &course->curve;
    sf_real s = follower->s, began = s, x = pose->x, y = pose->y, heading = pose->heading;
    bool same = x == follower->pose.x && y == follower->pose.y && heading == follower->pose.heading;
    if (s == follower->still_at && same) return;
    if (!(sf_abs(x) + sf_abs(y) + sf_abs(heading) < R(1e9))) {
        follower->lateral = follower->off = SF_INF;
        follower->still_at = SF_INF;
        return;
    }
    follower->pose = *pose;
    for (int i = 0; i < 4; i++) {
        tangent_at(course, s);
        sf_real along = (x - curve->x) * follower->tx + (y - curve->y) * follower->ty;
        sf_real before = s;
        s = sf_on_curve(curve, s + sf_clamp(along, -LONGEST_STEP, LONGEST_STEP));
        if (sf_abs(s - before) < CLOSE_ENOUGH) break;
    }
    take(course, s);
    if (sf_abs(s - began) < STILL) follower->still_at = s;
}

SHARED static sf_real apart(sf_course *course, sf_real s) {
    tangent_at(course, s);
    return distance(&course->curve, &course->follower.pose);
}

sf_real sf_away_from(sf_course *course, sf_real s) {
    sf_real away = apart(course, s);
    tangent_at(course, course->follower.s);
    return away;
}

void sf_find(sf_course *course) {
    sf_follower *follower = &course->follower;
    const sf_curve *curve = &course->curve;
    sf_real s = follower->s, step = SEARCH_STEP;
    if (follower->lateral == SF_INF || follower->pose.x == SF_INF) return;
    sf_real nearest = apart(course, s), lateral;
    take(course, s);
    lateral = follower->lateral;
    if (nearest * nearest <= lateral * lateral + BESIDE * BESIDE) return;
    sf_real place = sf_on_curve(curve, s - SEARCH_WAY), end = sf_on_curve(curve, s + SEARCH_WAY);
    for (; place <= end; place += step) {
        sf_real here = apart(course, place);
        if (here < nearest) {
            nearest = here;
            s = place;
        }
    }
    while (step > SEARCH_END) {
        step *= R(0.5);
        sf_real before = sf_on_curve(curve, s - step), after = sf_on_curve(curve, s + step);
        sf_real here = apart(course, s);
        if (apart(course, before) < here) s = before;
        else if (apart(course, after) < here) s = after;
    }
    tangent_at(course, s);
    take(course, s);
}

/* The offset in a report; all zeros for a robot that is far away. */
void sf_offset(const sf_follower *follower, sf_rest *rest) {
    rest->off = rest->turn = rest->beyond = 0;
    if (!(sf_abs(follower->lateral) + sf_abs(follower->beyond) < R(32))) return;
    rest->turn = (int16_t)sf_nearest(R(1000) * follower->heading_error);
    rest->off = (int16_t)sf_nearest(R(1000) * follower->lateral);
    rest->beyond = (int16_t)sf_nearest(R(1000) * follower->beyond);
}

sf_real sf_curvature(sf_course *course, sf_real travel) {
    sf_follower *follower = &course->follower;
    sf_real still_at = follower->still_at, bend = R(0), tx = follower->tx, ty = follower->ty;
    sf_real ahead = sf_most(LOOK_AHEAD_TICKS * travel, LEAST_LOOK_AHEAD);
    ahead = sf_least(ahead, course->curve.length - follower->s);
    if (ahead > CLOSE_ENOUGH) {
        tangent_at(course, follower->s + ahead);
        bend = angle(tx, ty, follower->tx, follower->ty) / ahead;
        if (still_at != SF_INF) { /* The next `sf_locate` may leave all as it is. */
            follower->tx = tx;
            follower->ty = ty;
            follower->still_at = still_at;
            follower->tangent_s = SF_INF;
        }
    }
    if (follower->lateral != SF_INF) {
        sf_real rate = R(1) / sf_most(SETTLING_LENGTH, TICKS_TO_SETTLE * travel);
        bend -= rate * (rate * follower->lateral + R(2) * follower->heading_error);
    }
    return sf_clamp(bend, -SHARPEST, SHARPEST);
}
