/* The state machine of one robot: robot_agent/core/agent.py, transitions.py, leader.py and
   resting_place.py, whose rules these are.

   A robot moves only in the epoch of the plan it holds, after GO, only along that plan, never ahead
   of it, never beyond its authority; it brakes in time for that place. */

#include "core.h"

#define LATE_TICK (50 * MILLISECOND)
#define CLOCK_PATIENCE R(3)
#define HOLD_OUT R(0.05)

enum {
    READY, NOT_READY, TOLD_TO_GO, TOLD_TO_FREEZE, NEW_EPOCH, AT_REST, ARRIVED, LEFT_PATH, NEW_COURSE,
    TROUBLE = TOLD_TO_FREEZE /* changes the same */
};

/* Of each phase: for each event three bits, the next phase + 1; 0 leaves it unchanged. */
#define EVENT_BITS 3
#define TO(event, phase) (((uint32_t)(phase) + 1) << EVENT_BITS * (event))
static const uint32_t TRANSITIONS[6] = {
    [SF_IDLE] = TO(READY, SF_ARMED) | TO(NEW_EPOCH, SF_IDLE),
    [SF_ARMED] = TO(NOT_READY, SF_IDLE) | TO(TOLD_TO_GO, SF_MOVING) | TO(TOLD_TO_FREEZE, SF_FROZEN) |
                 TO(NEW_EPOCH, SF_IDLE),
    [SF_MOVING] = TO(TOLD_TO_FREEZE, SF_BRAKING) | TO(NEW_EPOCH, SF_BRAKING) | TO(ARRIVED, SF_DONE) |
                  TO(LEFT_PATH, SF_BRAKING),
    [SF_BRAKING] = TO(AT_REST, SF_FROZEN) | TO(ARRIVED, SF_DONE),
    [SF_FROZEN] = TO(NEW_EPOCH, SF_IDLE) | TO(NEW_COURSE, SF_MOVING),
    [SF_DONE] = TO(NEW_EPOCH, SF_IDLE) | TO(NEW_COURSE, SF_MOVING) | TO(LEFT_PATH, SF_BRAKING),
};

void sf_init(sf_agent *agent, const sf_robot *robot) {
    memset(agent, 0, sizeof *agent);
    agent->robot = robot;
    agent->ticked_ns = SF_UNKNOWN;
    agent->reported_ns = agent->hello_ns = SF_NEVER;
    agent->clock.now_ns = SF_NEVER;
    sf_clock_start_over(&agent->clock);
}

static bool before_motion(const sf_agent *agent) {
    return agent->phase == SF_IDLE || agent->phase == SF_ARMED;
}

SHARED static bool knows_time(const sf_agent *agent, const sf_course *ride) {
    return sf_clock_within(&agent->clock, ride->clock_ms);
}

/* Stand, and store the place of rest until the robot moves, even if the plan is dropped. */
SHARED static void rest(sf_agent *agent, bool tell) {
    sf_rest *rest = &agent->rest;
    sf_stand(agent->ride);
    rest->epoch = agent->epoch;
    rest->revision = agent->revision;
    rest->s = agent->ride->follower.s;
    rest->tell = tell;
    sf_offset(agent->ride, rest);
}

/* In every phase but IDLE the robot has a course. */
static void apply(sf_agent *agent, int event) {
    uint32_t entry = TRANSITIONS[agent->phase] >> EVENT_BITS * event & 7;
    if (entry == 0) return;
    agent->phase = (uint8_t)(entry - 1);
    switch (agent->phase) {
    case SF_IDLE:
        if (event == NOT_READY) break;
        agent->ride = agent->coming = NULL;
        agent->epoch = 0;
        agent->fault = SF_NO_FAULT;
        agent->rest.tell = false;
        sf_clock_start_over(&agent->clock);
        break;
    case SF_MOVING:
        agent->fault = SF_NO_FAULT;
        agent->rest.epoch = 0;
        agent->rest.tell = false;
        agent->spent_epoch = agent->epoch;
        break;
    case SF_BRAKING: sf_begin_to_brake(agent->ride); break;
    case SF_FROZEN: /* Where a course begins that has not begun, it does not stand. */
        rest(agent, true);
        agent->coming = NULL;
        agent->holds = agent->revision;
        agent->next_number = agent->number;
        agent->spent_epoch = agent->epoch;
        break;
    case SF_DONE: rest(agent, false); break;
    default: break;
    }
}

/* Brake, and record the fault if none is recorded yet; at the goal the only one is OFF_PATH.  A
   robot that has heard no Command yet arms again: it does not know whom to obey once it failed. */
SHARED static void fail(sf_agent *agent, uint8_t fault) {
    bool left = fault == SF_OFF_PATH;
    if (agent->fault == SF_NO_FAULT && (agent->phase != SF_DONE || left)) agent->fault = fault;
    apply(agent, !agent->leader.heard ? NOT_READY : left ? LEFT_PATH : TROUBLE);
}

/* Arm again with the time, unless the robot does without it. */
SHARED static void disarm(sf_agent *agent) {
    if (agent->phase == SF_ARMED && agent->unsure <= CLOCK_PATIENCE) apply(agent, NOT_READY);
}

SHARED static void lose_clock(sf_agent *agent) {
    sf_clock_start_over(&agent->clock);
    disarm(agent);
}

/* Whether an order is to be obeyed: the highest (term, boot) leads. */
static bool counts(const sf_agent *agent, const sf_order *order) {
    const sf_leader *leader = &agent->leader;
    const sf_order *last = &leader->order;
    uint64_t rank = (uint64_t)order->term << 32 | order->boot;
    uint64_t leading = (uint64_t)last->term << 32 | last->boot;
    if (!before_motion(agent) && order->run != last->run) return false;
    if (!leader->heard || rank > leading) return true;
    if (rank == leading) return order->sequence > last->sequence;
    return before_motion(agent) && agent->clock.now_ns - leader->heard_ns > COORDINATOR_TIMEOUT;
}

void sf_hear_command(sf_agent *agent, const sf_command *command) {
    sf_leader *leader = &agent->leader;
    const sf_order *order = &command->order;
    const sf_order *last = &leader->order;
    if (!counts(agent, order)) return;
    if (order->epoch != last->epoch && !agent->ride) agent->fault = SF_NO_FAULT;
    bool other_term = leader->heard && last->term != order->term;
    bool another = leader->known && (last->boot != order->boot || other_term);
    leader->known = leader->heard = true;
    leader->order = *order;
    leader->heard_ns = agent->clock.now_ns;
    if (another) {
        sf_clock_start_over(&agent->clock);
        if (before_motion(agent)) apply(agent, NEW_EPOCH);
    } else if (sf_is_said_in_future(&agent->clock, command->said_ns)) {
        lose_clock(agent);
    }
    sf_course *ride = agent->ride;
    if (order->phase == FREEZE || order->phase == OVER) {
        apply(agent, TOLD_TO_FREEZE);
        agent->finished = order->phase == OVER && agent->phase != SF_BRAKING;
    } else if (ride && order->epoch > agent->epoch) {
        apply(agent, NEW_EPOCH);
    } else if (ride && order->epoch == agent->epoch) {
        ride->halted = order->phase == STOP;
        if (order->phase == GO) {
            sf_grant(ride, command->granted[0].authority_ms);
            if (agent->coming) sf_grant(agent->coming, command->granted[1].authority_ms);
            agent->start_ns = command->start_ns;
            if (command->said_ns >= command->start_ns || knows_time(agent, ride))
                apply(agent, TOLD_TO_GO);
        }
    }
    if (order->asks && agent->rest.epoch > 0) agent->rest.tell = true;
}

void sf_hear_clock(sf_agent *agent, const sf_answer *answer) {
    const sf_leader *leader = &agent->leader; /* Only whom it obeys tells it the time. */
    if (!leader->known || answer->coordinator != leader->order.boot) return;
    if (!sf_clock_add(&agent->clock, answer)) lose_clock(agent);
}

static bool takes_courses(const sf_agent *agent, const sf_plan *plan) {
    bool may = !before_motion(agent) && agent->phase != SF_BRAKING;
    return may && plan->epoch == agent->epoch;
}

static bool is_of_leader(const sf_agent *agent, const sf_plan *plan) {
    return plan->boot == agent->leader.order.boot && plan->epoch == agent->leader.order.epoch;
}

bool sf_takes_plan(sf_agent *agent, sf_plan *plan) {
    sf_leader *leader = &agent->leader;
    if (!leader->known) {
        leader->known = true;
        leader->order.boot = plan->boot;
        leader->order.epoch = plan->epoch;
    }
    if (!is_of_leader(agent, plan)) return false;
    plan->next = takes_courses(agent, plan);
    if (plan->next) return plan->revision > agent->taken && !agent->coming;
    if (!before_motion(agent)) return false;
    if (plan->epoch <= agent->epoch || plan->epoch <= agent->spent_epoch) return false;
    agent->phase = SF_IDLE;
    agent->ride = NULL;
    agent->epoch = 0;
    agent->fault = SF_NO_FAULT;
    agent->unsure = R(0);
    return true;
}

/* Whether the robot has stopped where a newer course begins, or was never let set out on its own:
   the coordinator may have taken that back before the robot heard of it. */
static bool stands_where(const sf_agent *agent, sf_course *coming) {
    const sf_course *ride = agent->ride;
    bool stands = agent->phase == SF_FROZEN || ride->authority <= ride->begin;
    return stands && sf_rests_where(ride, coming);
}

/* Hold a newer course, if the robot stands at its beginning, or is on its way there. */
static void hear_course(sf_agent *agent, const sf_plan *plan, sf_course *coming) {
    sf_course *ride = agent->ride;
    if (!takes_courses(agent, plan)) return;
    uint8_t phase = agent->phase;
    bool may_lead = phase != SF_FROZEN && sf_leads_into(ride, coming, phase == SF_DONE);
    if (!may_lead && !stands_where(agent, coming)) return;
    sf_end_with(ride, coming);
    agent->coming = coming;
    agent->next_number = plan->number;
    agent->holds = agent->taken = plan->revision;
}

void sf_plan_taken(sf_agent *agent, sf_course *course, bool valid) {
    const sf_plan *plan = &agent->plan;
    if (!is_of_leader(agent, plan)) return; /* It was while the robot began to read it. */
    if (plan->next) {
        if (valid) hear_course(agent, plan, course);
        return;
    }
    if (agent->phase != SF_IDLE || agent->ride) return;
    if (!valid) {
        agent->fault = SF_BAD_PLAN;
        return;
    }
    agent->ride = course;
    agent->epoch = plan->epoch;
    agent->number = agent->next_number = plan->number;
    agent->revision = agent->holds = agent->taken = plan->revision;
}

void sf_driver_failed(sf_agent *agent, int64_t now_ns) {
    agent->clock.now_ns = now_ns;
    fail(agent, SF_DRIVER_ERROR);
}

/* The plan time that it is now, after an origin, for a robot that knows the time; saturates. */
SHARED static int64_t plan_time_ns(const sf_agent *agent, int32_t origin_ms) {
    int64_t now_ns = agent->clock.now_ns + agent->clock.offset_ns;
    int64_t origin_ns = agent->start_ns + origin_ms * MILLISECOND;
    int64_t passed_ns = sf_difference(now_ns, origin_ns);
    if (((now_ns ^ origin_ns) & (now_ns ^ passed_ns)) >= 0) return passed_ns;
    return now_ns < 0 ? INT64_MIN : INT64_MAX;
}

/* The same as a course counts it; `otherwise` for a robot that does not know the time. */
SHARED static sf_real time_now(const sf_agent *agent, const sf_course *ride, sf_real otherwise) {
    if (!knows_time(agent, ride)) return otherwise;
    return sf_seconds_of_ns(plan_time_ns(agent, ride->origin_ms));
}

int64_t sf_plan_time_ms(const sf_agent *agent, const sf_course *ride) {
#ifndef SF_DOUBLE
    if (knows_time(agent, ride)) return plan_time_ns(agent, 0) / MILLISECOND;
#endif
    return ride->origin_ms + sf_whole(R(1000) * time_now(agent, ride, ride->time));
}

static void try_to_arm(sf_agent *agent, sf_course *ride) {
    agent->fault = sf_fault_at_start(ride);
    if (agent->fault || ride->turns) return;
    bool sure = sf_clock_within(&agent->clock, ride->clock_ms - CLOCK_RESERVE_MS);
    agent->unsure = sure ? R(0) : agent->unsure + agent->passed;
    if (sure || agent->unsure > CLOCK_PATIENCE) apply(agent, READY);
    else agent->fault = SF_CLOCK_UNSURE;
}

static void drive(sf_agent *agent, sf_course *ride) {
    if (agent->phase == SF_MOVING) {
        uint8_t fault = sf_turn_before_start(ride);
        sf_real now = time_now(agent, ride, ride->time + agent->passed);
        fault |= sf_trouble(ride); /* Either is SF_OFF_PATH. */
        if (fault != SF_NO_FAULT) fail(agent, fault);
        else if (sf_arrived(ride)) apply(agent, ARRIVED);
        else sf_keep_to_plan(ride, now);
    }
    if (agent->phase == SF_BRAKING && sf_brakes_to_rest(ride))
        apply(agent, sf_at_goal(ride) ? ARRIVED : AT_REST);
}

/* Leave the course for the newer one, and return that. */
static sf_course *change(sf_agent *agent) {
    sf_course *coming = agent->coming;
    sf_follow(coming, agent->ride);
    agent->ride = coming;
    agent->coming = NULL;
    agent->number = agent->next_number;
    agent->revision = agent->holds;
    apply(agent, NEW_COURSE);
    return coming;
}

/* The course to drive now: the newer one, once it has begun. */
static sf_course *on_course(sf_agent *agent) {
    sf_course *ride = agent->ride, *coming = agent->coming;
    bool over, has_stopped = agent->phase == SF_FROZEN, at_goal = agent->phase == SF_DONE;
    if (before_motion(agent) || (has_stopped && agent->leader.order.phase != GO)) return ride;
    sf_locate(ride, &agent->pose);
    if (stands_where(agent, coming)) {
        over = time_now(agent, coming, SF_INF) >= coming->begin;
    } else { /* At its goal no plan time passes for a robot that does not know the time. */
        sf_real now = time_now(agent, ride, at_goal ? SF_INF : ride->time);
        over = !has_stopped && sf_is_over(ride, coming, now, at_goal);
    }
    return over ? change(agent) : ride;
}

/* Decide what the robot does in its phase. */
static void decide(sf_agent *agent) {
    sf_course *ride = agent->ride;
    if (agent->phase == SF_ARMED && !knows_time(agent, ride)) disarm(agent);
    if (agent->coming) ride = on_course(agent);
    if (agent->phase == SF_ARMED || agent->phase == SF_FROZEN) return;
    sf_locate(ride, &agent->pose); /* If it fails before it sets out, it rests there. */
    ride->turn = R(0);
    if (agent->phase == SF_IDLE) try_to_arm(agent, ride);
    else if (agent->phase != SF_DONE) drive(agent, ride);
    else if (!sf_is_near_goal(ride)) fail(agent, SF_OFF_PATH);
    agent->drive_speed = ride->speed; /* Of one that does not drive, all but the turn are 0. */
    agent->drive_curvature = ride->curvature;
    agent->drive_distance = ride->distance;
    agent->drive_turn = ride->turn;
}

void sf_tick(sf_agent *agent, int64_t now_ns, sf_real x, sf_real y, sf_real heading) {
    int64_t passed_ns = now_ns - agent->ticked_ns;
    agent->has_pose = x == x;
    agent->pose = (sf_pose){{x, y}, heading};
    if (!agent->has_pose) memset(&agent->pose, 0, sizeof agent->pose);
    agent->clock.now_ns = agent->ticked_ns = now_ns;
    bool late = passed_ns > LATE_TICK && passed_ns > 2 * ROBOT(agent)->period_ns;
    if (late) sf_clock_doubt(&agent->clock); /* It hung. */
    agent->passed = sf_least(sf_positive(sf_seconds_of_ns(passed_ns)), HOLD_OUT);
    sf_clock_follow(&agent->clock, sf_is_on_its_way(agent));
    agent->drive_speed = agent->drive_curvature = agent->drive_distance = agent->drive_turn = R(0);
    if (agent->ride) decide(agent);
    /* Last, so that no tick takes a course and changes to it. */
    sf_read_plan(&agent->plan, agent, SF_WORK);
}

bool sf_may_leave(const sf_agent *agent) { return agent->finished | agent->refused; }

#include "core_end.h"
