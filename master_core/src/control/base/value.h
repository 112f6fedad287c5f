/** Values of symbols and objects as text, by their type in the plan or the request. */
#ifndef FSN_CONTROL_VALUE_H
#define FSN_CONTROL_VALUE_H

#include "control/base/json.h"
#include "fsn/plan.h"

/** Reads a value: true, false, on or off for one bit; integers in decimal, 0x, 0o or 0b; floating
 *  point if the symbol is. `raw` gets the bits for fsn_core_set_output().
 *  @return NULL, or the text of the error.   Context: any thread. */
const char *fsn_value_parse(const struct fsn_symbol_info *symbol, const char *text, uint64_t *raw);

/** Reads an integer from 0 to 2^bits - 1, `bits` up to 64. Returns as above. Context: any
 *  thread. */
const char *fsn_value_parse_number(const char *text, uint16_t bits, uint64_t *number);

/** The bits of a value of up to 8 bytes, low byte first. Context: any thread. */
uint64_t fsn_value_read(const uint8_t *bytes, uint32_t size_bytes);

/** Writes the value of these bits. Context: any thread. */
void fsn_value_write(const struct fsn_symbol_info *symbol, uint64_t raw, struct fsn_json *json);

/** The same in the units of the symbol: its factor and offset apply, and a value that is not
 *  floating point is rounded to the nearest integer. Not applicable to a bool. */
const char *fsn_value_parse_typed(const struct fsn_symbol_info *symbol, const char *text,
                                  uint64_t *raw);
void fsn_value_write_typed(const struct fsn_symbol_info *symbol, uint64_t raw,
                           struct fsn_json *json);

/** Returns "bool", "signed", "unsigned", "real" or "bits". Context: any thread. */
const char *fsn_value_type(const struct fsn_symbol_info *symbol);

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
