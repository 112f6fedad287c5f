/** Object dictionary of an emulated SubDevice: objects that CoE reads and writes. */
#ifndef FSN_SEGMENT_OBJECTS_H
#define FSN_SEGMENT_OBJECTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** One value; numbers are stored low byte first. */
struct object {
    uint16_t index;
    uint8_t sub;
    bool writable;
    uint32_t size_bytes;
    uint32_t at; /**< position of its first byte in the values */
};

struct objects {
    struct object *rows; /**< in the order of addition; subindexes of an index are consecutive */
    uint32_t count, room;
    uint8_t *values;  /**< current values */
    uint8_t *initial; /**< values at power-on */
    uint32_t value_bytes, value_room;
    bool failed; /**< out of memory: an object to be added is missing */
};

/** Adds a value, unless it already exists. */
void objects_add(struct objects *objects, uint16_t index, uint8_t sub, bool writable,
                 const void *value, uint32_t size_bytes);

/** Sets a value now and for every power-on; adds it, writable or not, if it does not exist. False
 *  when it has another length, or memory ran out. */
bool objects_put(struct objects *objects, uint16_t index, uint8_t sub, bool writable,
                 const void *value, uint32_t size_bytes);

/** Adds a number of 1, 2 or 4 bytes. */
void objects_add_number(struct objects *objects, uint16_t index, uint8_t sub, bool writable,
                        uint32_t value, uint32_t size_bytes);

/** Returns an object, or NULL. */
const struct object *objects_find(const struct objects *objects, uint16_t index, uint8_t sub);

/** Whether any object has this index. */
bool objects_has(const struct objects *objects, uint16_t index);

uint8_t *objects_value(const struct objects *objects, const struct object *object);

/** Resets all values to those at power-on. */
void objects_reset(struct objects *objects);

void objects_free(struct objects *objects);

#endif
