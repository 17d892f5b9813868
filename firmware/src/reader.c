/* A reader of the msgpack that messages are made of: protocol/codec.py.

   Accepts every head that msgpack has for an integer, array, text or bytes, however long.  After an
   error every further call returns 0, and `sf_close` false.  `left` says how many elements of the
   message have not been read: one that is not there has its default. */

#include "core.h"

enum { INTEGER, ARRAY, MAP, TEXT, BYTES, NIL, OTHER };

/* Of the heads from 0xC0 on: type, then how many bytes hold its size or number, or (from 16 on) how
   many bytes follow at once. */
#define KIND(type, bytes) ((type) << 5 | (bytes))
static const uint8_t HEADS[32] = {
    KIND(NIL, 0), KIND(OTHER, 31), KIND(OTHER, 16), KIND(OTHER, 16),
    KIND(BYTES, 1), KIND(BYTES, 2), KIND(BYTES, 4),
    KIND(OTHER, 1), KIND(OTHER, 2), KIND(OTHER, 4),
    KIND(OTHER, 20), KIND(OTHER, 24),
    KIND(INTEGER, 1), KIND(INTEGER, 2), KIND(INTEGER, 4), KIND(INTEGER, 8),
    KIND(INTEGER, 1), KIND(INTEGER, 2), KIND(INTEGER, 4), KIND(INTEGER, 8),
    KIND(OTHER, 18), KIND(OTHER, 19), KIND(OTHER, 21), KIND(OTHER, 25), KIND(OTHER, 30),
    KIND(TEXT, 1), KIND(TEXT, 2), KIND(TEXT, 4), KIND(ARRAY, 2), KIND(ARRAY, 4),
    KIND(MAP, 2), KIND(MAP, 4),
};

static uint64_t fail(sf_reader *reader) {
    reader->bad = true;
    reader->at = reader->end;
    return 0;
}

static void pass(sf_reader *reader, uint32_t bytes) {
    if (bytes > (size_t)(reader->end - reader->at)) fail(reader);
    else reader->at += bytes;
}

/* Read the head of a value: return its number or size, as `*type` says. */
static uint64_t read_head(sf_reader *reader, int *type) {
    uint64_t value = 0;
    *type = OTHER;
    if (reader->at == reader->end) return fail(reader);
    uint32_t head = *reader->at++;
    if (head < 0xC0 || head >= 0xE0) {
        *type = head < 0x80 || head >= 0xE0 ? INTEGER : head < 0x90 ? MAP : head < 0xA0 ? ARRAY : TEXT;
        if (*type == INTEGER) return (uint64_t)(int64_t)(int8_t)head;
        return head & (*type == TEXT ? 31 : 15);
    }
    uint32_t kind = HEADS[head - 0xC0], bytes = kind & 31;
    *type = (int)(kind >> 5);
    if (bytes >= 16) {
        if (bytes == 31) return fail(reader); /* 0xC1 is no value. */
        return bytes == 30 ? 17 : bytes - 16;
    }
    if (bytes > (size_t)(reader->end - reader->at)) return fail(reader);
    for (uint32_t i = bytes; i > 0; i--) value = value << 8 | *reader->at++;
    if (*type == OTHER) return value + 1; /* The type of an extension stands before its bytes. */
    if (head >= 0xD0 && head <= 0xD3) {
        uint32_t spare = 64 - 8 * bytes;
        return (uint64_t)((int64_t)(value << spare) >> spare);
    }
    return head == 0xCF && value >> 63 ? fail(reader) : value;
}

/* Read the head of the message's next element, which is to be of a type. */
SHARED static uint64_t element(sf_reader *reader, int type) {
    int found;
    uint64_t value = read_head(reader, &found);
    if (found != type || reader->left-- == 0) return fail(reader);
    return value;
}

void sf_open(sf_reader *reader, const uint8_t *bytes, size_t length) {
    reader->at = bytes;
    reader->end = bytes + length;
    reader->bad = false;
    reader->left = 1;
    reader->left = (uint32_t)element(reader, ARRAY);
}

SHARED int64_t sf_get_int(sf_reader *reader, int64_t least, int64_t most) {
    int64_t value = (int64_t)element(reader, INTEGER);
    if (value < least || value > most) fail(reader);
    return reader->bad ? 0 : value;
}

SHARED uint32_t sf_get_small(sf_reader *reader, uint32_t least, uint32_t most) {
    return (uint32_t)sf_get_int(reader, least, most);
}

SHARED uint32_t sf_get_counter(sf_reader *reader) { return sf_get_small(reader, 0, UINT32_MAX); }

SHARED int32_t sf_get_ms(sf_reader *reader) {
    return (int32_t)sf_get_int(reader, INT32_MIN, INT32_MAX);
}

SHARED int64_t sf_get_stamp(sf_reader *reader) { return sf_get_int(reader, -SF_UNKNOWN, SF_UNKNOWN); }

uint32_t sf_get_array(sf_reader *reader) { return (uint32_t)element(reader, ARRAY); }

static const uint8_t *content(sf_reader *reader, int type, uint32_t *length) {
    *length = (uint32_t)element(reader, type);
    const uint8_t *at = reader->at;
    pass(reader, *length);
    if (reader->bad) *length = 0;
    return at;
}

const uint8_t *sf_get_bytes(sf_reader *reader, uint32_t *length) {
    return content(reader, BYTES, length);
}

const uint8_t *sf_get_text(sf_reader *reader, uint32_t *length) {
    return content(reader, TEXT, length);
}

bool sf_get_nil(sf_reader *reader) {
    if (reader->at == reader->end || *reader->at != 0xC0) return false;
    element(reader, NIL);
    return true;
}

bool sf_close(sf_reader *reader) {
    uint64_t left = reader->left;
    while (left > 0 && !reader->bad) {
        int type;
        uint64_t size = read_head(reader, &type);
        left--;
        if (type == ARRAY || type == MAP) left += size << (type == MAP);
        else if (type == TEXT || type == BYTES || type == OTHER) pass(reader, (uint32_t)size);
    }
    return !reader->bad && reader->at == reader->end;
}

bool sf_is_id(const uint8_t *text, uint32_t length) {
    if (length < 1 || length > 32) return false;
    for (uint32_t i = 0; i < length; i++) {
        uint8_t c = text[i], letter = c | 0x20;
        bool word = (letter >= 'a' && letter <= 'z') || (c >= '0' && c <= '9') || c == '_';
        if (!word && c != '.' && c != '-') return false;
    }
    return true;
}

bool sf_is_named(const char *id, const uint8_t *text, uint32_t length) {
    uint32_t i = 0;
    while (i < length && id[i] == (char)text[i]) i++;
    return i == length && id[i] == 0;
}
