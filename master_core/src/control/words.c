#include "words.h"

#include <stdint.h>

/** Length of the UTF-8 sequence at `at`, 0 when there is none. */
static size_t sequence(const uint8_t *at, size_t left) {
    static const uint32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
    const uint8_t first = at[0];
    if (first < 0x80) {
        return 1;
    }
    const size_t len = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : first >= 0xC0 ? 2 : 0;
    if (len == 0 || first > 0xF4 || len > left) {
        return 0;
    }
    uint32_t point = first & (0x7Fu >> len);
    for (size_t i = 1; i < len; i++) {
        if ((at[i] & 0xC0u) != 0x80) {
            return 0;
        }
        point = (point << 6) | (at[i] & 0x3Fu);
    }
    const bool surrogate = point >= 0xD800 && point <= 0xDFFF;
    return point < least[len] || point > 0x10FFFF || surrogate ? 0 : len;
}

bool fsn_is_utf8(const char *bytes, size_t len_bytes) {
    const uint8_t *at = (const uint8_t *)bytes;
    while (len_bytes > 0) {
        const size_t len = sequence(at, len_bytes);
        if (len == 0) {
            return false;
        }
        at += len;
        len_bytes -= len;
    }
    return true;
}

static bool is_blank(char c) {
    return c == ' ' || c == '\t';
}

/** Takes one word from `*read` on, writes it to `to`. Never writes ahead of what was read.
 *  Returns the byte behind the word as written, NULL when a quote is left open. */
static char *take(char **read, const char *end, char *to) {
    bool quoted = false;
    char *at = *read;
    for (; at < end && (quoted || !is_blank(*at)); at++) {
        if (*at == '"') {
            quoted = !quoted;
            continue;
        }
        if (quoted && *at == '\\' && at + 1 < end && (at[1] == '"' || at[1] == '\\')) {
            at++;
        }
        *to++ = *at;
    }
    *read = at;
    return quoted ? NULL : to;
}

const char *fsn_words_split(char *line, size_t len_bytes, struct fsn_words *words) {
    words->count = 0;
    if (!fsn_is_utf8(line, len_bytes)) {
        return "the request is not UTF-8";
    }
    for (size_t i = 0; i < len_bytes; i++) {
        const unsigned char c = (unsigned char)line[i];
        if ((c < 0x20 && c != '\t') || c == 0x7F) {
            return "the request has a control character";
        }
    }
    const char *end = line + len_bytes;
    char *at = line;
    for (;;) {
        while (at < end && is_blank(*at)) {
            at++;
        }
        if (at == end) {
            return words->count == 0 ? "the request is empty" : NULL;
        }
        if (words->count == FSN_WORDS) {
            return "the request has too many words";
        }
        char *word = at;
        char *behind = take(&at, end, word);
        if (behind == NULL) {
            return "a quote is left open";
        }
        at += at < end; /* the blank, before the zero may take its place */
        *behind = 0;
        words->word[words->count++] = word;
    }
}
