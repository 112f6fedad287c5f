#define _POSIX_C_SOURCE 200809L /* strnlen */

#include "control/base/object_value.h"

#include <ctype.h>
#include <string.h>

#include "control/base/value.h"

static const struct {
    const char *name;
    uint16_t bits;
    uint8_t kind;
} numbers[] = {
    {"bool", 8, FSN_KIND_BOOL},        {"int8", 8, FSN_KIND_SIGNED},
    {"int16", 16, FSN_KIND_SIGNED},    {"int32", 32, FSN_KIND_SIGNED},
    {"int64", 64, FSN_KIND_SIGNED},    {"uint8", 8, FSN_KIND_UNSIGNED},
    {"uint16", 16, FSN_KIND_UNSIGNED}, {"uint32", 32, FSN_KIND_UNSIGNED},
    {"uint64", 64, FSN_KIND_UNSIGNED}, {"real32", 32, FSN_KIND_REAL},
    {"real64", 64, FSN_KIND_REAL},
};

bool fsn_data_type_read(const char *text, struct fsn_data_type *type) {
    *type = (struct fsn_data_type){.kind = FSN_DATA_HEX};
    if (strcmp(text, "hex") == 0) {
        return true;
    }
    if (strcmp(text, "string") == 0) {
        type->kind = FSN_DATA_STRING;
        return true;
    }
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        if (strcmp(text, numbers[i].name) == 0) {
            type->kind = FSN_DATA_NUMBER;
            type->number.bits = numbers[i].bits;
            type->number.kind = numbers[i].kind;
            return true;
        }
    }
    return false;
}

static int digit(char c) {
    static const char digits[] = "0123456789abcdef";
    const char *found = c != 0 ? strchr(digits, tolower((unsigned char)c)) : NULL;
    return found != NULL ? (int)(found - digits) : -1;
}

static const char *parse_hex(const char *text, uint8_t *bytes, uint32_t *size_bytes) {
    const size_t len = strlen(text);
    if (len % 2 != 0) {
        return "not a whole number of bytes: hex has two digits for each";
    }
    for (size_t i = 0; i < len; i += 2) {
        const int high = digit(text[i]);
        const int low = digit(text[i + 1]);
        if (high < 0 || low < 0) {
            return "no hex bytes such as 0a1bff";
        }
        bytes[i / 2] = (uint8_t)(high << 4 | low);
    }
    *size_bytes = (uint32_t)(len / 2);
    return NULL;
}

const char *fsn_data_parse(const struct fsn_data_type *type, const char *text, uint8_t *bytes,
                           uint32_t *size_bytes) {
    uint64_t raw;
    if (type->kind == FSN_DATA_HEX) {
        return parse_hex(text, bytes, size_bytes);
    }
    if (type->kind == FSN_DATA_STRING) {
        *size_bytes = (uint32_t)strlen(text);
        memcpy(bytes, text, *size_bytes);
        return NULL;
    }
    const char *wrong = fsn_value_parse(&type->number, text, &raw);
    if (wrong != NULL) {
        return wrong;
    }
    *size_bytes = type->number.bits / 8u;
    for (uint32_t i = 0; i < *size_bytes; i++) {
        bytes[i] = (uint8_t)(raw >> (8 * i));
    }
    return NULL;
}

void fsn_data_write(const struct fsn_data_type *type, const uint8_t *bytes, uint32_t size_bytes,
                    struct fsn_json *json) {
    fsn_json_put_hex(json, "data", bytes, size_bytes);
    fsn_json_put_u64(json, "bytes", size_bytes);
    if (type->kind == FSN_DATA_HEX) {
        return;
    }
    fsn_json_key(json, "value");
    if (type->kind == FSN_DATA_STRING) {
        const char *text = (const char *)bytes;
        fsn_json_chars(json, text, strnlen(text, size_bytes)); /* it ends at its first zero */
    } else if (size_bytes != type->number.bits / 8u) {
        fsn_json_null(json);
    } else {
        fsn_value_write(&type->number, fsn_value_read(bytes, size_bytes), json);
    }
}
