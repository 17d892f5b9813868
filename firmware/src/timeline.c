/* The arc length s(t) of a robot at plan time t: protocol/timeline.py.

   Leg i drives from s[i] to s[i + 1] with speeds v[i] and v[i + 1], from t0[i] to t1[i]; between
   t1[i] and t0[i + 1] the robot rests.  plan.c builds the legs. */

#include "core.h"

bool sf_timeline_leg(sf_timeline *line, sf_real time, sf_real s1, sf_real v1) {
    unsigned leg = line->legs;
    sf_real both = line->knots[leg].v + v1;
    if (!(both > R(0))) return false;
    line->knots[leg].t0 = time;
    line->knots[leg].t1 = line->finish = time + R(2) * (s1 - line->knots[leg].s) / both;
    line->legs++;
    return true;
}

SHARED static unsigned find(sf_timeline *line, sf_real time) {
    unsigned leg = line->leg, last = line->legs - 1u;
    if (line->leg_from <= time && time < line->leg_to) return leg;
    while (leg < last && time >= line->knots[leg + 1].t0) leg++;
    while (leg > 0 && time < line->knots[leg].t0) leg--;
    line->leg = (uint16_t)leg;
    line->leg_from = leg > 0 ? line->knots[leg].t0 : -SF_INF;
    line->leg_to = leg < last ? line->knots[leg + 1].t0 : SF_INF;
    line->begin = line->knots[leg].t0;
    line->end = line->knots[leg].t1;
    line->s0 = line->knots[leg].s;
    line->s1 = line->knots[leg + 1].s;
    line->v0 = line->knots[leg].v;
    sf_real lasts = line->end - line->begin;
    line->half_rate = R(0);
    if (line->end > line->begin) line->half_rate = R(0.5) * ((line->knots[leg + 1].v - line->v0) / lasts);
    return leg;
}

sf_real sf_s_at(sf_timeline *line, sf_real time) {
    find(line, time);
    sf_real passed = time - line->begin;
    if (passed <= R(0)) return line->s0;
    if (time >= line->end) return line->s1;
    return line->s0 + passed * (line->v0 + line->half_rate * passed);
}

sf_real sf_v_at(sf_timeline *line, sf_real time) {
    unsigned leg = find(line, time);
    sf_real passed = time - line->knots[leg].t0;
    if (passed < R(0) || time >= line->knots[leg].t1) return R(0);
    const sf_knot *knot = &line->knots[leg];
    return knot->v + (knot[1].v - knot->v) / (knot->t1 - knot->t0) * passed;
}

sf_real sf_time_at(const sf_timeline *line, sf_real s) {
    for (unsigned leg = 0; leg < line->legs; leg++) {
        if (!(s <= line->knots[leg + 1].s)) continue;
        sf_real passed = sf_most(s - line->knots[leg].s, R(0));
        if (!(passed > R(0))) return line->knots[leg].t0;
        sf_real v0 = line->knots[leg].v, v1 = line->knots[leg + 1].v;
        sf_real slope = (v1 * v1 - v0 * v0) / (line->knots[leg + 1].s - line->knots[leg].s);
        sf_real v = SF_SQRT(sf_most(v0 * v0 + slope * passed, R(0)));
        return line->knots[leg].t0 + R(2) * passed / (v0 + v);
    }
    return line->finish;
}

sf_real sf_rest_until(sf_timeline *line, sf_real time) {
    unsigned leg = find(line, time);
    if (time < line->knots[leg].t0) return line->knots[leg].t0;
    if (time >= line->knots[leg].t1 && leg < line->legs - 1u) return line->knots[leg + 1].t0;
    return time;
}
