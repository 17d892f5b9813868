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
#define CLOSED INT64_MIN /* no message can name this time */

SHARED static int64_t drift(int64_t passed_ns) { return 1 + sf_floor_ratio(passed_ns, 1000000 / DRIFT_PPM); }

static int64_t middle(int64_t low, int64_t high) { return (low >> 1) + (high >> 1) + (low & high & 1); }

/* The question that was asked at this time; NULL if none was, or it is closed. */
static int64_t *question(sf_clock *clock, int64_t sent_ns) {
    for (int64_t *at = clock->open_ns; at < clock->open_ns + SF_QUESTIONS; at++)
        if (*at == sent_ns) return at;
    return NULL;
}

SHARED static void doubt(sf_clock *clock) {
    clock->since_ns = clock->now_ns;
    clock->asked_ns = -SF_UNKNOWN;
    clock->good = clock->asked = 0;
    clock->period_ns = CLOCK_PERIOD_FAST;
}

void sf_clock_begin(sf_clock *clock) {
    clock->low_ns = -SF_UNKNOWN;
    clock->high_ns = SF_UNKNOWN;
    for (int i = 0; i < SF_QUESTIONS; i++) clock->open_ns[i] = CLOSED;
    clock->now_ns = -SF_UNKNOWN;
    doubt(clock);
}

void sf_clock_start_over(sf_clock *clock) {
    doubt(clock);
    clock->compares = clock->slewing = false;
}

void sf_clock_doubt(sf_clock *clock) {
    if (clock->good == 0) return;
    doubt(clock);
    clock->compares = true;
}

/* How much wider than when it was made the interval is now, on either side. */
SHARED static int64_t aged(const sf_clock *clock) {
    return drift(sf_difference(clock->now_ns, clock->at_ns));
}

bool sf_clock_add(sf_clock *clock, const sf_answer *answer) {
    int64_t sent = answer->sent_ns, received = answer->received_ns, answered = answer->answered_ns;
    int64_t *open = question(clock, sent);
    if (sent < clock->since_ns || answered < received || !open) return true;
    *open = CLOSED;
    int64_t passed = sf_difference(clock->now_ns, sent);
    if (passed < 0 || passed > LONGEST_DELAY) return true;
    int64_t error = drift(passed), old_error = aged(clock);
    int64_t low = sf_difference(sf_difference(answered, clock->now_ns), error);
    int64_t high = sf_sum(sf_difference(received, sent), error);
    int64_t old_low = sf_difference(clock->low_ns, old_error);
    int64_t old_high = sf_sum(clock->high_ns, old_error);
    bool known = clock->good > 0 || clock->compares;
    if (low > high || (known && (low > old_high || high < old_low))) return false;
    if (clock->good > 0) {
        if (old_low > low) low = old_low;
        if (old_high < high) high = old_high;
    }
    clock->low_ns = low;
    clock->high_ns = high;
    clock->at_ns = clock->now_ns;
    clock->middle_ns = middle(low, high);
    clock->compares = false;
    if (clock->good < UINT32_MAX) clock->good++;
    if (!clock->slewing) clock->offset_ns = clock->middle_ns;
    return true;
}

bool sf_is_said_in_future(const sf_clock *clock, int64_t said_ns) {
    return clock->good > 0 &&
           sf_difference(said_ns, clock->now_ns) > sf_sum(clock->high_ns, aged(clock));
}

void sf_clock_follow(sf_clock *clock, bool slewing) {
    int64_t passed = sf_difference(clock->now_ns, clock->followed_ns);
    clock->followed_ns = clock->now_ns;
    clock->slewing = slewing;
    int64_t left = sf_difference(clock->middle_ns, clock->offset_ns);
    if (left == 0 || clock->good == 0) return;
    int64_t most = slewing ? sf_floor_ratio(passed, SLEW_SHARE) : 0;
    if (slewing && (left > most || left < -most))
        clock->offset_ns = sf_sum(clock->offset_ns, left > 0 ? most : -most);
    else
        clock->offset_ns = clock->middle_ns;
}

bool sf_clock_asks(sf_clock *clock, int enough_ms, bool moving) {
    int64_t passed = sf_difference(clock->now_ns, clock->asked_ns);
    bool rarely = (moving || clock->good >= CLOCK_SAMPLES) && sf_clock_within(clock, enough_ms);
    if (passed < (rarely ? CLOCK_PERIOD : clock->period_ns)) return false;
    clock->asked_ns = clock->open_ns[clock->place++ % SF_QUESTIONS] = clock->now_ns;
    if (rarely) clock->asked = 0;
    else if (clock->asked < MOST_ASKED) clock->asked++;
    clock->period_ns = (uint32_t)CLOCK_PERIOD_FAST * (1u + clock->asked / CLOCK_SAMPLES);
    return true;
}

bool sf_clock_within(const sf_clock *clock, int limit_ms) {
    int64_t above = sf_difference(clock->high_ns, clock->offset_ns);
    int64_t below = sf_difference(clock->offset_ns, clock->low_ns);
    int64_t error = sf_sum(above > below ? above : below, aged(clock));
    return clock->good > 0 && error <= limit_ms * MILLISECOND;
}
