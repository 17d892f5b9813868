/* A reader of the msgpack that messages are made of: protocol/codec.py.

   Accepts every head that msgpack has for an integer, array, text or bytes, however long.  After an
   error every further call returns 0 and `sf_close` false.  An element that the message ends before
   is one with its default: `left` says how many there are. */

#include "core.h"

static uint32_t byte(sf_reader *reader) {
    if (reader->bad || reader->at >= reader->end) {
        reader->bad = true;
        return 0;
    }
    return *reader->at++;
}

static uint64_t number(sf_reader *reader, unsigned bytes) {
    uint64_t value = 0;
    while (bytes--) value = value << 8 | byte(reader);
    return value;
}

static void pass(sf_reader *reader, uint64_t bytes) {
    if (bytes > (uint64_t)(reader->end - reader->at)) reader->bad = true;
    else reader->at += bytes;
}

/* The head of an array: how many elements follow. */
static uint32_t array(sf_reader *reader) {
    uint32_t head = byte(reader);
    if (head >> 4 == 9) return head & 15;
    if (head == 0xDC || head == 0xDD) return (uint32_t)number(reader, head == 0xDC ? 2 : 4);
    reader->bad = true;
    return 0;
}

static void take_one(sf_reader *reader) {
    if (reader->left == 0) reader->bad = true;
    else reader->left--;
}

void sf_open(sf_reader *reader, const uint8_t *bytes, size_t length) {
    *reader = (sf_reader){.at = bytes, .end = bytes + length};
    reader->left = array(reader);
}

static int64_t integer(sf_reader *reader, int64_t least, int64_t most) {
    uint32_t head = byte(reader);
    uint64_t bits;
    int64_t value;
    if (head < 0x80) value = (int64_t)head;
    else if (head >= 0xE0) value = (int64_t)head - 256;
    else if (head >= 0xCC && head <= 0xCF) {
        bits = number(reader, 1u << (head - 0xCC));
        if (bits > INT64_MAX) reader->bad = true;
        value = bits > INT64_MAX ? 0 : (int64_t)bits;
    } else if (head >= 0xD0 && head <= 0xD3) {
        unsigned size = 1u << (head - 0xD0);
        bits = number(reader, size);
        uint64_t sign = (uint64_t)1 << (8 * size - 1);
        value = bits & sign ? -(int64_t)(~bits & (sign - 1)) - 1 : (int64_t)bits;
    } else {
        reader->bad = true;
        return 0;
    }
    if (value < least || value > most) reader->bad = true;
    return reader->bad ? 0 : value;
}

int64_t sf_get_int(sf_reader *reader, int64_t least, int64_t most) {
    take_one(reader);
    return integer(reader, least, most);
}

uint32_t sf_get_counter(sf_reader *reader) { return (uint32_t)sf_get_int(reader, 0, UINT32_MAX); }

uint32_t sf_get_array(sf_reader *reader) {
    take_one(reader);
    return array(reader);
}

const uint8_t *sf_get_bytes(sf_reader *reader, uint16_t most, uint16_t *length) {
    take_one(reader);
    uint32_t head = byte(reader);
    if (head < 0xC4 || head > 0xC6) reader->bad = true;
    uint64_t size = reader->bad ? 0 : number(reader, 1u << (head - 0xC4));
    const uint8_t *at = reader->at;
    if (size > most) reader->bad = true;
    else pass(reader, size);
    *length = reader->bad ? 0 : (uint16_t)size;
    return at;
}

const uint8_t *sf_get_text(sf_reader *reader, uint32_t *length) {
    uint32_t head = byte(reader);
    uint64_t size = head & 31;
    if (head >= 0xD9 && head <= 0xDB) size = number(reader, 1u << (head - 0xD9));
    else if (head >> 5 != 5) reader->bad = true;
    const uint8_t *at = reader->at;
    pass(reader, size);
    *length = reader->bad ? 0 : (uint32_t)size;
    return at;
}

bool sf_get_nil(sf_reader *reader) {
    if (reader->bad || reader->at >= reader->end || *reader->at != 0xC0) return false;
    reader->at++;
    take_one(reader);
    return true;
}

/* Pass over one value of any type; return how many values lie in it. */
static uint64_t skip(sf_reader *reader) {
    uint32_t head = byte(reader);
    if (head < 0x80 || head >= 0xE0 || head == 0xC0 || head == 0xC2 || head == 0xC3) return 0;
    if (head < 0x90) return 2 * (uint64_t)(head & 15);
    if (head < 0xA0) return head & 15;
    if (head < 0xC0) pass(reader, head & 31);
    else if (head >= 0xC4 && head <= 0xC6) pass(reader, number(reader, 1u << (head - 0xC4)));
    else if (head >= 0xC7 && head <= 0xC9) pass(reader, 1 + number(reader, 1u << (head - 0xC7)));
    else if (head == 0xCA || head == 0xCB) pass(reader, head == 0xCA ? 4 : 8);
    else if (head >= 0xCC && head <= 0xD3) pass(reader, 1u << (head & 3));
    else if (head >= 0xD4 && head <= 0xD8) pass(reader, 1 + (1u << (head - 0xD4)));
    else if (head >= 0xD9 && head <= 0xDB) pass(reader, number(reader, 1u << (head - 0xD9)));
    else if (head == 0xDC || head == 0xDD) return number(reader, head == 0xDC ? 2 : 4);
    else if (head == 0xDE || head == 0xDF) return 2 * number(reader, head == 0xDE ? 2 : 4);
    else reader->bad = true;
    return 0;
}

bool sf_close(sf_reader *reader) {
    uint64_t left = reader->left;
    while (left > 0 && !reader->bad) left = left - 1 + skip(reader);
    return !reader->bad && reader->at == reader->end;
}

bool sf_is_id(const uint8_t *text, uint32_t length) {
    if (length < 1 || length > 32) return false;
    for (uint32_t i = 0; i < length; i++) {
        uint8_t c = text[i];
        bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
        if (!letter && c != '_' && c != '.' && c != '-') return false;
    }
    return true;
}
