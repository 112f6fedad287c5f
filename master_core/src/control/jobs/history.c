#include "control/jobs/job.h"

#include "control/base/value.h"
#include "plan/plan_internal.h"

enum {
    MESSAGE_BYTES = 16, /**< without parameters */
    KIND_MASK = 0x0F,
    TYPE_VALUE = 0,
    TYPE_BYTES = 1,
    TYPE_ASCII = 2,
    TYPE_UNICODE = 3,
    TYPE_TEXT_ID = 4,
    LENGTH_MASK = 0x0FFF,
};

/** Data types of CoE that are numbers. */
static const struct {
    uint16_t code;
    uint8_t bytes, kind;
} types[] = {
    {0x01, 1, FSN_KIND_BOOL},     {0x02, 1, FSN_KIND_SIGNED},   {0x03, 2, FSN_KIND_SIGNED},
    {0x04, 4, FSN_KIND_SIGNED},   {0x05, 1, FSN_KIND_UNSIGNED}, {0x06, 2, FSN_KIND_UNSIGNED},
    {0x07, 4, FSN_KIND_UNSIGNED}, {0x08, 4, FSN_KIND_REAL},     {0x11, 8, FSN_KIND_REAL},
    {0x15, 8, FSN_KIND_SIGNED},   {0x1B, 8, FSN_KIND_UNSIGNED}, {0x1E, 1, FSN_KIND_UNSIGNED},
    {0x1F, 2, FSN_KIND_UNSIGNED}, {0x20, 4, FSN_KIND_UNSIGNED},
};

static void put_number(const uint8_t *bytes, uint32_t size, uint8_t kind, struct fsn_json *json) {
    const struct fsn_symbol_info number = {.bits = (uint16_t)(8 * size), .kind = kind};
    fsn_value_write(&number, fsn_value_read(bytes, size), json);
}

static void put_text(const uint8_t *bytes, uint32_t size, unsigned step, struct fsn_json *json) {
    char text[LENGTH_MASK + 1];
    uint32_t len = 0;
    for (uint32_t i = 0; i + step <= size; i += step) {
        const bool plain = step == 1 || bytes[i + 1] == 0;
        text[len++] = plain && (step == 1 || bytes[i] < 0x80) ? (char)bytes[i] : '?';
    }
    text[len] = 0;
    fsn_json_text(json, text);
}

/** Writes one parameter; returns its bytes, 0 if it is invalid. */
static uint32_t put_parameter(const uint8_t *at, uint32_t left, struct fsn_json *json) {
    if (left < 2) {
        return 0;
    }
    const uint16_t flags = fsn_get16(at);
    const unsigned type = flags >> 12;
    uint32_t size = flags & LENGTH_MASK;
    uint8_t kind = FSN_KIND_BITS;
    if (type == TYPE_TEXT_ID) {
        size = 2;
        kind = FSN_KIND_UNSIGNED;
    }
    /* The type code gives size and kind; other codes have unknown sizes. */
    for (size_t i = 0; type == TYPE_VALUE && i < sizeof types / sizeof types[0]; i++) {
        if (types[i].code == (flags & LENGTH_MASK)) {
            size = types[i].bytes;
            kind = types[i].kind;
        }
    }
    /* The length comes from the device: it must stay within the message. */
    if (type > TYPE_TEXT_ID || (type == TYPE_VALUE && kind == FSN_KIND_BITS) || size > left - 2) {
        return 0;
    }
    if (type == TYPE_BYTES) {
        fsn_json_hex(json, at + 2, size);
    } else if (type == TYPE_ASCII || type == TYPE_UNICODE) {
        put_text(at + 2, size, type == TYPE_ASCII ? 1 : 2, json);
    } else {
        put_number(at + 2, size, kind, json);
    }
    return 2 + size;
}

bool fsn_history_message(const uint8_t *bytes, uint32_t size_bytes, uint32_t id,
                         struct fsn_json *json) {
    static const char *const kinds[] = {"info", "warning", "error"};
    if (size_bytes < MESSAGE_BYTES) {
        return false;
    }
    const uint16_t flags = fsn_get16(bytes + 4);
    const unsigned kind = flags & KIND_MASK;
    fsn_json_open(json, '{');
    fsn_json_put_u64(json, "subindex", id);
    fsn_json_put_u64(json, "id", fsn_get32(bytes));
    fsn_json_put_u64(json, "flags", flags);
    fsn_json_put_u64(json, "time_ns", fsn_get64(bytes + 8));
    fsn_json_put_u64(json, "text_id", fsn_get16(bytes + 6));
    fsn_json_put_text(json, "kind", kind < 3 ? kinds[kind] : "error");
    fsn_json_put_open(json, "parameters", '[');
    uint32_t at = MESSAGE_BYTES;
    for (unsigned i = 0; i < flags >> 8; i++) {
        const uint32_t taken = put_parameter(bytes + at, size_bytes - at, json);
        if (taken == 0) {
            break; /* the rest is in `data` */
        }
        at += taken;
    }
    fsn_json_close(json, ']');
    fsn_json_put_hex(json, "data", bytes, size_bytes);
    fsn_json_close(json, '}');
    return true;
}
