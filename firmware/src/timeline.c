/* The arc length s(t) of a robot at plan time t: protocol/timeline.py.

   Leg i drives from s[i] to s[i + 1] with speeds v[i] and v[i + 1], from t0[i] to t1[i]; between
   t1[i] and t0[i + 1] the robot rests.  plan.c builds the legs. */

#include "core.h"

SHARED sf_real sf_slope(const sf_knot *leg) {
    return (leg[1].v * leg[1].v - leg->v * leg->v) / (leg[1].s - leg->s);
}

bool sf_timeline_leg(sf_course *course) {
    sf_timeline *line = &course->timeline;
    sf_knot *leg = line->next;
    sf_real both = leg->v + leg[1].v, driven = leg[1].s - leg->s;
    if (!(both > R(0)) || !(driven > R(0))) return false;
    leg->t0 = line->finish;
    leg->t1 = line->finish = leg->t0 + R(2) * driven / both;
    line->next++;
    return true;
}

static bool is_last(const sf_timeline *line, const sf_knot *leg) { return leg + 1 >= line->next; }

/* The last leg that has begun, or the first if none has; the search starts at the one found last. */
SHARED static const sf_knot *find(sf_course *course, sf_real time) {
    sf_timeline *line = &course->timeline;
    const sf_knot *leg = line->leg;
    while (!is_last(line, leg) && time >= leg[1].t0) leg++;
    while (leg > line->knots && time < leg->t0) leg--;
    line->leg = leg;
    return leg;
}

sf_real sf_s_at(sf_course *course, sf_real time) {
    sf_timeline *line = &course->timeline;
    const sf_knot *leg = find(course, time);
    sf_real passed = time - leg->t0, v = leg->v;
    line->v = R(0);
    if (time >= leg->t1) return leg[1].s;
    if (passed < R(0)) return leg->s;
    sf_real rate = (leg[1].v - v) / (leg->t1 - leg->t0);
    line->v = v + rate * passed;
    return leg->s + passed * (v + R(0.5) * rate * passed);
}

sf_real sf_time_at(const sf_course *course, sf_real s) {
    const sf_timeline *line = &course->timeline;
    for (const sf_knot *leg = line->knots; leg < line->next; leg++) {
        if (!(s <= leg[1].s)) continue;
        sf_real passed = s - leg->s, v = leg->v;
        if (!(passed > R(0))) return leg->t0;
        return leg->t0 + R(2) * passed / (v + SF_SQRT(sf_positive(v * v + sf_slope(leg) * passed)));
    }
    return line->finish;
}

sf_real sf_rest_until(sf_course *course, sf_real time) {
    const sf_knot *leg = find(course, time);
    if (time >= leg->t1 && !is_last(&course->timeline, leg)) leg++;
    return sf_most(time, leg->t0);
}

#include "core_end.h"
