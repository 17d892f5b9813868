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
static sf_int floor_of(sf_real value) {
    sf_int number = sf_whole(value);
    return (sf_real)number > value ? number - 1 : number;
}
#else
#define LONGEST_WATCH R(256) /* Ticks are added up; beyond this float would lose parts of them. */
#define TIME_ERROR R(5e-7)   /* the share by which a plan time may be rounded up */
#define floor_of sf_whole    /* No time of a course is negative: it begins at 0. */
#endif

SHARED sf_real sf_time_of_ms(const sf_course *course, int64_t plan_ms) {
    return (sf_real)(plan_ms - course->origin_ms) / R(1000);
}

/* As one course counts it: a plan time of another one, */
static sf_real as_of(const sf_course *course, const sf_course *other, sf_real time) {
    return time + sf_time_of_ms(course, other->origin_ms);
}

/* when another one begins, */
static sf_real begin_of(const sf_course *course, const sf_course *other) {
    return sf_time_of_ms(course, other->begin_ms);
}

/* until when the robot may drive another one. */
static sf_real told(const sf_course *course, const sf_course *other) {
    return sf_time_of_ms(course, other->told_ms);
}

/* How far it is from the robot to where the plan has it at a time. */
static sf_real room(sf_course *course, sf_real time) {
    return sf_s_at(course, time) - course->follower.s;
}

/* Whether something has been so for as long as makes it rest. */
SHARED static bool lasts(const sf_course *course, int what) {
    return course->watch - course->since[what] >= REST_TIME;
}

SHARED static bool is_stuck(const sf_course *course) { return lasts(course, SF_STUCK); }

static void limit_authority(sf_course *course) {
    course->authority = sf_least(told(course, course), course->rests);
    course->granted = sf_s_at(course, course->authority);
}

/* Of a course whose curve and timeline are there, and all else but its beginning zeros. */
int sf_ride_begin(const sf_plan *plan, sf_course *course, const sf_robot *robot) {
    sf_timeline *line = &course->timeline;
    sf_real period = sf_seconds_of_ns(robot->period_ns);
    sf_real length = course->curve.length;
    if (!(length > R(0)) || !(length < R(1e6))) return FAILED;
    if (sf_abs(line->length - length) > ARRIVAL_SLACK) return FAILED;
    course->follower.tangent_s = course->follower.clear = SF_INF;
    course->follower.tangent[SF_X] = R(1);
    course->clock_ms = (uint16_t)plan->clock_ms;
    course->stamp_ms = SF_NO_STAMP;
    course->track = R(plan->track_mm) / R(1000);
    course->brake = R(plan->brake_mmps2) / R(1000);
    course->period = period;
    course->catch_up = CATCH_UP_RATE;
    sf_s_at(course, course->begin);
    course->from_rest = line->v == R(0);
    if (plan->brake_mmps2 == 0) { /* It may rest where a course begins with any speed. */
        course->at_once = course->from_rest = true;
        course->brake = SF_INF;
        course->catch_up = sf_clamp(QUICK_CATCH_UP_SHARE / period, CATCH_UP_RATE, QUICK_CATCH_UP_RATE);
    }
    course->slack = sf_most(ARRIVAL_SLACK, LATE_SHARE * course->track);
    course->limit = robot->speed_limit > R(0) ? robot->speed_limit : SPARE_SPEED * line->most_v;
    course->stuck_s = course->since[SF_PACED] = -SF_INF;
    course->rest_x = course->pace = course->rests = SF_INF;
    course->reaction = REACTION_TICKS * period;
    course->foresight = HOLD_OUT + course->reaction + course->limit / course->brake;
    limit_authority(course);
    sf_curve_place(course, R(0)); /* Whether a course leads there is then found sooner. */
    return NEXT;
}

void sf_grant(sf_course *course, int64_t authority_ms) {
    if (authority_ms <= course->told_ms) return;
    course->told_ms = authority_ms;
    limit_authority(course);
}

bool sf_rests_where(const sf_course *course, sf_course *coming) {
    if (!coming->from_rest || !course->located) return false;
    sf_start_from(coming, &course->follower.pose);
    return coming->follower.seen_off <= TURN_SHARE * coming->track;
}

bool sf_leads_into(sf_course *course, sf_course *coming, bool at_goal) {
    sf_timeline *line = &course->timeline;
    bool rests = coming->from_rest;
    sf_real begin = begin_of(course, coming), time = begin;
    sf_real reported = sf_time_of_ms(course, course->stamp_ms - (int64_t)LATE_STEP_MS * course->late);
    sf_real latest = sf_most(course->time, reported);
    if (!rests) time = sf_most(begin, latest);
    sf_real s = sf_s_at(course, time), there = sf_s_at(coming, as_of(coming, course, time));
    sf_real turn = sf_joint(course, at_goal ? line->length : s, coming, there);
    if (coming->follower.seen_off > JOINT_GAP) return false;
    if (rests) {
        if (at_goal || begin >= line->finish || course->authority <= begin) return true;
        if (latest > begin) return false;
        if (line->v == R(0)) return true;
    }
    return sf_abs(line->v - coming->timeline.v) <= JOINT_SPEED && sf_abs(turn) <= JOINT_TURN;
}

void sf_end_with(sf_course *course, sf_course *coming) {
    course->until = begin_of(course, coming);
    course->rests = course->until;
    if (!coming->from_rest) course->rests = SF_INF;
    limit_authority(course);
}

bool sf_is_over(sf_course *course, sf_course *coming, sf_real now, bool at_goal) {
    sf_real until = course->until;
    if (now < until) return false;
    sf_real enough = sf_least(course->authority, course->time + course->foresight);
    if (!coming->from_rest && (course->may_turn || told(course, coming) < enough)) return false;
    if (at_goal) return sf_is_near_goal(course);
    if (course->time < until && course->time < course->timeline.finish) return false;
    sf_real left = room(course, until), off = course->follower.off, track = course->track;
    if (left <= ARRIVAL_SLACK) return true;
    if (left * left + off * off > track * track) return false;
    return left <= (is_stuck(course) ? ARRIVAL_SHARE * track : course->speed * course->period);
}

void sf_follow(sf_course *course, sf_course *before) {
    if (!course->from_rest) {
        course->time = sf_most(as_of(course, before, before->time), course->begin);
        sf_real end = sf_s_at(before, before->until), passed = before->follower.s - end;
        course->follower.s = sf_least(sf_positive(passed), course->timeline.length);
    }
    course->halted = before->halted;
    course->may_turn = course->from_rest;
    course->watch = course->since[SF_PACED] = before->watch;
    course->speed = before->speed;
    course->pace = before->pace;
    course->brake_speed = before->brake_speed;
    course->since[SF_BRAKES] = before->since[SF_BRAKES];
}

uint8_t sf_turn_before_start(sf_course *course) {
    if (!course->may_turn) return SF_NO_FAULT;
    if (course->follower.s > course->track) {
        course->may_turn = false; /* One that has not turned to the end does not set out. */
        return course->turns ? SF_OFF_PATH : SF_NO_FAULT;
    }
    if (course->halted) return SF_NO_FAULT;
    uint8_t fault = sf_fault_at_start(course);
    course->may_turn = fault || course->turns;
    return fault;
}

/* How far behind a robot may seem that is not: by what its distance off the path leaves of the
   track tolerance, but by no more than the slack. */
SHARED static sf_real bearable(const sf_course *course) {
    return sf_least(course->slack, course->track - course->follower.off);
}

void sf_reckon(sf_course *course, int64_t now_ms) {
    sf_real reached = bearable(course) + course->follower.s;
    int64_t stamp_ms = now_ms;
    course->late = 0;
    if (reached < sf_s_at(course, sf_time_of_ms(course, now_ms)) || now_ms > MOST_STAMP) {
        sf_real passed = sf_time_at(course, sf_positive(reached));
        passed -= TIME_ERROR * passed;
        int64_t passed_ms = course->origin_ms + (int64_t)floor_of(R(1000) * passed);
        int64_t late_ms = now_ms - passed_ms;
        if (late_ms > MOST_LATE * LATE_STEP_MS || now_ms > MOST_STAMP) stamp_ms = passed_ms;
        else if (late_ms > 0) course->late = (uint16_t)(((int)late_ms + LATE_STEP_MS - 1) / LATE_STEP_MS);
    }
    course->stamp_ms = stamp_ms > -MOST_STAMP ? (int32_t)stamp_ms : -MOST_STAMP;
}

/* Whether the robot is more than GRACE behind a plan time. */
SHARED static bool lags(sf_course *course, sf_real time) {
    return !(course->follower.s >= sf_s_at(course, time - GRACE) - bearable(course));
}

/* A heading error theta leads theta / (e lambda) off the path before it is corrected. */
uint8_t sf_fault_at_start(sf_course *course) {
    sf_real turn = sf_start_from(course, &course->follower.pose), angle = sf_abs(turn);
    sf_real off = course->follower.seen_off, enough = TURN_SHARE * course->track;
    bool stands = off + angle * LED_OFF <= enough && angle <= (course->turns ? FACING : ASKEW);
    course->turns = false;
    if (!(off <= enough)) return SF_OFF_PATH;
    if (!stands) {
        course->turns = true;
        course->turn = turn;
    }
    return SF_NO_FAULT;
}

uint8_t sf_trouble(sf_course *course) {
    sf_real off = course->follower.off;
    if (off <= course->track && off + course->follower.s - course->granted > course->track) {
        off = sf_away_from(course, course->granted);
    }
    return off <= course->track ? SF_NO_FAULT : SF_OFF_PATH;
}

/* How much of the course is left. */
static sf_real left(const sf_course *course) {
    return course->timeline.length - course->follower.s;
}

/* Whether the robot is where the course ends, and its distance from the path within a limit. */
SHARED static bool ends_here(const sf_course *course, sf_real most_off) {
    return left(course) <= ARRIVAL_SLACK && course->follower.off <= most_off;
}

bool sf_arrived(const sf_course *course) {
    sf_real over = course->time - course->timeline.finish;
    if (over < R(0)) return false;
    if (over >= ARRIVAL_PATIENCE && is_stuck(course))
        return left(course) <= ARRIVAL_SHARE * course->track && sf_is_near_goal(course);
    return ends_here(course, course->slack);
}

bool sf_at_goal(const sf_course *course) { return ends_here(course, course->track); }

SHARED bool sf_is_near_goal(const sf_course *course) {
    return course->follower.off + sf_abs(left(course)) <= course->track;
}

/* Let one period pass on the watch, the time that the ticks have taken, whatever clocks do. */
SHARED static void pass_period(sf_course *course) {
    course->watch += course->period;
    if (!(course->watch > LONGEST_WATCH)) return;
    sf_real passed = course->watch;
    course->watch = R(0);
    for (int what = 0; what < SF_SINCE; what++) course->since[what] -= passed;
}

static void brake_on(sf_course *course) {
    sf_real passed = course->watch - course->since[SF_BRAKES], speed = course->brake_speed;
    if (passed > R(0)) speed = sf_positive(speed - course->brake * passed); /* The brake may be infinite. */
    course->speed = speed;
    sf_real later = course->time + passed + HOLD_OUT;
    sf_real most = room(course, sf_least(later, course->authority));
    sf_steer(course, sf_least(most, course->speed * HOLD_OUT));
}

/* The plan time by which a robot drives that lags behind now: it runs as fast as the robot's
   greatest speed allows, ends waits at once, and stands still while the robot does not follow. */
static sf_real advanced(sf_course *course, sf_real now) {
    if (lags(course, course->time)) return course->time;
    sf_real hurry = sf_clamp(course->limit / course->timeline.most_v, R(1), MOST_HURRY);
    sf_real time = sf_rest_until(course, course->time);
    return sf_least(time + hurry * course->period, now);
}

/* The room that is left, at most to where the authority ends; limits the speed. */
static sf_real within_authority(sf_course *course, sf_real distance) {
    sf_real left = sf_positive(course->granted - course->follower.s), most;
    if (course->at_once) {
        most = left / course->reaction;
    } else {
        sf_real lost = course->brake * course->reaction;
        most = SF_SQRT(lost * lost + R(2) * course->brake * left) - lost;
    }
    course->speed = sf_least(course->speed, most);
    return sf_least(left, distance);
}

/* Let a period pass, and watch whether the robot gets on, and at what pace. */
SHARED static void observe(sf_course *course) {
    pass_period(course);
    sf_real s = course->follower.s, watch = course->watch;
    if (course->halted || !(sf_abs(s - course->stuck_s) <= REST_SLACK)) {
        course->since[SF_STUCK] = watch;
        course->stuck_s = s;
    }
    sf_real passed = watch - course->since[SF_PACED];
    if (passed >= PACE_TIME) {
        course->pace = SF_INF;
        if (passed < R(1)) course->pace = (s - course->pace_s) / passed;
        course->since[SF_PACED] = watch;
        course->pace_s = s;
    }
}

void sf_keep_to_plan(sf_course *course, sf_real now) {
    observe(course);
    sf_real s = course->follower.s, period = course->period;
    if (course->halted || now < course->time) {
        if (!course->holds) {
            sf_begin_to_brake(course);
            course->since[SF_BRAKES] -= period;
        }
        course->holds = true;
        if (s > sf_s_at(course, course->time)) course->time = sf_time_at(course, s);
        brake_on(course);
        return;
    }
    course->holds = false;
    sf_real time = course->time = lags(course, now) ? advanced(course, now) : now;
    sf_real planned = sf_s_at(course, time), speed = (sf_s_at(course, time + period) - planned) / period;
    sf_real lag = planned - s, more = lag * course->catch_up;
    /* Of a lag below 0 the root is NaN, which is never the least. */
    more = sf_least(more, SF_SQRT(R(2) * CATCH_UP_BRAKE * course->brake * lag));
    course->speed = sf_least(sf_positive(speed + more), course->limit);
    sf_real distance = room(course, time + HOLD_OUT);
    if (course->authority < time + course->foresight) distance = within_authority(course, distance);
    sf_steer(course, distance);
}

SHARED void sf_begin_to_brake(sf_course *course) {
    course->brake_speed = R(0);
    if (!is_stuck(course)) {
        sf_real seen = sf_positive(course->pace) + R(2) * PACE_TIME * course->brake;
        course->brake_speed = sf_least(seen, course->speed);
    }
    course->since[SF_BRAKES] = course->watch;
    course->rest_x = SF_INF;
}

bool sf_brakes_to_rest(sf_course *course) {
    const sf_pose *pose = &course->follower.pose;
    pass_period(course);
    brake_on(course);
    sf_real x = pose->at[SF_X], y = pose->at[SF_Y];
    bool moved = !(sf_abs(x - course->rest_x) + sf_abs(y - course->rest_y) <= REST_SLACK);
    if (course->speed > R(0) || moved) {
        course->since[SF_RESTS] = course->watch;
        course->rest_x = x;
        course->rest_y = y;
    }
    return lasts(course, SF_RESTS);
}

void sf_stand(sf_course *course) {
    sf_find(course);
    course->speed = course->curvature = course->distance = R(0);
}

#include "core_end.h"
