/* A Plan message becomes a course, a piece of work per tick: protocol/codec.py, plan_bytes.py,
   plan_parts.py and the constructors of Curve, Timeline and Ride.

   The stages: fields, checksum, their numbers, whether the robot takes it, points, speed knots, stops,
   legs, arc lengths.  A message that is not acceptable is dropped; one that is, but is no
   valid course, is told to the agent. */

#include "core.h"

enum { NONE, FIELDS, CHECKSUM, NUMBERS, CURVE, MEASURE, SPEED_KNOTS, STOPS, LEGS, CELLS, TAKE };

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

#define FIELD(kind, name) {(kind), offsetof(sf_plan, name)}
static const sf_field HEAD_FIELDS[] = {FIELD(SF_U32, epoch), FIELD(SF_U32, boot)};
static const sf_field FIELDS_BEHIND[] = {
    FIELD(SF_U32, number), FIELD(SF_U32, revision), FIELD(SF_I32, begin_ms), FIELD(SF_STAMP, tau_ns),
    FIELD(SF_U16, track_mm), FIELD(SF_U32, brake_mmps2), FIELD(SF_U16, clock_ms), FIELD(SF_U8, degree),
};

/* Read the fields, and check what has to hold for the message to be acceptable. */
static bool read_fields(sf_agent *agent) {
    sf_plan *plan = &agent->plan;
    sf_reader reader;
    uint32_t length;
    sf_open(&reader, plan->bytes, plan->length);
    sf_get_fields(&reader, plan, HEAD_FIELDS, 2);
    const uint8_t *robot = sf_get_text(&reader, &length);
    if (length == 0 || !sf_is_named(sf_robot_of(agent)->id, robot, length)) return false;
    sf_get_fields(&reader, plan, FIELDS_BEHIND, 8);
    if (plan->tau_ns < 0 || plan->tau_ns > 1000 * SECOND || plan->clock_ms < 1) return false;
    if (plan->degree < 1 || plan->degree > SF_DEGREE) return false;
    for (int field = 0; field < FIELDS_PACKED; field++) {
        plan->packed[field] = sf_get_bytes(&reader, &length);
        if (length > MOST_PACKED || length % SIZES[field][0]) return false;
        plan->counts[field] = (uint16_t)(length / SIZES[field][0]);
    }
    return sf_close(&reader);
}

/* Check the next numbers of the packed fields, `at` bytes into field `stop`. */
static bool are_finite(sf_plan *plan) {
    unsigned field = plan->stop;
    const uint8_t *packed = plan->packed[field];
    for (int i = 0; i < 16 && plan->at < plan->counts[field] * SIZES[field][0]; i++) {
        const uint8_t *at = packed + plan->at;
        if ((word(at) & 0x7F800000) == 0x7F800000) return false;
        if (field == PROFILE && at[4] >= plan->counts[SPEEDS]) return false;
        plan->at = (uint16_t)(plan->at + SIZES[field][1]);
    }
    if (plan->at < plan->counts[field] * SIZES[field][0]) return true;
    plan->at = 0;
    plan->stop++;
    return true;
}

/* Fill in the curve's knots; false if they or the points do not fit. */
static bool read_knots(const sf_plan *plan, sf_curve *curve) {
    unsigned count = plan->counts[POINTS], degree = plan->degree, inner = plan->counts[KNOTS];
    const uint8_t *knots = plan->packed[KNOTS];
    if (count > SF_POINTS || count <= degree || inner != count - degree) return false;
    if (plan->counts[WEIGHTS] && plan->counts[WEIGHTS] != count) return false;
    if (plan->counts[PROFILE] > SF_SPEEDS || plan->counts[PACKED_STOPS] > SF_STOPS) return false;
    curve->degree = plan->degree;
    curve->count = (uint16_t)count;
    for (unsigned i = 0; i <= degree; i++) {
        curve->knots[i] = R(0);
        curve->knots[count + i] = real(knots + 4 * (inner - 1));
    }
    for (unsigned i = 0; i + 1 < inner; i++) curve->knots[degree + 1 + i] = real(knots + 4 * i);
    return true;
}

static void read_point(const sf_plan *plan, sf_curve *curve, unsigned i) {
    const uint8_t *point = plan->packed[POINTS] + 8 * i;
    sf_real weight = plan->counts[WEIGHTS] ? real(plan->packed[WEIGHTS] + 4 * i) : R(1);
    curve->hx[i] = real(point) * weight;
    curve->hy[i] = real(point + 4) * weight;
    curve->hw[i] = weight;
}

/* Add a speed knot behind the others, or where it belongs if they are sorted. */
SHARED static bool add_knot(sf_plan *plan, sf_timeline *line, sf_real s, sf_real v, bool sorted) {
    if (plan->at > SF_LEGS) return false;
    sf_knot *knot = &line->knots[plan->at++];
    for (; sorted && knot > line->knots; knot--) {
        if (knot[-1].s < s || (knot[-1].s == s && knot[-1].v <= v)) break;
        *knot = knot[-1];
    }
    knot->s = s;
    knot->v = v;
    return true;
}

/* The checks of a Timeline, all but those of its stops. */
static bool is_profile(sf_timeline *line, unsigned count) {
    if (count < 2 || line->knots[0].s != R(0)) return false;
    line->most_v = R(0);
    for (unsigned i = 0; i < count; i++) {
        if (!(line->knots[i].v >= R(0)) || !(line->knots[i].v < R(1e3))) return false;
        if (i && !(line->knots[i].s > line->knots[i - 1].s)) return false;
        if (i && !(line->knots[i].v + line->knots[i - 1].v > R(0))) return false;
        line->most_v = sf_most(line->most_v, line->knots[i].v);
    }
    line->length = line->knots[count - 1].s;
    line->leg = line->next = line->knots;
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
    sf_real s = line->next->s, v = line->next->v, time = line->finish;
    sf_real end_s = line->next[1].s, end_v = line->next[1].v;
    sf_real slope = (end_v * end_v - v * v) / (end_s - s);
    for (; plan->stop < plan->counts[PACKED_STOPS]; plan->stop++) {
        const uint8_t *stop = plan->packed[PACKED_STOPS] + 12 * plan->stop;
        sf_real stop_s = real(stop);
        if (!(stop_s < end_s)) break;
        if (stop_s > s) {
            v = SF_SQRT(sf_most(v * v + slope * (stop_s - s), R(0)));
            s = stop_s;
            if (!add_knot(plan, line, s, v, true) || !sf_timeline_leg(line, time)) return false;
            time = line->finish;
        }
        int64_t origin_ns = course->origin_ms * MILLISECOND;
        time = sf_most(time, sf_seconds_of_ns(departure_ns(stop) - origin_ns));
    }
    return sf_timeline_leg(line, time);
}

static void begin_course(sf_plan *plan, sf_course *course) {
    sf_clear(course, offsetof(sf_course, timeline));
    course->begin_ms = plan->begin_ms;
#ifdef SF_DOUBLE
    course->origin_ms = 0;
#else
    course->origin_ms = plan->begin_ms;
#endif
    course->begin = course->timeline.finish = sf_time_of_ms(course, plan->begin_ms);
}

static bool is_sealed(const sf_plan *plan) {
    const uint8_t *seal = plan->bytes + plan->length - SEAL_BYTES;
    for (int i = 0; i < 4; i++)
        if (seal[1 + i] != (uint8_t)(~plan->crc >> (24 - 8 * i))) return false;
    return seal[0] == 0xCE;
}

/* Go on in the present stage, or to the next one; false if the Plan is no valid course. */
static bool go_on(sf_agent *agent, sf_course *course) {
    sf_plan *plan = &agent->plan;
    sf_curve *curve = &course->curve;
    sf_timeline *line = &course->timeline;
    bool braking = plan->brake_mmps2 > 0;
    const uint8_t *knot;
    switch (plan->stage) {
    case CURVE:
        if (plan->at == 0 && !read_knots(plan, curve)) return false;
        read_point(plan, curve, plan->at++);
        if (plan->at == curve->count) plan->stage = MEASURE;
        return true;
    case MEASURE:
        if (!sf_curve_begin(plan, curve)) return false;
        plan->at = plan->stop = 0;
        plan->stage = SPEED_KNOTS;
        return true;
    case SPEED_KNOTS:
        if (plan->at == plan->counts[PROFILE]) {
            plan->stage = STOPS;
            return true;
        }
        knot = plan->packed[PROFILE] + 5 * plan->at;
        return add_knot(plan, line, real(knot), real(plan->packed[SPEEDS] + 4 * knot[4]), braking);
    case STOPS:
        if (braking && plan->stop < plan->counts[PACKED_STOPS]) {
            sf_real s = real(plan->packed[PACKED_STOPS] + 12 * plan->stop++);
            return !(s > R(0)) || add_knot(plan, line, s, R(0), true);
        }
        plan->stop = 0;
        plan->stage = LEGS;
        return is_profile(line, plan->at) && are_stops(plan, line);
    default:
        if (line->next + 1 < line->knots + plan->at) return add_legs(plan, course);
        plan->stage = CELLS;
        return true;
    }
}

/* Do one piece of the work, and return its size; stage NONE: the message was dropped or taken. */
static int work_on(sf_agent *agent) {
    static const uint8_t WORK[] = {
        [FIELDS] = 14, [CHECKSUM] = 18, [NUMBERS] = 6, [CURVE] = 2, [MEASURE] = 40,
        [SPEED_KNOTS] = 1, [STOPS] = 15, [LEGS] = 3, [CELLS] = 8, [TAKE] = 40,
    };
    sf_plan *plan = &agent->plan;
    const sf_robot *robot = sf_robot_of(agent);
    sf_course *course = &agent->courses[plan->course];
    int work = WORK[plan->stage];
    bool fine = true;
    switch (plan->stage) {
    case FIELDS:
        plan->stage = read_fields(agent) ? CHECKSUM : NONE;
        break;
    case CHECKSUM:
        for (int i = 0; i < 64 && plan->at < plan->length - SEAL_BYTES; i++)
            plan->crc = crc(plan->crc, plan->bytes[plan->at++]);
        if (plan->at < plan->length - SEAL_BYTES) break;
        plan->at = plan->stop = 0;
        plan->stage = is_sealed(plan) ? NUMBERS : NONE;
        break;
    case NUMBERS:
        if (!are_finite(plan)) plan->stage = NONE;
        else if (plan->stop == FIELDS_PACKED) {
            plan->stage = sf_takes_plan(agent, plan) ? CURVE : NONE;
            plan->at = 0;
            plan->course = agent->ride == &agent->courses[0];
            if (plan->stage) begin_course(plan, &agent->courses[plan->course]);
        }
        break;
    case CELLS:
        if (!course->curve.plain) work = 24;
        if (!sf_measure_cell(plan, &course->curve)) plan->stage = TAKE;
        break;
    case TAKE:
        fine = sf_ride_begin(course, plan, robot->speed_limit, sf_seconds_of_ns(robot->period_ns));
        plan->stage = NONE;
        if (fine) sf_plan_taken(agent, course, true);
        break;
    default:
        fine = go_on(agent, course);
    }
    if (!fine) {
        plan->stage = NONE;
        sf_plan_taken(agent, course, false);
    }
    return work;
}

void sf_read_plan(sf_agent *agent, int work) {
    while (agent->plan.stage && work > 0) {
        work -= work_on(agent);
        if (agent->plan.stage == TAKE) break; /* What is left is enough for a tick of its own. */
    }
}

bool sf_is_reading(const sf_agent *agent) { return agent->plan.stage != NONE; }

bool sf_hear_plan(sf_agent *agent, const uint8_t *bytes, size_t length) {
    sf_plan *plan = &agent->plan;
    if (sf_is_reading(agent) || length <= SEAL_BYTES || length > MOST_MESSAGE) return false;
    *plan = (sf_plan){.bytes = bytes, .length = (uint16_t)length, .crc = 0xFFFFFFFF, .stage = FIELDS};
    while (SF_WORK == 0 && sf_is_reading(agent)) work_on(agent);
    return true;
}
