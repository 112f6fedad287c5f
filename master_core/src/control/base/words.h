/** One request line, split into words. */
#ifndef FSN_CONTROL_WORDS_H
#define FSN_CONTROL_WORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    FSN_LINE_BYTES = 8192, /**< longest request, without its newline */
    FSN_WORDS = 256,       /**< most words of a request */
    FSN_SHOWN_BYTES = 8,   /**< one character in its displayed form, with its zero */
};

struct fsn_words {
    const char *word[FSN_WORDS]; /**< zero-terminated, inside the line */
    size_t count;
};

/** Splits a line at blanks, in place. Double quotes keep blanks together, inside them \" and \\ are
 *  escapes; quotes may begin and end inside a word: name="a b".
 *  @param[in,out] line  len_bytes bytes and room for a zero after them.
 *  @return NULL, or the text of the error.
 *  Context: any thread. */
const char *fsn_words_split(char *line, size_t len_bytes, struct fsn_words *words);

/** Writes the first character of a text in a form that is safe for people and programs. A character
 *  that controls a terminal, hides or reorders a line, and an invalid UTF-8 byte, becomes its JSON
 *  escape.
 *  @param[in] at  left bytes, at least one.
 *  @param[out] shown  zero-terminated.
 *  @return number of bytes of `at` that it covers.
 *  Context: any thread. */
size_t fsn_show_character(const char *at, size_t left, char shown[FSN_SHOWN_BYTES]);

/** Writes a whole text in this form, as far as it fits.
 *  @param[out] to  size_bytes bytes, at least one; zero-terminated.
 *  @return length of the written text.
 *  Context: any thread. */
size_t fsn_show_text(char *to, size_t size_bytes, const char *text);

/** Writes bytes as two hexadecimal digits each.
 *  @param[out] to  2 * len_bytes + 1 bytes; zero-terminated.
 *  Context: any thread. */
void fsn_hex_text(const uint8_t *bytes, size_t len_bytes, char *to);

/** Largest number of bytes of a text, at most `most`, that ends with a complete character.
 *  @param[in] text  UTF-8 of more than `most` bytes.   Context: any thread. */
size_t fsn_utf8_cut(const char *text, size_t most);

/** Whether bytes are complete, shortest-form UTF-8 without surrogates. Context: any thread. */
bool fsn_is_utf8(const char *bytes, size_t len_bytes);

#endif
