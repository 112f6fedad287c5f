/** One request line, split into words. */
#ifndef FSN_CONTROL_WORDS_H
#define FSN_CONTROL_WORDS_H

#include <stdbool.h>
#include <stddef.h>

enum {
    FSN_LINE_BYTES = 8192, /**< longest request, without its newline */
    FSN_WORDS = 256,       /**< most words of a request */
};

struct fsn_words {
    const char *word[FSN_WORDS]; /**< zero-terminated, inside the line */
    size_t count;
};

/** Splits a line at blanks, in place. Double quotes keep blanks together, inside them \" and \\
 *  stand for themselves; quotes may begin and end inside a word: name="a b".
 *  @param[in,out] line  len_bytes bytes and room for one zero behind them.
 *  @return NULL, or what is wrong with the line, in words.
 *  Context: any thread. */
const char *fsn_words_split(char *line, size_t len_bytes, struct fsn_words *words);

/** Whether bytes are whole, shortest UTF-8 without surrogates. Context: any thread. */
bool fsn_is_utf8(const char *bytes, size_t len_bytes);

#endif
