/* An estimate of the coordinator's clock, with a bound on its error: robot_agent/core/clock_sync.py.

   One exchange has four stamps; the offset lies between t3 - t4 and t2 - t1, whatever the delays.
   It lies in the intersection of several such intervals, each widened by drift as it ages.  An
   answer counts only for a question that is open, and closes it. */

#include "core.h"

#define DRIFT_PPM 100
#define SLEW_SHARE 50
#define LONGEST_DELAY (10 * SECOND)
/* Asked so often, the robot asks every CLOCK_PERIOD. */
#define MOST_ASKED (CLOCK_SAMPLES * (CLOCK_PERIOD / CLOCK_PERIOD_FAST - 1))
/* A question's place in the ring holds this and when it was asked; 0, as at first, is none that is open. */
#define OPEN INT64_MIN

/* Let an interval grow on either side by what clocks drift apart in a time. */
SHARED static void widen(sf_interval *interval, int64_t passed_ns) {
    int64_t error = 1 + sf_floor_ratio(passed_ns, 1000000 / DRIFT_PPM);
    interval->low_ns -= error;
    interval->high_ns += error;
}

/* Where the offset may lie now. */
SHARED static void aged(const sf_clock *clock, sf_interval *interval) {
    *interval = clock->interval;
    widen(interval, clock->now_ns - clock->at_ns);
}

static int64_t middle(const sf_interval *interval) {
    uint64_t width = (uint64_t)interval->high_ns - (uint64_t)interval->low_ns;
    return interval->low_ns + (int64_t)(width / 2);
}

/* The question that was asked at this time; NULL if none was, or it is closed. */
static int64_t *question(sf_clock *clock, int64_t sent_ns) {
    for (int64_t *at = clock->open_ns; at < clock->open_ns + SF_QUESTIONS; at++)
        if (*at == (sent_ns ^ OPEN)) return at;
    return NULL;
}

SHARED static void doubt(sf_clock *clock, bool compares) {
    clock->compares = compares;
    clock->since_ns = clock->now_ns;
    clock->asked_ns = -SF_UNKNOWN;
    clock->good = clock->asked = 0;
}

void sf_clock_start_over(sf_clock *clock) {
    clock->slewing = false;
    doubt(clock, false);
}

void sf_clock_doubt(sf_clock *clock) {
    if (clock->good > 0) doubt(clock, true);
}

bool sf_clock_add(sf_clock *clock, const sf_answer *answer) {
    int64_t sent = answer->sent_ns, received = answer->received_ns, answered = answer->answered_ns;
    int64_t *open = question(clock, sent);
    if (sent < clock->since_ns || answered < received || !open) return true;
    *open = 0;
    int64_t passed = clock->now_ns - sent;
    if (passed < 0 || passed > LONGEST_DELAY) return true;
    sf_interval new = {answered - clock->now_ns, received - sent}, *kept = &clock->interval;
    widen(&new, passed);
    aged(clock, kept);
    if (clock->good == 0 && !clock->compares) *kept = new;
    if (kept->low_ns < new.low_ns) kept->low_ns = new.low_ns;
    if (kept->high_ns > new.high_ns) kept->high_ns = new.high_ns;
    if (kept->low_ns > kept->high_ns) return false; /* Then it starts over. */
    if (clock->good == 0) *kept = new;
    clock->at_ns = clock->now_ns;
    clock->middle_ns = middle(kept);
    clock->compares = false;
    if (clock->good < UINT32_MAX) clock->good++;
    if (!clock->slewing) clock->offset_ns = clock->middle_ns;
    return true;
}

bool sf_is_said_in_future(const sf_clock *clock, int64_t said_ns) {
    sf_interval now;
    aged(clock, &now);
    return clock->good > 0 && said_ns - clock->now_ns > now.high_ns;
}

void sf_clock_follow(sf_clock *clock, bool slewing) {
    int64_t passed = clock->now_ns - clock->followed_ns;
    clock->followed_ns = clock->now_ns;
    clock->slewing = slewing;
    int64_t left = sf_difference(clock->middle_ns, clock->offset_ns);
    if (left == 0 || clock->good == 0) return;
    if (slewing) {
        int64_t most = sf_floor_ratio(passed, SLEW_SHARE);
        if (left > most) left = most;
        else if (left < -most) left = -most;
    }
    clock->offset_ns += left;
}

bool sf_clock_asks(sf_clock *clock, int enough_ms, bool moving) {
    int64_t passed = clock->now_ns - clock->asked_ns;
    bool rarely = (moving || clock->good >= CLOCK_SAMPLES) && sf_clock_within(clock, enough_ms);
    uint32_t period_ns = (uint32_t)CLOCK_PERIOD_FAST * (1u + clock->asked / CLOCK_SAMPLES);
    if (passed < (rarely ? CLOCK_PERIOD : period_ns)) return false;
    clock->asked_ns = clock->now_ns;
    clock->open_ns[clock->place++ % SF_QUESTIONS] = clock->now_ns ^ OPEN;
    if (rarely) clock->asked = 0;
    else if (clock->asked < MOST_ASKED) clock->asked++;
    return true;
}

bool sf_clock_within(const sf_clock *clock, int limit_ms) {
    sf_interval now;
    aged(clock, &now);
    int64_t above = sf_difference(now.high_ns, clock->offset_ns);
    int64_t below = sf_difference(clock->offset_ns, now.low_ns);
    return clock->good > 0 && (above > below ? above : below) <= limit_ms * MILLISECOND;
}

#include "core_end.h"
