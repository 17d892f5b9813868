/* A reader of the msgpack that messages are made of: protocol/codec.py.

   Accepts every head that msgpack has for an integer, array, text or bytes, however long.  After an
   error every further call returns 0, and `sf_close` false.  `left` says how many elements of the
   message have not been read: one that is not there has its default. */

#include "core.h"

enum { INTEGER, ARRAY, MAP, TEXT, BYTES, NIL, OTHER };

/* Of the heads from 0xC0 on: type, then how many bytes hold its size or number, or (from 9 on) how
   many bytes follow at once. */
#define KIND(type, bytes) ((type) << 5 | (bytes))
#define THEN(bytes) KIND(OTHER, 9 + (bytes))
#define NONE 31
static const uint8_t HEADS[32] = {
    KIND(NIL, 0), KIND(OTHER, NONE), THEN(0), THEN(0), KIND(BYTES, 1), KIND(BYTES, 2), KIND(BYTES, 4),
    KIND(OTHER, 1), KIND(OTHER, 2), KIND(OTHER, 4), THEN(4), THEN(8),
    KIND(INTEGER, 1), KIND(INTEGER, 2), KIND(INTEGER, 4), KIND(INTEGER, 8),
    KIND(INTEGER, 1), KIND(INTEGER, 2), KIND(INTEGER, 4), KIND(INTEGER, 8),
    THEN(2), THEN(3), THEN(5), THEN(9), THEN(17), KIND(TEXT, 1), KIND(TEXT, 2), KIND(TEXT, 4),
    KIND(ARRAY, 2), KIND(ARRAY, 4), KIND(MAP, 2), KIND(MAP, 4),
};

static uint64_t fail(sf_reader *reader) {
    reader->bad = true;
    reader->at = reader->end;
    return 0;
}

static bool lacks(const sf_reader *reader, uint32_t bytes) {
    return bytes > (size_t)(reader->end - reader->at);
}

static void pass(sf_reader *reader, uint32_t bytes) {
    if (lacks(reader, bytes)) fail(reader);
    else reader->at += bytes;
}

/* Read the head of a value: its number or size, as reader->type says. */
SHARED static uint64_t read_head(sf_reader *reader) {
    if (reader->at == reader->end) return fail(reader);
    uint32_t head = *reader->at++;
    if (head < 0x80 || head >= 0xE0) {
        reader->type = INTEGER;
        return (uint64_t)(int8_t)head;
    }
    if (head < 0xC0) {
        reader->type = head < 0x90 ? MAP : head < 0xA0 ? ARRAY : TEXT;
        return head & (head < 0xA0 ? 15 : 31);
    }
    uint32_t kind = HEADS[head - 0xC0], bytes = kind & 31;
    reader->type = (uint8_t)(kind >> 5);
    if (bytes == NONE) return fail(reader);
    if (bytes >= 9) return bytes - 9;
    if (lacks(reader, bytes)) return fail(reader);
    uint64_t value = head >= 0xD0 && head <= 0xD3 && *reader->at >= 0x80 ? UINT64_MAX : 0;
    for (uint32_t i = bytes; i > 0; i--) value = value << 8 | *reader->at++;
    if (head == 0xCF && value >> 63) return fail(reader);
    return reader->type == OTHER ? value + 1 : value; /* An extension's type stands before its bytes. */
}

/* Read the head of the next element, which is to be of a type. */
SHARED static uint64_t element(sf_reader *reader, int type) {
    uint64_t value = read_head(reader);
    if (reader->type != type || reader->left-- == 0) return fail(reader);
    return value;
}

int sf_open(sf_reader *reader, const uint8_t *bytes, size_t length) {
    *reader = (sf_reader){.at = bytes, .end = bytes + length, .left = 1};
    reader->left = sf_get_array(reader);
    int64_t tag = sf_get_int(reader);
    return tag == (uint8_t)tag ? (int)tag : 0;
}

SHARED int64_t sf_get_int(sf_reader *reader) { return (int64_t)element(reader, INTEGER); }

SHARED uint32_t sf_get_array(sf_reader *reader) { return (uint32_t)element(reader, ARRAY); }

/* Read integers into the fields of a struct, up to one of kind 0; one that is left out keeps its
   value.  Return the field behind that. */
const sf_field *sf_get_fields(sf_reader *reader, void *into, const sf_field *field) {
    for (; field->kind; field++) {
        void *at = (uint8_t *)into + field->at;
        bool fits = true;
        if (field->kind >= SF_OPTIONAL && reader->left == 0) continue;
        if (field->kind >= SF_NULLABLE && reader->at < reader->end && *reader->at == 0xC0) {
            element(reader, NIL);
            continue;
        }
        int64_t value = sf_get_int(reader);
        switch (field->kind % SF_OPTIONAL) {
        case SF_U32: fits = value == (*(uint32_t *)at = (uint32_t)value); break;
        case SF_I32: fits = value == (*(int32_t *)at = (int32_t)value); break;
        default:
            *(int64_t *)at = value;
            fits = value >= -SF_UNKNOWN && value <= SF_UNKNOWN;
        }
        if (!fits) fail(reader);
    }
    return field + 1;
}

SHARED static void get_content(sf_reader *reader, int type) {
    uint32_t size = (uint32_t)element(reader, type);
    reader->content = reader->at;
    pass(reader, size);
    reader->length = reader->bad ? 0 : size;
}

void sf_get_bytes(sf_reader *reader) { get_content(reader, BYTES); }

void sf_get_text(sf_reader *reader) { get_content(reader, TEXT); }

bool sf_close(sf_reader *reader) {
    for (uint64_t left = reader->left; left > 0 && !reader->bad; left--) {
        uint64_t size = read_head(reader);
        switch (reader->type) {
        case MAP: left += size; /* fall through */
        case ARRAY: left += size; break;
        case INTEGER:
        case NIL: break;
        default: pass(reader, size > UINT16_MAX ? UINT32_MAX : (uint32_t)size);
        }
    }
    return !reader->bad && reader->at == reader->end;
}

bool sf_is_id(const sf_reader *reader) {
    const uint8_t *text = reader->content;
    uint32_t length = reader->length;
    if (length < 1 || length > 32) return false;
    for (; length > 0; length--) {
        uint32_t one = *text++;
        if ((one | 32) - 'a' < 26) continue; /* a letter */
        if (one - '0' < 10 || one - '-' < 2 || one == '_') continue;
        return false;
    }
    return true;
}

bool sf_is_named(const sf_reader *reader, const char *id) {
    const uint8_t *text = reader->content;
    const uint8_t *end = text + reader->length;
    while (*id && text < end && *id == (char)*text) id++, text++;
    return *id == 0 && text == end;
}

#include "core_end.h"
