/* A course being driven: where the robot is, how late, how fast to drive: robot_agent/core/ride.py.

   Plan times are seconds after origin_ms.  With double that is 0; with float it is the beginning of
   the course, so that a plan time keeps its precision however long the fleet has been driving. */

#include "core.h"

#define ARRIVAL_SLACK R(1e-3)
#define LATE_SHARE R(0.2)
#define ARRIVAL_SHARE R(0.8)
#define TURN_SHARE R(0.9)
#define ASKEW R(0.15)
#define FACING R(0.05)
#define GRACE R(0.25)
#define ARRIVAL_PATIENCE R(0.2)
#define HOLD_OUT R(0.05)
#define REST_TIME R(0.1)
#define REST_SLACK R(3e-3)
#define PACE_TIME R(0.1)
#define CATCH_UP_RATE R(10)
#define QUICK_CATCH_UP_RATE R(25)
#define QUICK_CATCH_UP_SHARE R(0.5)
#define CATCH_UP_BRAKE R(0.15)
#define REACTION_TICKS R(3)
#define MOST_HURRY R(1.1)
#define MOST_LATE 65535
#define MOST_STAMP INT32_MAX
#define SPARE_SPEED R(1.05)
#define JOINT_GAP R(3e-3)
#define JOINT_TURN R(0.02)
#define JOINT_SPEED R(0.02)

#ifdef SF_DOUBLE
#define LONGEST_WATCH SF_INF
#define TIME_ERROR R(0)
#else
#define LONGEST_WATCH R(256) /* Ticks are added up; beyond this float would lose parts of them. */
#define TIME_ERROR R(5e-7)   /* the share by which a plan time may be rounded up */
#endif

SHARED sf_real sf_time_of_ms(const sf_course *course, int64_t plan_ms) {
    return (sf_real)(plan_ms - course->origin_ms) / R(1000);
}

/* A plan time of one course as another one counts it. */
static sf_real as_of(const sf_course *other, const sf_course *course, sf_real time) {
    return time + sf_time_of_ms(other, course->origin_ms);
}

SHARED static sf_real begin_of(const sf_course *coming, const sf_course *course) {
    return as_of(course, coming, coming->begin);
}

/* Until when the robot may drive one course, as another one counts it. */
SHARED static sf_real told(const sf_course *of, const sf_course *course) {
    return sf_time_of_ms(course, of->told_ms);
}

/* Where the plan has the robot at a time. */
SHARED static sf_real planned_s(sf_course *course, sf_real time) {
    return sf_s_at(&course->timeline, time);
}

SHARED static bool is_stuck(const sf_course *course) {
    return course->watch - course->stuck_from >= REST_TIME;
}

SHARED static void limit_authority(sf_course *course) {
    course->authority = sf_least(told(course, course), course->rests);
    course->granted = planned_s(course, course->authority);
}

/* Of a course whose curve and timeline are there, and all else but its beginning zeros. */
bool sf_ride_begin(sf_course *course, const sf_plan *plan, sf_real max_speed, sf_real period) {
    sf_timeline *line = &course->timeline;
    if (!(course->curve.length > R(0)) || !(course->curve.length < R(1e6))) return false;
    if (sf_abs(line->length - course->curve.length) > ARRIVAL_SLACK) return false;
    sf_follower_begin(&course->follower);
    course->clock_ms = plan->clock_ms;
    course->stamp_ms = SF_NO_STAMP;
    course->track = R(plan->track_mm) / R(1000);
    course->brake = plan->brake_mmps2 ? R(plan->brake_mmps2) / R(1000) : SF_INF;
    course->period = period;
    course->catch_up = CATCH_UP_RATE;
    if (course->brake == SF_INF) {
        sf_real quick = sf_least(QUICK_CATCH_UP_RATE, QUICK_CATCH_UP_SHARE / period);
        course->catch_up = sf_most(CATCH_UP_RATE, quick);
    }
    /* A robot that starts and stops at once may rest where a course begins with any speed. */
    course->from_rest = course->brake == SF_INF || sf_v_at(line, course->begin) == R(0);
    course->slack = sf_most(ARRIVAL_SLACK, LATE_SHARE * course->track);
    course->limit = max_speed > R(0) ? max_speed : SPARE_SPEED * line->most_v;
    course->brake_from = course->stuck_s = course->pace_time = -SF_INF;
    course->rest_from = course->pace = course->until = course->rests = SF_INF;
    course->time = course->begin;
    course->rate = sf_clamp(course->limit / line->most_v, R(1), MOST_HURRY);
    course->reaction = REACTION_TICKS * period;
    course->foresight = HOLD_OUT + course->reaction + course->limit / course->brake;
    limit_authority(course);
    sf_curve_place(&course->curve, R(0)); /* Whether a course leads there is then found sooner. */
    return true;
}

void sf_grant(sf_course *course, int64_t authority_ms) {
    if (authority_ms <= course->told_ms) return;
    course->told_ms = authority_ms;
    limit_authority(course);
}

bool sf_leads_into(sf_course *course, sf_course *coming, bool at_goal) {
    sf_timeline *line = &course->timeline;
    bool rests = coming->from_rest;
    sf_real begin = begin_of(coming, course), time = begin, turn;
    sf_real reported = sf_time_of_ms(course, course->stamp_ms - (int64_t)LATE_STEP_MS * course->late);
    if (!rests) time = sf_most(sf_most(begin, course->time), reported);
    sf_real there = as_of(coming, course, time), s = at_goal ? line->length : sf_s_at(line, time);
    if (sf_joint(course, s, coming, planned_s(coming, there), &turn) > JOINT_GAP) return false;
    if (rests && (at_goal || begin >= line->finish || told(course, course) <= begin)) return true;
    if (course->time > time || reported > time) return false;
    sf_real speed = sf_v_at(line, time);
    if (rests && speed == R(0)) return true;
    sf_real differ = sf_abs(speed - sf_v_at(&coming->timeline, there));
    return differ <= JOINT_SPEED && sf_abs(turn) <= JOINT_TURN;
}

bool sf_rests_where(const sf_course *course, sf_course *coming) {
    const sf_follower *mine = &course->follower;
    sf_real turn;
    if (!coming->from_rest || mine->off == SF_INF || mine->pose.x == SF_INF) return false;
    return sf_turn_at_start(coming, &mine->pose, &turn) <= TURN_SHARE * coming->track;
}

void sf_end_with(sf_course *course, sf_course *coming) {
    course->until = begin_of(coming, course);
    course->rests = coming->from_rest ? course->until : SF_INF;
    limit_authority(course);
}

bool sf_is_over(sf_course *course, sf_course *coming, sf_real now) {
    sf_real until = course->until;
    if (now < until || course->time < sf_least(until, course->timeline.finish)) return false;
    sf_real enough = sf_least(told(course, course), course->time + course->foresight);
    if (!coming->from_rest && told(coming, course) < enough) return false;
    sf_real left = planned_s(course, until) - course->follower.s;
    if (left <= sf_most(ARRIVAL_SLACK, course->speed * course->period)) return true;
    return is_stuck(course) && left <= ARRIVAL_SHARE * course->track;
}

void sf_follow(sf_course *course, sf_course *before) {
    if (!course->from_rest) {
        sf_real begin = begin_of(course, before);
        sf_real passed = before->follower.s - planned_s(before, begin);
        course->time = sf_most(course->begin, as_of(course, before, before->time));
        course->follower.s = sf_least(sf_positive(passed), course->timeline.length);
    }
    course->halted = before->halted;
    course->holds = false;
    limit_authority(course);
    course->may_turn = course->from_rest;
    course->watch = course->pace_time = before->watch;
    course->speed = before->speed;
    course->pace = before->pace;
    course->brake_speed = before->brake_speed;
    course->brake_from = before->brake_from;
}

sf_real sf_turn_before_start(sf_course *course, const sf_pose *pose) {
    sf_real turn = R(0);
    if (course->halted || !course->may_turn) return turn;
    uint8_t fault = sf_fault_at_start(course, pose, &turn);
    course->may_turn = (fault || turn != R(0)) && course->follower.s <= course->track;
    return course->may_turn ? turn : R(0);
}

void sf_reckon(sf_course *course, int64_t now_ms) {
    sf_timeline *line = &course->timeline;
    sf_real bearable = course->track - course->follower.off;
    sf_real reached = course->follower.s + sf_least(course->slack, bearable);
    int64_t stamp_ms = now_ms;
    course->late = 0;
    if (reached < sf_s_at(line, sf_time_of_ms(course, now_ms)) || now_ms > MOST_STAMP) {
        sf_real passed = sf_time_at(line, sf_positive(reached));
        passed -= TIME_ERROR * sf_abs(passed);
        int64_t passed_ms = course->origin_ms + (int64_t)sf_floor(R(1000) * passed);
        int64_t late_ms = now_ms - passed_ms;
        if (late_ms > MOST_LATE * LATE_STEP_MS || now_ms > MOST_STAMP) stamp_ms = passed_ms;
        else if (late_ms > 0) course->late = (uint16_t)(((int)late_ms + LATE_STEP_MS - 1) / LATE_STEP_MS);
    }
    course->stamp_ms = stamp_ms > -MOST_STAMP ? (int32_t)stamp_ms : -MOST_STAMP;
}

/* Whether the robot is more than GRACE behind a plan time. */
SHARED static bool lags(sf_course *course, sf_real time) {
    sf_real bearable = sf_least(course->track - course->follower.off, course->slack);
    return !(course->follower.s >= planned_s(course, time - GRACE) - bearable);
}

/* What keeps a robot from starting with this pose: a fault, or a turn that is not 0.  A heading
   error theta leads theta / (e lambda) off the path before it is corrected. */
uint8_t sf_fault_at_start(sf_course *course, const sf_pose *pose, sf_real *turn) {
    sf_real enough = TURN_SHARE * course->track, off = sf_turn_at_start(course, pose, turn);
    sf_real angle = sf_abs(*turn);
    bool stands = off + angle * LED_OFF <= enough && angle <= (course->turns ? FACING : ASKEW);
    course->turns = !stands && off <= enough;
    if (course->turns) return SF_NO_FAULT;
    *turn = R(0);
    return stands ? SF_NO_FAULT : SF_OFF_PATH;
}

uint8_t sf_trouble(sf_course *course) {
    sf_real off = course->follower.off, track = course->track;
    if (off <= track && off + course->follower.s - course->granted > track) {
        off = sf_away_from(course, course->granted);
    }
    return off <= track ? SF_NO_FAULT : SF_OFF_PATH;
}

bool sf_arrived(const sf_course *course) {
    const sf_follower *follower = &course->follower;
    sf_real over = course->time - course->timeline.finish;
    if (over < R(0)) return false;
    sf_real left = course->timeline.length - follower->s;
    if (over >= ARRIVAL_PATIENCE && is_stuck(course))
        return left <= ARRIVAL_SHARE * course->track && !sf_has_left_goal(course);
    return left <= ARRIVAL_SLACK && follower->off <= course->slack;
}

bool sf_at_goal(const sf_course *course) {
    sf_real left = course->timeline.length - course->follower.s;
    return left <= ARRIVAL_SLACK && course->follower.off <= course->track;
}

SHARED bool sf_has_left_goal(const sf_course *course) {
    sf_real moved = sf_abs(course->timeline.length - course->follower.s);
    return !(course->follower.off + moved <= course->track);
}

/* Let one period pass on the watch, the time that the ticks have taken, whatever clocks do. */
static void pass_period(sf_course *course) {
    course->watch += course->period;
    if (!(course->watch > LONGEST_WATCH)) return;
    sf_real passed = course->watch;
    course->watch = R(0);
    course->stuck_from -= passed;
    course->pace_time -= passed;
    course->brake_from -= passed;
    course->rest_from -= passed;
}

static void brake_on(sf_course *course) {
    sf_real passed = course->watch - course->brake_from;
    sf_real fell = passed > R(0) ? course->brake * passed : R(0); /* The brake may be infinite. */
    course->speed = sf_positive(course->brake_speed - fell);
    sf_real later = course->time + passed + HOLD_OUT;
    sf_real room = planned_s(course, sf_least(later, course->authority)) - course->follower.s;
    course->distance = sf_positive(sf_least(room, course->speed * HOLD_OUT));
    course->curvature = sf_curvature(course, course->speed * course->period);
}

/* The plan time by which a robot drives that lags behind now: it runs as fast as the robot's
   greatest speed allows, ends waits at once, and stands still while the robot does not follow. */
static sf_real advanced(sf_course *course, sf_real now) {
    if (lags(course, course->time)) return course->time;
    sf_real time = sf_rest_until(&course->timeline, course->time);
    return sf_least(time + course->rate * course->period, now);
}

/* The room that is left, at most to where the authority ends; limits the speed. */
static sf_real within_authority(sf_course *course, sf_real room) {
    sf_real left = sf_positive(course->granted - course->follower.s), most;
    if (course->brake == SF_INF) {
        most = left / course->reaction;
    } else {
        sf_real lost = course->brake * course->reaction;
        most = SF_SQRT(lost * lost + R(2) * course->brake * left) - lost;
    }
    course->speed = sf_least(course->speed, most);
    return sf_least(left, room);
}

void sf_keep_to_plan(sf_course *course, sf_real now) {
    sf_timeline *line = &course->timeline;
    sf_real s = course->follower.s, period = course->period;
    pass_period(course);
    sf_real watch = course->watch;
    if (course->halted || !(sf_abs(s - course->stuck_s) <= REST_SLACK)) {
        course->stuck_from = watch;
        course->stuck_s = s;
    }
    sf_real passed = watch - course->pace_time;
    if (passed >= PACE_TIME) {
        course->pace = passed < R(1) ? (s - course->pace_s) / passed : SF_INF;
        course->pace_time = watch;
        course->pace_s = s;
    }
    if (course->halted || now < course->time) {
        if (!course->holds) {
            sf_begin_to_brake(course);
            course->brake_from -= period;
        }
        course->holds = true;
        if (s > planned_s(course, course->time)) course->time = sf_time_at(line, s);
        brake_on(course);
        return;
    }
    course->holds = false;
    sf_real time = course->time = lags(course, now) ? advanced(course, now) : now;
    sf_real planned = planned_s(course, time), speed = (planned_s(course, time + period) - planned) / period;
    sf_real lag = planned - s, more = lag * course->catch_up;
    if (lag > R(0)) more = sf_least(more, SF_SQRT(R(2) * CATCH_UP_BRAKE * course->brake * lag));
    course->speed = sf_clamp(speed + more, R(0), course->limit);
    sf_real room = planned_s(course, time + HOLD_OUT) - s;
    if (course->authority < time + course->foresight) room = within_authority(course, room);
    course->distance = sf_positive(room);
    course->curvature = sf_curvature(course, course->speed * period);
}

SHARED void sf_begin_to_brake(sf_course *course) {
    bool stuck = is_stuck(course);
    sf_real seen = sf_positive(course->pace) + R(2) * PACE_TIME * course->brake;
    course->brake_speed = stuck ? R(0) : sf_least(course->speed, seen);
    course->brake_from = course->watch;
    course->rest_from = SF_INF;
}

void sf_keep_braking(sf_course *course) {
    pass_period(course);
    brake_on(course);
}

bool sf_rests(sf_course *course, const sf_pose *pose) {
    sf_real x = pose->x, y = pose->y;
    bool moved = !(sf_abs(x - course->rest_x) + sf_abs(y - course->rest_y) <= REST_SLACK);
    if (course->speed > R(0) || moved || course->rest_from == SF_INF) {
        course->rest_from = course->watch;
        course->rest_x = x;
        course->rest_y = y;
    }
    return course->watch - course->rest_from >= REST_TIME;
}

void sf_stand(sf_course *course) {
    sf_find(course);
    course->speed = course->curvature = course->distance = R(0);
}
