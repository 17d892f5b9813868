/* A Plan message becomes a course, a piece of work per tick: protocol/codec.py, plan_bytes.py,
   plan_parts.py and the constructors of Curve, Timeline and Ride.

   The stages: fields, checksum, their numbers and whether the robot takes it, knots and points, the
   curve they make, speed knots, stops, legs, arc lengths, the ride, its taking.  A message that is
   not acceptable is dropped; one that is, but is no valid course, is told to the agent. */

#include "core.h"

enum { NONE, FIELDS, CHECKSUM, NUMBERS, BEGIN, CURVE, MEASURE, SPEED_KNOTS, STOPS, LEGS, CELLS, RIDE,
       TAKE };

enum { POINTS, KNOTS, WEIGHTS, SPEEDS, PROFILE, PACKED_STOPS, FIELDS_PACKED };

enum { SEAL_BYTES = 5, POINT_BYTES = 8, STOP_BYTES = 12, MOST_PACKED = 3600 };

/* The bytes of one element of each packed field.  It begins with a float32; a point is two. */
static const uint8_t SIZES[FIELDS_PACKED] = {POINT_BYTES, 4, 4, 4, 5, STOP_BYTES};

#define FIELD(kind, name) {(kind), offsetof(sf_plan, name)}
static const sf_field PLAN_FIELDS[] = {
    FIELD(SF_U32, epoch), FIELD(SF_U32, boot), {0, 0},
    FIELD(SF_U32, number), FIELD(SF_U32, revision), FIELD(SF_I32, begin_ms), FIELD(SF_STAMP, tau_ns),
    FIELD(SF_U32, track_mm), FIELD(SF_U32, brake_mmps2), FIELD(SF_U32, clock_ms), FIELD(SF_U32, degree),
    {0, 0},
};

static uint32_t word(const uint8_t *at) {
    return at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static sf_real real(const uint8_t *at) {
    union {
        uint32_t bits;
        float value;
    } both = {.bits = word(at)};
    return (sf_real)both.value;
}

static const uint8_t *stop_at(const sf_plan *plan, unsigned i) {
    return plan->packed[PACKED_STOPS] + STOP_BYTES * i;
}

static int64_t departure_ns(const uint8_t *stop) {
    return (int64_t)((uint64_t)word(stop + 8) << 32 | word(stop + 4));
}

/* Read the fields, and check what has to hold for the message to be acceptable. */
static int read_fields(sf_plan *plan, const sf_robot *robot) {
    sf_reader reader;
    sf_open(&reader, plan->bytes, plan->length);
    const sf_field *fields = sf_get_fields(&reader, plan, PLAN_FIELDS);
    sf_get_text(&reader);
    if (!sf_is_named(&reader, robot->id)) return FAILED;
    sf_get_fields(&reader, plan, fields);
    if ((uint64_t)plan->tau_ns > 1000 * SECOND || plan->clock_ms < 1) return FAILED;
    if ((plan->track_mm | plan->clock_ms) > UINT16_MAX) return FAILED;
    if (plan->degree - 1 >= SF_DEGREE) return FAILED; /* less than 1, or too high */
    for (int field = 0; field < FIELDS_PACKED; field++) {
        unsigned size = SIZES[field];
        sf_get_bytes(&reader);
        if (reader.length > MOST_PACKED || reader.length % size) return FAILED;
        plan->packed[field] = reader.content;
        plan->counts[field] = (uint16_t)(reader.length / size);
    }
    return sf_close(&reader) ? NEXT : FAILED;
}

/* CRC-32 (reflected polynomial 0xEDB88320), a bit at a time; some bytes more. */
static int check_sum(sf_plan *plan) {
    const uint8_t *seal = plan->bytes + plan->length - SEAL_BYTES;
    uint32_t crc = plan->crc;
    for (int i = 20; i > 0; i--) {
        const uint8_t *at = plan->bytes + plan->at;
        if (at == seal) {
            uint32_t sealed = seal[4] | (uint32_t)seal[3] << 8;
            sealed |= (uint32_t)seal[2] << 16 | (uint32_t)seal[1] << 24;
            return seal[0] == 0xCE && sealed == ~crc ? NEXT : FAILED;
        }
        crc ^= *at;
        plan->at++;
        for (int bit = 8; bit > 0; bit--) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320 : 0);
    }
    plan->crc = crc;
    return AGAIN;
}

/* Check the next numbers of the packed fields, `at` bytes into field `stop`. */
static int check_numbers(sf_plan *plan) {
    unsigned field = plan->stop, at = plan->at, size = SIZES[field];
    unsigned end = plan->counts[field] * size, step = size == POINT_BYTES ? 4 : size;
    const uint8_t *packed = plan->packed[field];
    for (int i = 0; at < end; i++, at += step) {
        if (i == 16) {
            plan->at = at;
            return AGAIN;
        }
        if ((~word(packed + at) & 0x7F800000) == 0) return FAILED;
        if (field == PROFILE && packed[at + 4] >= plan->counts[SPEEDS]) return FAILED;
    }
    plan->at = 0;
    return ++plan->stop < FIELDS_PACKED ? AGAIN : NEXT;
}

/* Begin a course, if the robot takes the Plan. */
static int begin(sf_plan *plan, sf_agent *agent) {
    if (!sf_takes_plan(agent, plan)) return FAILED;
    sf_course *course = &agent->courses[agent->ride == &agent->courses[0]];
    sf_timeline *line = &course->timeline;
    plan->course = course;
    memset(course, 0, offsetof(sf_course, pieces));
    course->begin_ms = plan->begin_ms;
#ifndef SF_DOUBLE
    course->origin_ms = plan->begin_ms;
#endif
    course->begin = course->time = line->finish = sf_time_of_ms(course, plan->begin_ms);
    line->leg = line->next = line->knots = line->end = course->legs;
    course->degree = (uint8_t)plan->degree;
    course->axes = plan->degree == 3 ? SF_WEIGHT : SF_AXES;
    course->count = plan->counts[POINTS];
    return NEXT;
}

/* Whether all there is fits a course, and each other. */
static bool fits(const sf_plan *plan) {
    unsigned count = plan->counts[POINTS], weights = plan->counts[WEIGHTS];
    if (count > SF_POINTS || count <= plan->degree) return false;
    if (plan->counts[KNOTS] != count - plan->degree || (weights && weights != count)) return false;
    return plan->counts[PROFILE] <= SF_SPEEDS && plan->counts[PACKED_STOPS] <= SF_STOPS;
}

/* Read one more knot and control point; count the spans in plan->parts. */
SHARED static int read_curve(sf_plan *plan, sf_course *course) {
    unsigned i = plan->at++, degree = plan->degree, count = course->count;
    sf_real *knot = &course->knots[i];
    if (i == 0 && !fits(plan)) return FAILED;
    *knot = R(0);
    if (i > degree) {
        unsigned inner = i < count ? i : count;
        *knot = real(plan->packed[KNOTS] + 4 * (inner - degree - 1));
        if (*knot < knot[-1] || (i < count + degree && *knot == *(knot - degree))) return FAILED;
        if (*knot > knot[-1]) plan->parts++;
    }
    if (i < count) {
        const uint8_t *point = plan->packed[POINTS] + 8 * i;
        sf_real weight = plan->counts[WEIGHTS] ? real(plan->packed[WEIGHTS] + 4 * i) : R(1);
        if (!(weight > R(0))) return FAILED;
        if (weight != R(1)) course->axes = SF_AXES;
        course->points[SF_X][i] = real(point) * weight;
        course->points[SF_Y][i] = real(point + 4) * weight;
        course->points[SF_WEIGHT][i] = weight;
    }
    return i < count + degree ? AGAIN : NEXT;
}

/* Add a speed knot behind the others, or where it belongs if they are sorted. */
SHARED static bool add_knot(sf_course *course, sf_real s, sf_real v, bool sorted) {
    sf_timeline *line = &course->timeline;
    sf_knot *knot = line->end;
    if (knot > line->knots + SF_LEGS) return false;
    line->end++;
    for (; sorted && knot > line->knots; knot--) {
        if (knot[-1].s < s || (knot[-1].s == s && knot[-1].v <= v)) break;
        *knot = knot[-1];
    }
    knot->s = s;
    knot->v = v;
    return true;
}

static int read_speed(sf_plan *plan, sf_course *course) {
    if (plan->at == plan->counts[PROFILE]) return NEXT;
    const uint8_t *knot = plan->packed[PROFILE] + 5 * plan->at++;
    sf_real v = real(plan->packed[SPEEDS] + 4 * knot[4]);
    if (!(v >= R(0)) || !(v < R(1e3))) return FAILED;
    return add_knot(course, real(knot), v, plan->brake_mmps2 > 0) ? AGAIN : FAILED;
}

/* Where a robot brakes, its stops are speed knots. */
static int read_stop(sf_plan *plan, sf_course *course) {
    const sf_timeline *line = &course->timeline;
    if (!plan->brake_mmps2 || plan->at == plan->counts[PACKED_STOPS])
        return line->end >= line->knots + 2 && line->knots[0].s == R(0) ? NEXT : FAILED;
    sf_real s = real(stop_at(plan, plan->at++));
    return !(s > R(0)) || add_knot(course, s, R(0), true) ? AGAIN : FAILED;
}

/* Add the legs up to the next speed knot, with the stops between. */
SHARED static int add_legs(sf_plan *plan, sf_course *course) {
    sf_timeline *line = &course->timeline;
    const sf_knot *leg = line->next;
    line->length = leg->s;
    line->most_v = sf_most(line->most_v, leg->v);
    if (leg + 1 == line->end) return plan->stop == plan->counts[PACKED_STOPS] ? NEXT : FAILED;
    sf_real end_s = leg[1].s, slope = sf_slope(leg);
    for (; plan->stop < plan->counts[PACKED_STOPS]; plan->stop++) {
        const uint8_t *stop = stop_at(plan, plan->stop);
        sf_real s = real(stop);
        if (!(s < end_s)) break;
        if (!(s >= R(0)) || (plan->stop > 0 && !(s > real(stop - STOP_BYTES)))) return FAILED;
        leg = line->next;
        if (s > leg->s) {
            sf_real v = SF_SQRT(sf_positive(leg->v * leg->v + slope * (s - leg->s)));
            if (!add_knot(course, s, v, true) || !sf_timeline_leg(course)) return FAILED;
        }
        int64_t origin_ns = course->origin_ms * MILLISECOND;
        sf_real departs = sf_seconds_of_ns(sf_difference(departure_ns(stop), origin_ns));
        if (!(sf_abs(departs) < R(1e6))) return FAILED;
        line->finish = sf_most(line->finish, departs);
    }
    return sf_timeline_leg(course) ? AGAIN : FAILED;
}

/* Do one piece of the work on a Plan. */
SHARED static int work_on(sf_plan *plan, sf_agent *agent) {
    sf_course *course = plan->course;
    switch (plan->stage) {
    case FIELDS: return read_fields(plan, ROBOT(agent));
    case CHECKSUM: return check_sum(plan);
    case NUMBERS: return check_numbers(plan);
    case BEGIN: return begin(plan, agent);
    case CURVE: return read_curve(plan, course);
    case MEASURE: return sf_curve_begin(plan, course);
    case SPEED_KNOTS: return read_speed(plan, course);
    case STOPS: return read_stop(plan, course);
    case LEGS: return add_legs(plan, course);
    case CELLS: return sf_measure_cell(plan, course);
    case RIDE: return sf_ride_begin(plan, course, ROBOT(agent));
    default: return NEXT;
    }
}

void sf_read_plan(sf_plan *plan, sf_agent *agent, int work) {
    static const uint8_t WORK[] = {
        [FIELDS] = 24, [CHECKSUM] = 20, [NUMBERS] = 6, [BEGIN] = 20, [CURVE] = 2, [MEASURE] = 40,
        [SPEED_KNOTS] = 1, [STOPS] = 2, [LEGS] = 4, [CELLS] = 12, [RIDE] = 40, [TAKE] = 40,
    };
    if (plan->stage == NONE) return;
    do {
        unsigned stage = plan->stage;
        work -= stage == CELLS && plan->course->axes == SF_AXES ? 24 : WORK[stage];
        int done = work_on(plan, agent);
        if (done == AGAIN) continue;
        plan->at = plan->stop = 0;
        plan->stage = done == NEXT && stage < TAKE ? (uint8_t)(stage + 1) : NONE;
        if (plan->stage == NONE && stage > BEGIN) sf_plan_taken(agent, plan->course, done == NEXT);
    } while (work > 0 && plan->stage != NONE && plan->stage <= CELLS); /* The rest takes a tick each. */
}

bool sf_hear_plan(sf_plan *plan, const uint8_t *bytes, size_t length) {
    if (plan->stage != NONE || length <= SEAL_BYTES) return false;
    memset(plan, 0, sizeof *plan);
    plan->bytes = bytes;
    plan->length = (uint16_t)length;
    plan->stage = FIELDS;
    plan->crc = UINT32_MAX;
    return true;
}

#include "core_end.h"
