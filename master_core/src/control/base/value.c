#include "control/base/value.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool is_real(const struct fsn_symbol_info *symbol) {
    return symbol->kind == FSN_KIND_REAL && (symbol->bits == 32 || symbol->bits == 64);
}

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
    const bool is_signed = symbol->kind == FSN_KIND_SIGNED;
    const uint64_t mask = symbol->bits == 64 ? UINT64_MAX : (UINT64_C(1) << symbol->bits) - 1;
    uint64_t most = is_signed ? mask >> 1 : mask;
    if (negative) {
        most = is_signed ? most + 1 : 0;
    }
    if (magnitude > most) {
        return "outside the range of its type";
    }
    *raw = (negative ? 0 - magnitude : magnitude) & mask;
    return NULL;
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

static const char *store_real(const struct fsn_symbol_info *symbol, double number, uint64_t *raw) {
    if (!isfinite(number) || (symbol->bits == 32 && !isfinite((float)number))) {
        return "outside the range of its type";
    }
    if (symbol->bits == 32) {
        const float narrow = (float)number;
        uint32_t bits;
        memcpy(&bits, &narrow, sizeof bits);
        *raw = bits;
    } else {
        memcpy(raw, &number, sizeof *raw);
    }
    return NULL;
}

const char *fsn_value_parse(const struct fsn_symbol_info *symbol, const char *text, uint64_t *raw) {
    if (is_real(symbol)) {
        double number;
        return read_real(text, &number) ? store_real(symbol, number, raw) : "no number";
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

static const char *store_whole(const struct fsn_symbol_info *symbol, double number, uint64_t *raw) {
    const bool is_signed = symbol->kind == FSN_KIND_SIGNED;
    const double end = ldexp(1, symbol->bits - (is_signed ? 1 : 0)); /* first invalid one */
    const double rounded = round(number);
    if (!(rounded < end && rounded >= (is_signed ? -end : 0))) {
        return "outside the range of its type";
    }
    const uint64_t mask = symbol->bits == 64 ? UINT64_MAX : (UINT64_C(1) << symbol->bits) - 1;
    const uint64_t magnitude = (uint64_t)fabs(rounded);
    /* mutants: 0 has no sign */
    *raw = (rounded < 0 ? 0 - magnitude : magnitude) & mask;
    return NULL;
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
    const double scaled = symbol->factor * number + symbol->offset;
    return is_real(symbol) ? store_real(symbol, scaled, raw) : store_whole(symbol, scaled, raw);
}

/** The number for these bits. */
static double number_of(const struct fsn_symbol_info *symbol, uint64_t raw) {
    if (is_real(symbol) && symbol->bits == 32) {
        const uint32_t bits = (uint32_t)raw;
        float number;
        memcpy(&number, &bits, sizeof number);
        return (double)number;
    }
    if (is_real(symbol)) {
        double number;
        memcpy(&number, &raw, sizeof number);
        return number;
    }
    const uint64_t sign = UINT64_C(1) << (symbol->bits - 1);
    return symbol->kind == FSN_KIND_SIGNED && (raw & sign) != 0 ? -(double)((~raw & (sign - 1)) + 1)
                                                                : (double)raw;
}

void fsn_value_write_typed(const struct fsn_symbol_info *symbol, uint64_t raw,
                           struct fsn_json *json) {
    if (!is_scaled(symbol)) {
        fsn_value_write(symbol, raw, json);
        return;
    }
    const double number = number_of(symbol, raw);
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
    } else if (is_real(symbol)) {
        fsn_json_real(json, number_of(symbol, raw));
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
    if (is_real(symbol)) {
        return "real";
    }
    return name[symbol->kind <= FSN_KIND_REAL ? symbol->kind : 0];
}
