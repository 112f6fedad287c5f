/** Writes one JSON document into a buffer that grows up to a limit. */
#ifndef FSN_CONTROL_JSON_H
#define FSN_CONTROL_JSON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fsn/status.h"

/** Zero with a limit is an empty document. After the first failure nothing more is written. */
struct fsn_json {
    char *bytes; /**< owned; not zero-terminated */
    size_t len_bytes, room_bytes;
    size_t limit_bytes; /**< maximum length */
    fsn_status failed;  /**< FSN_E_SPACE: the limit was reached; FSN_E_NOMEM: out of memory */
    bool comma;         /**< the next value or key needs a comma before it */
};

/** Frees the buffer; the limit is kept. */
void fsn_json_free(struct fsn_json *json);

/** Starts again in the same buffer. */
void fsn_json_clear(struct fsn_json *json);

/** Opens and closes objects and arrays: '{' '}' '[' ']'. */
void fsn_json_open(struct fsn_json *json, char bracket);
void fsn_json_close(struct fsn_json *json, char bracket);

/** Writes a key; a value follows. `key` needs no escapes. */
void fsn_json_key(struct fsn_json *json, const char *key);

/** Values. Text that is not valid UTF-8 gets a replacement character for each invalid byte; a
 *  number that JSON does not have becomes null. */
void fsn_json_text(struct fsn_json *json, const char *text); /**< NULL: null */
void fsn_json_chars(struct fsn_json *json, const char *text, size_t len_bytes);
void fsn_json_u64(struct fsn_json *json, uint64_t value);
void fsn_json_i64(struct fsn_json *json, int64_t value);
void fsn_json_real(struct fsn_json *json, double value);
void fsn_json_bool(struct fsn_json *json, bool value);
void fsn_json_null(struct fsn_json *json);

/** A value that is already JSON. */
void fsn_json_raw(struct fsn_json *json, const char *bytes, size_t len_bytes);
/** Bytes as a text of two hexadecimal digits each. */
void fsn_json_hex(struct fsn_json *json, const uint8_t *bytes, size_t len_bytes);

/** Key and value; or the beginning of an object or array. */
void fsn_json_put_open(struct fsn_json *json, const char *key, char bracket);
/** Opens an object, or writes null; returns `exists`. */
bool fsn_json_put_object(struct fsn_json *json, const char *key, bool exists);
void fsn_json_put_text(struct fsn_json *json, const char *key, const char *text);
void fsn_json_put_u64(struct fsn_json *json, const char *key, uint64_t value);
/** Null if it is unknown. */
void fsn_json_put_known(struct fsn_json *json, const char *key, bool known, uint64_t value);
void fsn_json_put_bool(struct fsn_json *json, const char *key, bool value);
/** Bytes as an array of numbers. */
void fsn_json_put_bytes(struct fsn_json *json, const char *key, const uint8_t *bytes, size_t count);
void fsn_json_put_hex(struct fsn_json *json, const char *key, const uint8_t *bytes,
                      size_t len_bytes);

/** Fields of a structure under their own names, at most 8: FSN_JSON_PUT(json, &info, name, alias).
 *  Unsigned numbers, texts and bools. */
#define FSN_JSON_PUT(json, of, ...)                                                                \
    FSN_JSON_COUNT(__VA_ARGS__, 8, 7, 6, 5, 4, 3, 2, 1, 0)(json, of, __VA_ARGS__)
#define FSN_JSON_COUNT(a, b, c, d, e, f, g, h, n, ...) FSN_JSON_##n
#define FSN_JSON_1(json, of, field)                                                                \
    _Generic((of)->field,                                                                          \
        bool: fsn_json_put_bool,                                                                   \
        char *: fsn_json_put_text,                                                                 \
        const char *: fsn_json_put_text,                                                           \
        default: fsn_json_put_u64)(json, #field, (of)->field)
#define FSN_JSON_2(j, of, f, ...) (FSN_JSON_1(j, of, f), FSN_JSON_1(j, of, __VA_ARGS__))
#define FSN_JSON_3(j, of, f, ...) (FSN_JSON_1(j, of, f), FSN_JSON_2(j, of, __VA_ARGS__))
#define FSN_JSON_4(j, of, f, ...) (FSN_JSON_1(j, of, f), FSN_JSON_3(j, of, __VA_ARGS__))
#define FSN_JSON_5(j, of, f, ...) (FSN_JSON_1(j, of, f), FSN_JSON_4(j, of, __VA_ARGS__))
#define FSN_JSON_6(j, of, f, ...) (FSN_JSON_1(j, of, f), FSN_JSON_5(j, of, __VA_ARGS__))
#define FSN_JSON_7(j, of, f, ...) (FSN_JSON_1(j, of, f), FSN_JSON_6(j, of, __VA_ARGS__))
#define FSN_JSON_8(j, of, f, ...) (FSN_JSON_1(j, of, f), FSN_JSON_7(j, of, __VA_ARGS__))

/** An event: opens it with its name and the UTC of a monotonic time; ends it with level and text.
 */
void fsn_json_begin_event(struct fsn_json *json, const char *name, uint64_t at_ns);
void fsn_json_end_event(struct fsn_json *json, const char *level, const char *text);

/** Ends the line. */
void fsn_json_end(struct fsn_json *json);

#endif
