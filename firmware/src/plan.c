/* A Plan message becomes a course, a piece of work per tick: protocol/codec.py, plan_bytes.py,
   plan_parts.py and the constructors of Curve, Timeline and Ride.

   The stages: checksum, fields, their numbers, whether the robot takes it, points, speed knots,
   stops, legs, arc lengths.  A message that is not acceptable is dropped; one that is, but is no
   valid course, is told to the agent. */

#include "core.h"

enum { NONE, CHECKSUM, FIELDS, SPEED_KNOTS, STOPS, LEGS, CELLS };

enum { POINTS, KNOTS, WEIGHTS, SPEEDS, PROFILE, PACKED_STOPS, FIELDS_PACKED };

/* Of each packed field: the bytes of one element, and from one float32 to the next. */
static const uint8_t SIZES[FIELDS_PACKED][2] = {{8, 4}, {4, 4}, {4, 4}, {4, 4}, {5, 5}, {12, 12}};

enum { SEAL_BYTES = 5, MOST_PACKED = 3600, MOST_MESSAGE = 4000 };

SHARED static uint32_t word(const uint8_t *at) {
    return at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

SHARED static sf_real real(const uint8_t *at) {
    union {
        uint32_t bits;
        float value;
    } both = {.bits = word(at)};
    return (sf_real)both.value;
}

static int64_t departure_ns(const uint8_t *stop) {
    uint64_t bits = (uint64_t)word(stop + 8) << 32 | word(stop + 4);
    return bits >> 63 ? -(int64_t)~bits - 1 : (int64_t)bits;
}

/* CRC-32 (reflected polynomial 0xEDB88320), half a byte at a time. */
static uint32_t crc(uint32_t state, uint8_t byte) {
    static const uint32_t TABLE[16] = {
        0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4,
        0x4DB26158, 0x5005713C, 0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C,
        0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C,
    };
    state ^= byte;
    state = state >> 4 ^ TABLE[state & 15];
    return state >> 4 ^ TABLE[state & 15];
}

/* Read the fields, and check what has to hold for the message to be acceptable. */
static bool read_fields(sf_agent *agent) {
    sf_plan *plan = &agent->plan;
    const char *id = sf_robot_of(agent)->id;
    sf_reader reader;
    sf_open(&reader, plan->bytes, plan->length);
    sf_get_int(&reader, 2, 2);
    plan->epoch = sf_get_counter(&reader);
    plan->boot = sf_get_counter(&reader);
    uint32_t length, i = 0;
    const uint8_t *robot = sf_get_text(&reader, &length);
    while (i < length && id[i] == (char)robot[i]) i++;
    if (i < length || id[i] || length == 0) return false;
    plan->number = sf_get_counter(&reader);
    plan->revision = sf_get_counter(&reader);
    plan->begin_ms = (int32_t)sf_get_int(&reader, INT32_MIN, INT32_MAX);
    sf_get_int(&reader, 0, 1000000000000);
    plan->track_mm = (uint16_t)sf_get_int(&reader, 0, 65535);
    plan->brake_mmps2 = sf_get_counter(&reader);
    plan->clock_ms = (uint16_t)sf_get_int(&reader, 1, 65535);
    plan->degree = (uint8_t)sf_get_int(&reader, 1, SF_DEGREE);
    for (int field = 0; field < FIELDS_PACKED; field++) {
        const uint8_t *at = plan->packed[field] = sf_get_bytes(&reader, &length);
        if (length > MOST_PACKED || length % SIZES[field][0]) return false;
        plan->counts[field] = (uint16_t)(length / SIZES[field][0]);
        for (i = 0; i < length; i += SIZES[field][1]) {
            if ((word(at + i) & 0x7F800000) == 0x7F800000) return false;
            if (field == PROFILE && at[i + 4] >= plan->counts[SPEEDS]) return false;
        }
    }
    return sf_close(&reader);
}

/* Fill in the curve's knots, points and weights; false if they are no curve. */
static bool read_curve(const sf_plan *plan, sf_course *course) {
    sf_curve *curve = &course->curve;
    unsigned count = plan->counts[POINTS], degree = plan->degree, inner = plan->counts[KNOTS];
    const uint8_t *knots = plan->packed[KNOTS], *point = plan->packed[POINTS];
    const uint8_t *weights = plan->packed[WEIGHTS];
    bool weighted = plan->counts[WEIGHTS] > 0;
    if (count > SF_POINTS || count <= degree || inner != count - degree) return false;
    if (weighted && plan->counts[WEIGHTS] != count) return false;
    curve->degree = plan->degree;
    curve->count = (uint16_t)count;
    for (unsigned i = 0; i <= degree; i++) {
        curve->knots[i] = R(0);
        curve->knots[count + i] = real(knots + 4 * (inner - 1));
    }
    for (unsigned i = 0; i + 1 < inner; i++) curve->knots[degree + 1 + i] = real(knots + 4 * i);
    for (unsigned i = 0; i < count; i++) {
        sf_real weight = weighted ? real(weights + 4 * i) : R(1);
        curve->hx[i] = real(point + 8 * i) * weight;
        curve->hy[i] = real(point + 8 * i + 4) * weight;
        curve->hw[i] = weight;
    }
    return sf_curve_begin(curve);
}

/* Add a speed knot at place `at`, or before it where it belongs if they are sorted. */
static bool add_knot(sf_timeline *line, unsigned at, sf_real s, sf_real v, bool sorted) {
    if (at > SF_LEGS) return false;
    for (; sorted && at > 0; at--) {
        if (line->s[at - 1] < s || (line->s[at - 1] == s && line->v[at - 1] <= v)) break;
        line->s[at] = line->s[at - 1];
        line->v[at] = line->v[at - 1];
    }
    line->s[at] = s;
    line->v[at] = v;
    return true;
}

/* The checks of a Timeline, all but those of its stops. */
static bool is_profile(sf_timeline *line, unsigned count) {
    if (count < 2 || line->s[0] != R(0)) return false;
    line->most_v = R(0);
    for (unsigned i = 0; i < count; i++) {
        if (!(line->v[i] >= R(0)) || !(line->v[i] < R(1e3))) return false;
        if (i && (!(line->s[i] > line->s[i - 1]) || !(line->v[i] + line->v[i - 1] > R(0)))) return false;
        line->most_v = sf_most(line->most_v, line->v[i]);
    }
    line->length = line->s[count - 1];
    line->legs = line->leg = 0;
    line->leg_from = line->leg_to = SF_INF;
    return true;
}

static bool are_stops(const sf_plan *plan, const sf_timeline *line) {
    sf_real before = R(-1);
    for (unsigned i = 0; i < plan->counts[PACKED_STOPS]; i++) {
        const uint8_t *stop = plan->packed[PACKED_STOPS] + 12 * i;
        sf_real s = real(stop);
        int64_t depart_ns = departure_ns(stop);
        if (!(s >= R(0)) || !(s < line->length) || !(s > before)) return false;
        if (depart_ns <= -1000000 * SECOND || depart_ns >= 1000000 * SECOND) return false;
        before = s;
    }
    return true;
}

/* Add the legs up to the next speed knot, with the stops between. */
static bool add_legs(sf_plan *plan, sf_course *course) {
    sf_timeline *line = &course->timeline;
    unsigned first = line->legs, count = plan->at;
    sf_real s = line->s[first], v = line->v[first], time = plan->time;
    sf_real end_s = line->s[first + 1], end_v = line->v[first + 1];
    sf_real slope = (end_v * end_v - v * v) / (end_s - s);
    for (; plan->stop < plan->counts[PACKED_STOPS]; plan->stop++) {
        const uint8_t *stop = plan->packed[PACKED_STOPS] + 12 * plan->stop;
        sf_real stop_s = real(stop);
        if (!(stop_s < end_s)) break;
        if (stop_s > s) {
            sf_real next_v = SF_SQRT(sf_most(v * v + slope * (stop_s - s), R(0)));
            if (count > SF_LEGS) return false;
            for (unsigned i = count++; i > line->legs + 1u; i--) {
                line->s[i] = line->s[i - 1];
                line->v[i] = line->v[i - 1];
            }
            line->s[line->legs + 1] = stop_s;
            line->v[line->legs + 1] = next_v;
            if (!sf_timeline_leg(line, time, stop_s, next_v)) return false;
            time = line->finish;
            s = stop_s;
            v = next_v;
        }
        int64_t origin_ns = course->origin_ms * MILLISECOND;
        time = sf_most(time, sf_seconds_of_ns(departure_ns(stop) - origin_ns));
    }
    if (!sf_timeline_leg(line, time, end_s, end_v)) return false;
    plan->time = line->finish;
    plan->at = (uint16_t)count;
    return true;
}

static void begin_course(const sf_plan *plan, sf_course *course) {
    course->begin_ms = plan->begin_ms;
#ifdef SF_DOUBLE
    course->origin_ms = 0;
#else
    course->origin_ms = plan->begin_ms;
#endif
    course->begin = sf_time_of_ms(course, plan->begin_ms);
}

/* Do one piece of the work, and return its size; stage NONE: the message was dropped or taken. */
static int64_t work_on(sf_agent *agent) {
    sf_plan *plan = &agent->plan;
    sf_course *course = &agent->courses[plan->course];
    sf_timeline *line = &course->timeline;
    unsigned speed_knots = plan->counts[PROFILE], stops = plan->counts[PACKED_STOPS];
    const uint8_t *place;
    bool braking = plan->brake_mmps2 > 0, fine = true;
    switch (plan->stage) {
    case CHECKSUM:
        for (unsigned i = 0; i < 16 && plan->at < plan->length - SEAL_BYTES; i++)
            plan->crc = crc(plan->crc, plan->bytes[plan->at++]);
        if (plan->at < plan->length - SEAL_BYTES) return 16;
        place = plan->bytes + plan->at;
        plan->crc = ~plan->crc;
        for (int i = 0; i < 4; i++) fine = fine && place[1 + i] == (uint8_t)(plan->crc >> (24 - 8 * i));
        plan->stage = fine && place[0] == 0xCE ? FIELDS : NONE;
        return 16;
    case FIELDS:
        if (!read_fields(agent) || !sf_takes_plan(agent, plan)) {
            plan->stage = NONE;
            return 1;
        }
        plan->course = agent->ride == &agent->courses[0];
        course = &agent->courses[plan->course];
        line = &course->timeline;
        speed_knots = plan->counts[PROFILE];
        stops = plan->counts[PACKED_STOPS];
        plan->stage = SPEED_KNOTS;
        plan->at = plan->stop = 0;
        begin_course(plan, course);
        plan->time = course->begin;
        fine = read_curve(plan, course) && speed_knots <= SF_SPEEDS && stops <= SF_STOPS;
        if (fine) sf_measure_begin(plan, &course->curve);
        break;
    case SPEED_KNOTS:
        if (plan->at < speed_knots) {
            place = plan->packed[PROFILE] + 5 * plan->at;
            sf_real v = real(plan->packed[SPEEDS] + 4 * place[4]);
            fine = add_knot(line, plan->at++, real(place), v, braking);
        } else {
            plan->stage = STOPS;
        }
        break;
    case STOPS:
        if (braking && plan->stop < stops) {
            sf_real s = real(plan->packed[PACKED_STOPS] + 12 * plan->stop++);
            if (s > R(0)) fine = add_knot(line, plan->at++, s, R(0), true);
        } else {
            fine = is_profile(line, plan->at) && are_stops(plan, line);
            plan->stop = 0;
            plan->stage = LEGS;
        }
        break;
    case LEGS:
        if (line->legs + 1u < plan->at) fine = add_legs(plan, course);
        else plan->stage = CELLS;
        break;
    default:
        if (sf_measure_cell(plan, &course->curve)) break;
        const sf_robot *robot = sf_robot_of(agent);
        plan->stage = NONE;
        fine = sf_ride_begin(course, plan, robot->speed_limit, sf_seconds_of_ns(robot->period_ns));
        sf_plan_taken(agent, course, fine);
        return 1;
    }
    if (!fine) {
        plan->stage = NONE;
        sf_plan_taken(agent, course, false);
    }
    static const uint8_t WORK[] = {[FIELDS] = 60, [SPEED_KNOTS] = 4, [STOPS] = 30, [LEGS] = 8, [CELLS] = 25};
    return plan->stage ? WORK[plan->stage] : 1;
}

void sf_read_plan(sf_agent *agent, int64_t work) {
    while (agent->plan.stage && work > 0) work -= work_on(agent);
}

bool sf_is_reading(const sf_agent *agent) { return agent->plan.stage != NONE; }

bool sf_hear_plan(sf_agent *agent, const uint8_t *bytes, size_t length) {
    sf_plan *plan = &agent->plan;
    if (sf_is_reading(agent) || length <= SEAL_BYTES || length > MOST_MESSAGE) return false;
    *plan = (sf_plan){.bytes = bytes, .length = (uint16_t)length, .crc = 0xFFFFFFFF, .stage = CHECKSUM};
    if (SF_WORK == 0) sf_read_plan(agent, INT64_MAX);
    return true;
}
