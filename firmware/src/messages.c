/* Messages to calls of the agent, and its results to messages: robot_agent/service.py, inbox.py and
   protocol/codec.py. */

#include "core.h"

#define MOST_HELD 120
#define MOST_WANTED 60
#define MOST_REASON 200
#define MOST_MESSAGE 4000
#define PROTOCOL_VERSION 3

/* ---- reading ---- */

#define FIELD(kind, type, name) {(kind), offsetof(type, name)}
#define END {0, 0}

typedef struct {
    uint32_t number;
    int32_t time_ms;
} held;

static const sf_field COMMAND_FIELDS[] = {
    FIELD(SF_U32, sf_command, order.boot), FIELD(SF_U32, sf_command, order.term),
    FIELD(SF_U32, sf_command, order.sequence), FIELD(SF_U32, sf_command, order.epoch),
    FIELD(SF_U32, sf_command, order.phase), FIELD(SF_STAMP, sf_command, start_ns),
    FIELD(SF_STAMP, sf_command, said_ns), FIELD(SF_I32 | SF_OPTIONAL, sf_command, headroom_ms),
    END,
    FIELD(SF_U32 | SF_OPTIONAL, sf_command, first), FIELD(SF_U32 | SF_OPTIONAL, sf_command, last),
    END,
    FIELD(SF_U32 | SF_OPTIONAL, sf_command, order.run), END,
};
static const sf_field HELD_FIELDS[] = {
    FIELD(SF_U32, held, number), FIELD(SF_I32, held, time_ms), END,
};
static const sf_field CLOCK_FIELDS[] = {
    FIELD(SF_U32, sf_answer, boot), FIELD(SF_STAMP, sf_answer, sent_ns),
    FIELD(SF_STAMP | SF_NULLABLE, sf_answer, received_ns),
    FIELD(SF_STAMP | SF_NULLABLE, sf_answer, answered_ns),
    FIELD(SF_U32 | SF_OPTIONAL, sf_answer, coordinator), END,
};
static const sf_field REFUSAL_FIELDS[] = {{SF_U32, 0}, END};

/* Begin a list that may be left out, whose elements are made of so many values each: its length. */
SHARED static uint32_t open_list(sf_reader *reader, uint32_t most, uint32_t values) {
    uint32_t count = reader->left ? sf_get_array(reader) : 0;
    if (count > most) reader->bad = true;
    if (reader->bad) return 0;
    reader->left += values * count;
    return count;
}

static bool hear_command(sf_agent *agent, sf_reader *reader) {
    sf_command command = {.last = UINT32_MAX};
    sf_granted *const end = command.granted + 2, *one;
    held pair;
    command.granted[0].number = agent->number;
    command.granted[1].number = agent->next_number;
    const sf_field *fields = sf_get_fields(reader, &command, COMMAND_FIELDS);
    for (uint32_t count = open_list(reader, MOST_HELD, 3); count > 0; count--) {
        if (sf_get_array(reader) != 2) return false;
        sf_get_fields(reader, &pair, HELD_FIELDS);
        for (one = command.granted; one < end; one++)
            if (pair.number == one->number && !one->said) {
                one->authority_ms = pair.time_ms;
                one->said = true;
            }
    }
    fields = sf_get_fields(reader, &command, fields);
    for (uint32_t count = open_list(reader, MOST_WANTED, 1); count > 0; count--) {
        sf_get_text(reader);
        if (!sf_is_id(reader)) return false;
        if (sf_is_named(reader, ROBOT(agent)->id)) command.order.asks = true;
    }
    sf_get_fields(reader, &command, fields);
    if (!sf_close(reader) || command.order.phase > STOP) return false;
    if (agent->newest_term == command.order.term && agent->newest_boot == command.order.boot &&
        agent->next_sequence > command.order.sequence)
        return true;
    agent->newest_term = command.order.term;
    agent->newest_boot = command.order.boot;
    agent->next_sequence = (int64_t)command.order.sequence + 1;
    int64_t plan_ns = sf_difference(command.said_ns, command.start_ns);
    int64_t all_ms = sf_floor_ratio(plan_ns, MILLISECOND) + command.headroom_ms;
    for (one = command.granted; one < end; one++) {
        if (!one->said) one->authority_ms = all_ms;
        if (one->number < command.first || one->number > command.last) one->authority_ms = 0;
    }
    sf_hear_command(agent, &command);
    return true;
}

static bool hear_refusal(sf_agent *agent, sf_reader *reader) {
    uint32_t characters = 0, boot = 0;
    sf_get_fields(reader, &boot, REFUSAL_FIELDS);
    sf_get_text(reader);
    for (uint32_t i = 0; i < reader->length; i++) characters += (reader->content[i] & 0xC0) != 0x80;
    if (characters > MOST_REASON || !sf_close(reader)) return false;
    if (boot == ROBOT(agent)->boot) agent->refused = true;
    return true;
}

static bool hear_clock(sf_agent *agent, sf_reader *reader) {
    sf_answer answer;
    answer.received_ns = INT64_MAX; /* A question is answered before it was received: it does not count. */
    answer.answered_ns = INT64_MIN;
    answer.coordinator = 0;
    sf_get_fields(reader, &answer, CLOCK_FIELDS);
    if (!sf_close(reader)) return false;
    if (answer.boot == ROBOT(agent)->boot) sf_hear_clock(agent, &answer);
    return true;
}

bool sf_hear(sf_agent *agent, int kind, const uint8_t *bytes, size_t length, int64_t now_ns) {
    sf_reader reader;
    agent->clock.now_ns = now_ns;
    if (length > MOST_MESSAGE) return false;
    int tag = sf_open(&reader, bytes, length);
    if (tag == REFUSAL) return kind == SF_PLAN && hear_refusal(agent, &reader);
    if (tag != kind) return false;
    switch (tag) {
    case PLAN:
        if (!sf_hear_plan(&agent->plan, bytes, length)) return false;
        while (SF_WORK == 0 && sf_is_reading(agent)) sf_read_plan(&agent->plan, agent, 1);
        return true;
    case COMMAND: return hear_command(agent, &reader);
    case CLOCK: return hear_clock(agent, &reader);
    default: return false;
    }
}

/* ---- writing ---- */

enum { ARRAY_HEAD = 0x90, NIL = 0xC0 };

/* A number behind its head, whose last two bits say how many bytes it takes. */
SHARED static uint8_t *put(uint8_t *at, int head, uint64_t bits) {
    int bytes = 1 << (head & 3);
    *at = (uint8_t)head;
    for (int i = bytes; i > 0; i--, bits >>= 8) at[i] = (uint8_t)bits;
    return at + 1 + bytes;
}

/* One byte: a small number, a head, or nothing. */
static uint8_t *put_byte(uint8_t *at, int byte) {
    *at = (uint8_t)byte;
    return at + 1;
}

SHARED static uint8_t *put_long(uint8_t *at, int64_t value) {
    uint64_t most = value < 0 ? ~(uint64_t)value << 1 : (uint64_t)value;
    uint32_t low = (uint32_t)most;
    if (value >= -32 && value < 128) return put_byte(at, (int)value);
    int size = most >> 32 ? 3 : low >> 16 ? 2 : low >> 8 ? 1 : 0;
    return put(at, (value < 0 ? 0xD0 : 0xCC) + size, (uint64_t)value);
}

SHARED static uint8_t *put_int(uint8_t *at, int32_t value) { return put_long(at, value); }

SHARED static uint8_t *put_count(uint8_t *at, uint32_t value) { return put_long(at, value); }

static uint8_t *put_double(uint8_t *at, double value) {
    union {
        double value;
        uint64_t bits;
    } both = {.value = value};
    return put(at, 0xCB, both.bits);
}

/* A number as float64; from float by its bits alone.  It is not negative, and finite. */
static uint8_t *put_real(uint8_t *at, sf_real value) {
#ifdef SF_DOUBLE
    return put_double(at, value);
#else
    union {
        float value;
        uint32_t bits;
    } both = {.value = value};
    uint64_t wide = (uint64_t)both.bits << 29;
    if (both.bits >= 0x00800000) wide += (uint64_t)(1023 - 127) << 52;
    else wide = 0; /* Less than 1e-37 is nothing. */
    return put(at, 0xCB, wide);
#endif
}

/* Begin a message; all of them have fewer than 16 elements. */
static uint8_t *put_tag(uint8_t *at, int count, int tag) {
    return put_byte(put_byte(at, ARRAY_HEAD + count), tag);
}

SHARED static uint8_t *put_milli(uint8_t *at, sf_real value) {
    return put_long(at, sf_milli(value));
}

static uint8_t *put_hello(uint8_t *at, const sf_agent *agent) {
    const sf_robot *robot = ROBOT(agent);
    at = put_byte(put_tag(at, 11, HELLO), PROTOCOL_VERSION);
    at = put_double(put_count(at, robot->boot), robot->radius);
    at = put_double(put_double(at, robot->max_speed), robot->max_accel);
    bool may_tell = agent->leader.order.phase == FREEZE || agent->leader.order.asks;
    if (agent->has_pose && may_tell && agent->spent_epoch == 0) {
        at = put_milli(put_byte(at, ARRAY_HEAD + 3), agent->pose.at[SF_X]);
        at = put_milli(put_milli(at, agent->pose.at[SF_Y]), agent->pose.heading);
    } else {
        at = put_byte(at, NIL);
    }
    at = put_count(put_count(at, agent->hellos), SF_POINTS);
    return put_count(put_count(at, SF_STOPS), SF_BYTES);
}

static uint8_t *put_report(uint8_t *at, sf_agent *agent) {
    const sf_rest *rest = &agent->rest;
    sf_course *ride = agent->ride;
    uint32_t late = 0;
    at = put_count(put_tag(at, 11, REPORT), ROBOT(agent)->boot);
    at = put_count(put_count(at, ++agent->report_sequence), agent->epoch);
    at = put_byte(put_byte(at, agent->phase), agent->fault);
    if (rest->tell) {
        at = put_count(put_real(put_byte(at, ARRAY_HEAD + 6), rest->s), rest->epoch);
        at = put_int(put_int(at, rest->off), rest->turn);
        at = put_count(put_int(at, rest->beyond), rest->revision);
    } else {
        at = put_byte(at, NIL);
    }
    agent->rest.tell = false;
    if (agent->phase == SF_MOVING || agent->phase == SF_DONE) {
        sf_reckon(ride, sf_plan_time_ms(agent, ride));
        at = put_int(at, ride->stamp_ms);
        if (agent->phase == SF_MOVING) late = ride->late;
    } else {
        at = put_byte(at, NIL);
    }
    at = put_count(at, late);
    return put_count(put_count(at, agent->revision), agent->holds);
}

/* ---- what is due ---- */

/* Whether it is a period since something was sent. */
static bool is_due(const sf_agent *agent, int64_t sent_ns) {
    return agent->clock.now_ns - sent_ns >= SEND_PERIOD;
}

/* Whether to report; what is reported by it counts as reported. */
static bool report_is_due(sf_agent *agent) {
    const uint32_t now[SF_REPORTED] = {
        agent->epoch, agent->revision, agent->holds, agent->phase, agent->fault,
    };
    bool same = true;
    for (int i = 0; i < SF_REPORTED; i++) {
        if (agent->reported[i] != now[i]) same = false;
        agent->reported[i] = now[i];
    }
    return !same || is_due(agent, agent->reported_ns);
}

static bool question_is_due(sf_agent *agent) {
    int error_ms = agent->ride ? agent->ride->clock_ms : CLOCK_ERROR_MS;
    return sf_clock_asks(&agent->clock, error_ms - CLOCK_RESERVE_MS, sf_is_on_its_way(agent));
}

int sf_speak(sf_agent *agent, int64_t now_ns, uint8_t *bytes, size_t *length) {
    uint8_t *at = bytes;
    agent->clock.now_ns = now_ns;
    int kind = SF_NOTHING;
    if (!agent->ride && is_due(agent, agent->hello_ns)) {
        agent->hello_ns = now_ns;
        agent->hellos++;
        at = put_hello(at, agent);
        kind = SF_HELLO;
    } else if (question_is_due(agent)) {
        at = put_count(put_tag(at, 6, CLOCK), ROBOT(agent)->boot);
        at = put_byte(put_byte(put_byte(put_long(at, now_ns), NIL), NIL), 0);
        kind = SF_CLOCK;
    } else if (report_is_due(agent)) {
        agent->reported_ns = now_ns;
        at = put_report(at, agent);
        kind = SF_REPORT;
    }
    *length = (size_t)(at - bytes);
    return kind;
}

#include "core_end.h"
