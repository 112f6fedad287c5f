#define _POSIX_C_SOURCE 200809L /* strnlen */

#include "control/base/value.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "rt/number.h"

/** Reads an integer: sign and magnitude. */
static bool whole(const char *text, bool *negative, uint64_t *magnitude) {
    int base = 10;
    *negative = *text == '-';
    text += *text == '-' || *text == '+';
    /* 0x, 0o and 0b as in Python; a single leading 0 is decimal. */
    if (text[0] == '0' && text[1] != 0 && strchr("xXoObB", text[1]) != NULL) {
        static const int base_of[] = {['b'] = 2, ['o'] = 8, ['x'] = 16};
        base = base_of[tolower((unsigned char)text[1])];
        text += 2;
    }
    if (!isalnum((unsigned char)*text)) { /* strtoull would accept blanks and a second sign */
        return false;
    }
    if (base == 16 && text[0] == '0' && (text[1] == 'x' || text[1] == 'X')) {
        return false; /* and a second prefix */
    }
    char *end = NULL;
    errno = 0;
    *magnitude = strtoull(text, &end, base);
    return errno == 0 && *end == 0;
}

static const char *parse_whole(const struct fsn_symbol_info *symbol, const char *text,
                               uint64_t *raw) {
    bool negative;
    uint64_t magnitude;
    if (!whole(text, &negative, &magnitude)) {
        return "not an integer of at most 64 bits";
    }
    return fsn_bits_of_integer(symbol->kind, symbol->bits, negative, magnitude, raw)
               ? NULL
               : "outside the range of its type";
}

static bool read_real(const char *text, double *number) {
    char *end = NULL;
    const char *digits = text + (*text == '-' || *text == '+');
    if (!isdigit((unsigned char)*digits) && *digits != '.') {
        return false;
    }
    *number = strtod(text, &end);
    return *end == 0;
}

static const char *store(const struct fsn_symbol_info *symbol, double number, uint64_t *raw) {
    return fsn_bits_of(symbol->kind, symbol->bits, number, raw) ? NULL
                                                                : "outside the range of its type";
}

const char *fsn_value_parse(const struct fsn_symbol_info *symbol, const char *text, uint64_t *raw) {
    if (fsn_is_real(symbol->kind, symbol->bits)) {
        double number;
        return read_real(text, &number) ? store(symbol, number, raw) : "no number";
    }
    if (symbol->kind == FSN_KIND_BOOL || symbol->bits == 1) {
        if (strcmp(text, "true") == 0 || strcmp(text, "on") == 0 || strcmp(text, "1") == 0) {
            *raw = 1;
            return NULL;
        }
        if (strcmp(text, "false") == 0 || strcmp(text, "off") == 0 || strcmp(text, "0") == 0) {
            *raw = 0;
            return NULL;
        }
        return "not true, false, on, off, 1 or 0";
    }
    return parse_whole(symbol, text, raw);
}

static bool is_scaled(const struct fsn_symbol_info *symbol) {
    return symbol->kind != FSN_KIND_BOOL && !(symbol->factor == 1 && symbol->offset == 0);
}

const char *fsn_value_parse_typed(const struct fsn_symbol_info *symbol, const char *text,
                                  uint64_t *raw) {
    double number;
    if (!is_scaled(symbol)) {
        return fsn_value_parse(symbol, text, raw);
    }
    if (!read_real(text, &number)) {
        return "not a number";
    }
    return store(symbol, symbol->factor * number + symbol->offset, raw);
}

void fsn_value_write_typed(const struct fsn_symbol_info *symbol, uint64_t raw,
                           struct fsn_json *json) {
    if (!is_scaled(symbol)) {
        fsn_value_write(symbol, raw, json);
        return;
    }
    const double number = fsn_number_of(symbol->kind, symbol->bits, raw);
    fsn_json_real(json, symbol->output != 0 ? (number - symbol->offset) / symbol->factor
                                            : symbol->factor * number + symbol->offset);
}

const char *fsn_value_parse_number(const char *text, uint16_t bits, uint64_t *number) {
    const struct fsn_symbol_info type = {.bits = bits, .kind = FSN_KIND_UNSIGNED};
    return parse_whole(&type, text, number);
}

uint64_t fsn_value_read(const uint8_t *bytes, uint32_t size_bytes) {
    uint64_t raw = 0;
    for (uint32_t i = 0; i < size_bytes; i++) {
        raw |= (uint64_t)bytes[i] << (8 * i);
    }
    return raw;
}

void fsn_value_write(const struct fsn_symbol_info *symbol, uint64_t raw, struct fsn_json *json) {
    if (symbol->kind == FSN_KIND_BOOL) {
        fsn_json_bool(json, raw != 0);
    } else if (fsn_is_real(symbol->kind, symbol->bits)) {
        fsn_json_real(json, fsn_number_of(symbol->kind, symbol->bits, raw));
    } else if (symbol->kind == FSN_KIND_SIGNED) {
        const uint64_t sign = UINT64_C(1) << (symbol->bits - 1);
        const uint64_t wide = (raw ^ sign) - sign;
        int64_t number;
        memcpy(&number, &wide, sizeof number);
        fsn_json_i64(json, number);
    } else {
        fsn_json_u64(json, raw);
    }
}

const char *fsn_value_type(const struct fsn_symbol_info *symbol) {
    static const char *const name[] = {"bits", "bool", "signed", "unsigned", "bits"};
    if (fsn_is_real(symbol->kind, symbol->bits)) {
        return "real";
    }
    return name[symbol->kind <= FSN_KIND_REAL ? symbol->kind : 0];
}

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

static const char *parse_hex(const char *text, uint8_t *bytes, uint32_t *size_bytes) {
    const size_t len = strlen(text);
    if (len % 2 != 0) {
        return "not a whole number of bytes: hex has two digits for each";
    }
    if (strspn(text, "0123456789abcdefABCDEF") != len) {
        return "no hex bytes such as 0a1bff";
    }
    for (size_t i = 0; i < len; i += 2) {
        const char pair[] = {text[i], text[i + 1], 0};
        bytes[i / 2] = (uint8_t)strtoul(pair, NULL, 16);
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
