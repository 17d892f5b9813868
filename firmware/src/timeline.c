/* The arc length s(t) of a robot at plan time t: protocol/timeline.py.

   Leg i drives from s[i] to s[i + 1] with speeds v[i] and v[i + 1], from t0[i] to t1[i]; between
   t1[i] and t0[i + 1] the robot rests.  plan.c builds the legs. */

#include "core.h"

bool sf_timeline_leg(sf_timeline *line, sf_real time, sf_real s1, sf_real v1) {
    unsigned leg = line->legs;
    sf_real both = line->v[leg] + v1;
    if (!(both > R(0))) return false;
    line->t0[leg] = time;
    line->t1[leg] = line->finish = time + R(2) * (s1 - line->s[leg]) / both;
    line->legs++;
    return true;
}

SHARED static unsigned find(sf_timeline *line, sf_real time) {
    unsigned leg = line->leg, last = line->legs - 1u;
    if (line->leg_from <= time && time < line->leg_to) return leg;
    while (leg < last && time >= line->t0[leg + 1]) leg++;
    while (leg > 0 && time < line->t0[leg]) leg--;
    line->leg = (uint16_t)leg;
    line->leg_from = leg > 0 ? line->t0[leg] : -SF_INF;
    line->leg_to = leg < last ? line->t0[leg + 1] : SF_INF;
    line->begin = line->t0[leg];
    line->end = line->t1[leg];
    line->s0 = line->s[leg];
    line->s1 = line->s[leg + 1];
    line->v0 = line->v[leg];
    sf_real lasts = line->end - line->begin;
    line->half_rate = R(0);
    if (line->end > line->begin) line->half_rate = R(0.5) * ((line->v[leg + 1] - line->v0) / lasts);
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
    sf_real passed = time - line->t0[leg];
    if (passed < R(0) || time >= line->t1[leg]) return R(0);
    sf_real rate = (line->v[leg + 1] - line->v[leg]) / (line->t1[leg] - line->t0[leg]);
    return line->v[leg] + rate * passed;
}

sf_real sf_time_at(const sf_timeline *line, sf_real s) {
    for (unsigned leg = 0; leg < line->legs; leg++) {
        if (!(s <= line->s[leg + 1])) continue;
        sf_real passed = sf_most(s - line->s[leg], R(0));
        if (!(passed > R(0))) return line->t0[leg];
        sf_real v0 = line->v[leg], v1 = line->v[leg + 1];
        sf_real slope = (v1 * v1 - v0 * v0) / (line->s[leg + 1] - line->s[leg]);
        sf_real v = SF_SQRT(sf_most(v0 * v0 + slope * passed, R(0)));
        return line->t0[leg] + R(2) * passed / (v0 + v);
    }
    return line->finish;
}

sf_real sf_rest_until(sf_timeline *line, sf_real time) {
    unsigned leg = find(line, time);
    if (time < line->t0[leg]) return line->t0[leg];
    if (time >= line->t1[leg] && leg < line->legs - 1u) return line->t0[leg + 1];
    return time;
}
