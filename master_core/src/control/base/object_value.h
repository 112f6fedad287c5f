/** Converts bytes of objects by the type in a request. */
#ifndef FSN_CONTROL_OBJECT_VALUE_H
#define FSN_CONTROL_OBJECT_VALUE_H

#include "control/base/json.h"
#include "fsn/plan.h"

/** Interpretation of the bytes of an object. */
enum fsn_data_kind { FSN_DATA_HEX, FSN_DATA_NUMBER, FSN_DATA_STRING };
struct fsn_data_type {
    enum fsn_data_kind kind;
    struct fsn_symbol_info number; /**< bits and kind; of a number */
};

/** Reads the name of a type: bool int8 … uint64 real32 real64 string hex. */
bool fsn_data_type_read(const char *text, struct fsn_data_type *type);

/** Bytes of a value, low byte first.
 *  @param[out] bytes  room for the length of the text.
 *  @return NULL, or the text of the error. */
const char *fsn_data_parse(const struct fsn_data_type *type, const char *text, uint8_t *bytes,
                           uint32_t *size_bytes);

/** Writes "data", "bytes" and, if the type is not plain hex, "value". Null if the number of bytes
 *  does not match the type. */
void fsn_data_write(const struct fsn_data_type *type, const uint8_t *bytes, uint32_t size_bytes,
                    struct fsn_json *json);

#endif
