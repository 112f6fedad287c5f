#include "control/base/words.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>

/** Length of the UTF-8 sequence at `at` and its character, 0 if it is invalid. */
static size_t decode(const uint8_t *at, size_t left, uint32_t *character) {
    static const uint32_t least[] = {0x80, 0x800, 0x10000}; /* of two and more bytes */
    const uint8_t first = at[0];
    *character = first;
    if (first < 0x80) {
        return 1;
    }
    /* 0xC0 and 0xC1 would be longer forms of ASCII; the check of the minimum value rejects them. */
    const size_t len = 2u + (first >= 0xE0) + (first >= 0xF0);
    if (first < 0xC0 || first > 0xF4 || len > left) {
        return 0;
    }
    uint32_t point = first & (0x7Fu >> len);
    for (size_t i = 1; i < len; i++) {
        if ((at[i] & 0xC0u) != 0x80) {
            return 0;
        }
        point = (point << 6) | (at[i] & 0x3Fu);
    }
    *character = point;
    /* Surrogates and values beyond Unicode would make the JSON of the answer invalid. */
    const bool surrogate = point >= 0xD800 && point <= 0xDFFF;
    return point < least[len - 2] || point > 0x10FFFF || surrogate ? 0 : len;
}

/** Whether a character controls a terminal, hides, or reorders its line. */
static bool is_hidden(uint32_t character) {
    static const struct {
        uint32_t first, last;
    } hidden[] = {
        {0x00, 0x1F},     {0x7F, 0x9F},     {0xAD, 0xAD},     {0x061C, 0x061C}, {0x180E, 0x180E},
        {0x200B, 0x200F}, {0x2028, 0x202E}, {0x2060, 0x206F}, {0xFEFF, 0xFEFF}, {0xFFF9, 0xFFFB},
    };
    for (size_t i = 0; i < sizeof hidden / sizeof hidden[0]; i++) {
        if (character >= hidden[i].first && character <= hidden[i].last) {
            return true;
        }
    }
    return false;
}

size_t fsn_show_character(const char *at, size_t left, char shown[FSN_SHOWN_BYTES]) {
    uint32_t character;
    size_t len = decode((const uint8_t *)at, left, &character);
    if (len == 0) {
        len = 1;
        character = 0xFFFD;
    } else if (!is_hidden(character)) {
        memcpy(shown, at, len);
        shown[len] = '\0';
        return len;
    }
    snprintf(shown, FSN_SHOWN_BYTES, "\\u%04x", (unsigned)(character & 0xFFFF));
    return len;
}

size_t fsn_show_text(char *to, size_t size_bytes, const char *text) {
    size_t len = 0;
    for (size_t left = strlen(text); left > 0 && len + FSN_SHOWN_BYTES <= size_bytes;) {
        const size_t taken = fsn_show_character(text, left, to + len);
        len += strlen(to + len);
        text += taken;
        left -= taken;
    }
    to[len] = '\0';
    return len;
}

bool fsn_is_utf8(const char *bytes, size_t len_bytes) {
    const uint8_t *at = (const uint8_t *)bytes;
    uint32_t character;
    while (len_bytes > 0) {
        const size_t len = decode(at, len_bytes, &character);
        if (len == 0) {
            return false;
        }
        at += len;
        len_bytes -= len;
    }
    return true;
}

size_t fsn_utf8_cut(const char *text, size_t most) {
    while (most > 0 && ((uint8_t)text[most] & 0xC0u) == 0x80) {
        most--;
    }
    return most;
}

static bool is_blank(char c) {
    return c == ' ' || c == '\t';
}

/** Takes one word from `*read` on, and writes it to `to`. Never writes ahead of the read position.
 *  Returns the byte after the written word, or NULL if a quote is not closed. */
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
        /* A line end within a word could forge a log line. */
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

void fsn_hex_text(const uint8_t *bytes, size_t len_bytes, char *to) {
    for (size_t i = 0; i < len_bytes; i++) {
        snprintf(to + 2 * i, 3, "%02x", (unsigned)bytes[i]);
    }
    to[2 * len_bytes] = 0;
}
