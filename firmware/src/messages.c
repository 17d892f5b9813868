/* Messages to calls of the agent, and its results to messages: robot_agent/service.py, inbox.py and
   protocol/codec.py. */

#include "core.h"

#define MOST_HELD 120
#define MOST_WANTED 60
#define MOST_REASON 200
#define MOST_MESSAGE 4000
#define PROTOCOL_VERSION 3

enum { HELLO = 1, PLAN = 2, COMMAND = 3, REPORT = 4, CLOCK = 5, REFUSAL = 6 };

/* ---- reading ---- */

static bool hear_command(sf_agent *agent, sf_reader *reader, int64_t now_ns) {
    sf_command command = {.authority_ms = SF_UNSAID, .next_authority_ms = SF_UNSAID};
    uint32_t first = 0, last = UINT32_MAX;
    int64_t headroom_ms = 0;
    sf_get_small(reader, COMMAND, COMMAND);
    command.boot = sf_get_counter(reader);
    command.term = sf_get_counter(reader);
    command.sequence = sf_get_counter(reader);
    command.epoch = sf_get_counter(reader);
    command.phase = (uint8_t)sf_get_small(reader, 0, 4);
    command.start_ns = sf_get_stamp(reader);
    command.said_ns = sf_get_stamp(reader);
    if (reader->left) headroom_ms = sf_get_ms(reader);
    uint32_t held = reader->left ? sf_get_array(reader) : 0;
    if (held > MOST_HELD) return false;
    uint32_t left = reader->left;
    for (; held > 0; held--) {
        reader->left = 1;
        if (sf_get_array(reader) != 2) return false;
        reader->left = 2;
        uint32_t number = sf_get_counter(reader);
        int64_t time_ms = sf_get_ms(reader);
        if (number == agent->number && command.authority_ms == SF_UNSAID)
            command.authority_ms = time_ms;
        if (number == agent->next_number && command.next_authority_ms == SF_UNSAID)
            command.next_authority_ms = time_ms;
    }
    reader->left = left;
    if (reader->left) first = sf_get_counter(reader);
    if (reader->left) last = sf_get_counter(reader);
    uint32_t wanted = reader->left ? sf_get_array(reader) : 0;
    if (wanted > MOST_WANTED) return false;
    left = reader->left;
    for (; wanted > 0; wanted--) {
        uint32_t length;
        reader->left = 1;
        const uint8_t *text = sf_get_text(reader, &length);
        if (!sf_is_id(text, length)) return false;
        command.wanted = command.wanted || sf_is_named(sf_robot_of(agent)->id, text, length);
    }
    reader->left = left;
    if (reader->left) command.run = sf_get_counter(reader);
    if (!sf_close(reader)) return false;
    if (agent->newest_term == command.term && agent->newest_boot == command.boot &&
        agent->newest_sequence >= command.sequence)
        return true;
    agent->newest_term = command.term;
    agent->newest_boot = command.boot;
    agent->newest_sequence = command.sequence;
    int64_t plan_ns = sf_difference(command.said_ns, command.start_ns);
    int64_t all_ms = sf_floor_ratio(plan_ns, MILLISECOND) + headroom_ms;
    if (command.authority_ms == SF_UNSAID) command.authority_ms = all_ms;
    if (command.next_authority_ms == SF_UNSAID) command.next_authority_ms = all_ms;
    if (agent->number < first || agent->number > last) command.authority_ms = SF_UNSAID;
    if (agent->next_number < first || agent->next_number > last)
        command.next_authority_ms = SF_UNSAID;
    sf_hear_command(agent, &command, now_ns);
    return true;
}

static bool hear_refusal(sf_agent *agent, sf_reader *reader) {
    uint32_t length, characters = 0;
    sf_get_small(reader, REFUSAL, REFUSAL);
    uint32_t boot = sf_get_counter(reader);
    const uint8_t *reason = sf_get_text(reader, &length);
    for (uint32_t i = 0; i < length; i++) characters += (reason[i] & 0xC0) != 0x80;
    if (characters > MOST_REASON || !sf_close(reader)) return false;
    if (boot == sf_robot_of(agent)->boot) agent->refused = true;
    return true;
}

static bool hear_clock(sf_agent *agent, sf_reader *reader, int64_t now_ns) {
    int64_t stamps[2] = {0, 0};
    bool answered = true;
    sf_get_small(reader, CLOCK, CLOCK);
    uint32_t boot = sf_get_counter(reader);
    int64_t sent_ns = sf_get_stamp(reader);
    for (int i = 0; i < 2; i++) {
        if (reader->left == 0 || sf_get_nil(reader)) answered = false;
        else stamps[i] = sf_get_stamp(reader);
    }
    uint32_t coordinator = reader->left ? sf_get_counter(reader) : 0;
    if (!sf_close(reader)) return false;
    if (answered && boot == sf_robot_of(agent)->boot)
        sf_hear_clock(agent, coordinator, sent_ns, stamps[0], stamps[1], now_ns);
    return true;
}

bool sf_hear(sf_agent *agent, int kind, const uint8_t *bytes, size_t length, int64_t now_ns) {
    sf_reader reader, tag;
    if (length > MOST_MESSAGE) return false;
    sf_open(&reader, bytes, length);
    tag = reader;
    switch (kind) {
    case SF_COMMAND: return hear_command(agent, &reader, now_ns);
    case SF_CLOCK: return hear_clock(agent, &reader, now_ns);
    case SF_PLAN:
        if (sf_get_small(&tag, PLAN, REFUSAL) == REFUSAL) return hear_refusal(agent, &reader);
        return !tag.bad && sf_hear_plan(agent, bytes, length);
    default: return false;
    }
}

/* ---- writing ---- */

SHARED static uint8_t *put(uint8_t *at, uint8_t head, uint64_t bits, int bytes) {
    *at++ = head;
    while (bytes--) *at++ = (uint8_t)(bits >> (8 * bytes));
    return at;
}

SHARED static uint8_t *put_int(uint8_t *at, int64_t value) {
    uint64_t bits = (uint64_t)value;
    if (value >= -32 && value < 128) return put(at, (uint8_t)bits, 0, 0);
    if (value < 0) {
        int size = value >= INT8_MIN ? 0 : value >= INT16_MIN ? 1 : value >= INT32_MIN ? 2 : 3;
        return put(at, (uint8_t)(0xD0 + size), bits, 1 << size);
    }
    int size = value <= UINT8_MAX ? 0 : value <= UINT16_MAX ? 1 : value <= UINT32_MAX ? 2 : 3;
    return put(at, (uint8_t)(0xCC + size), bits, 1 << size);
}

SHARED static uint8_t *put_nil(uint8_t *at) { return put(at, 0xC0, 0, 0); }

static uint8_t *put_double(uint8_t *at, double value) {
    union {
        double value;
        uint64_t bits;
    } both = {.value = value};
    return put(at, 0xCB, both.bits, 8);
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
    return put(at, 0xCB, wide, 8);
#endif
}

static uint8_t *put_array(uint8_t *at, int count) { return put(at, (uint8_t)(0x90 + count), 0, 0); }

static uint8_t *put_hello(uint8_t *at, const sf_agent *agent) {
    const sf_robot *robot = sf_robot_of(agent);
    at = put_int(put_array(at, 11), HELLO);
    at = put_int(put_int(at, PROTOCOL_VERSION), robot->boot);
    at = put_double(put_double(at, robot->radius), robot->max_speed);
    at = put_double(at, robot->max_accel);
    bool may_tell = agent->leader.phase == FREEZE || agent->leader.asks;
    if (agent->has_pose && may_tell && !sf_has_driven(agent)) {
        at = put_int(put_array(at, 3), sf_nearest(R(1000) * agent->pose.x));
        at = put_int(put_int(at, sf_nearest(R(1000) * agent->pose.y)),
                     sf_nearest(R(1000) * agent->pose.heading));
    } else {
        at = put_nil(at);
    }
    at = put_int(put_int(at, agent->hellos), SF_POINTS);
    return put_int(put_int(at, SF_STOPS), SF_BYTES);
}

static uint8_t *put_report(uint8_t *at, const sf_agent *agent) {
    const sf_rest *rest = &agent->rest;
    at = put_int(put_int(put_array(at, 11), REPORT), sf_robot_of(agent)->boot);
    at = put_int(put_int(at, agent->report_sequence), agent->epoch);
    at = put_int(put_int(at, agent->phase), agent->fault);
    if (agent->report_rest) {
        at = put_int(put_real(put_array(at, 6), rest->s), rest->epoch);
        at = put_int(put_int(at, rest->off), rest->turn);
        at = put_int(put_int(at, rest->beyond), rest->revision);
    } else {
        at = put_nil(at);
    }
    at = agent->report_stamp_ms == SF_UNSAID ? put_nil(at) : put_int(at, agent->report_stamp_ms);
    at = put_int(at, agent->report_late);
    return put_int(put_int(at, agent->revision), agent->holds);
}

int sf_speak(sf_agent *agent, int64_t now_ns, uint8_t *bytes, size_t *length) {
    uint8_t *at = bytes;
    int kind = SF_NOTHING;
    if (sf_hello_due(agent, now_ns)) {
        at = put_hello(at, agent);
        kind = SF_HELLO;
    } else if (sf_clock_due(agent, now_ns)) {
        at = put_int(put_int(put_array(at, 6), CLOCK), sf_robot_of(agent)->boot);
        at = put_int(put_nil(put_nil(put_int(at, now_ns))), 0);
        kind = SF_CLOCK;
    } else if (sf_report_due(agent, now_ns)) {
        at = put_report(at, agent);
        kind = SF_REPORT;
    }
    *length = (size_t)(at - bytes);
    return kind;
}
