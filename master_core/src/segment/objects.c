#include "segment/esc.h"

#include <stdlib.h>
#include <string.h>

static bool grow(void **memory, uint32_t *room, uint32_t needed, size_t element_bytes) {
    if (needed <= *room) {
        return true;
    }
    uint32_t more = *room == 0 ? 64 : *room;
    while (more < needed) {
        more *= 2;
    }
    void *larger = realloc(*memory, more * element_bytes);
    if (larger == NULL) {
        return false;
    }
    *memory = larger;
    *room = more;
    return true;
}

void objects_add(struct objects *o, uint16_t index, uint8_t sub, bool writable, const void *value,
                 uint32_t size_bytes) {
    if (o->failed || objects_find(o, index, sub) != NULL) {
        return; /* duplicate: the first one counts */
    }
    uint32_t room = o->value_room;
    if (!grow((void **)&o->rows, &o->room, o->count + 1, sizeof *o->rows) ||
        !grow((void **)&o->values, &room, o->value_bytes + size_bytes, 1) ||
        !grow((void **)&o->initial, &o->value_room, o->value_bytes + size_bytes, 1)) {
        o->failed = true;
        return;
    }
    o->rows[o->count++] = (struct object){
        .index = index,
        .sub = sub,
        .writable = writable,
        .size_bytes = size_bytes,
        .at = o->value_bytes,
    };
    memcpy(o->initial + o->value_bytes, value, size_bytes);
    memcpy(o->values + o->value_bytes, value, size_bytes);
    o->value_bytes += size_bytes;
}

void objects_add_number(struct objects *o, uint16_t index, uint8_t sub, bool writable,
                        uint32_t value, uint32_t size_bytes) {
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16),
                              (uint8_t)(value >> 24)};
    objects_add(o, index, sub, writable, bytes, size_bytes);
}

const struct object *objects_find(const struct objects *o, uint16_t index, uint8_t sub) {
    for (uint32_t i = 0; i < o->count; i++) {
        if (o->rows[i].index == index && o->rows[i].sub == sub) {
            return &o->rows[i];
        }
    }
    return NULL;
}

bool objects_has(const struct objects *o, uint16_t index) {
    for (uint32_t i = 0; i < o->count; i++) {
        if (o->rows[i].index == index) {
            return true;
        }
    }
    return false;
}

uint8_t *objects_value(const struct objects *o, const struct object *object) {
    return o->values + object->at;
}

bool objects_put(struct objects *o, uint16_t index, uint8_t sub, bool writable, const void *value,
                 uint32_t size_bytes) {
    const struct object *object = objects_find(o, index, sub);
    if (object == NULL) {
        objects_add(o, index, sub, writable, value, size_bytes);
        const bool ok = !o->failed;
        o->failed = false; /* the others are complete */
        return ok;
    }
    if (object->size_bytes != size_bytes) {
        return false;
    }
    memcpy(o->values + object->at, value, size_bytes);
    memcpy(o->initial + object->at, value, size_bytes);
    return true;
}

void objects_reset(struct objects *o) {
    if (o->value_bytes > 0) {
        memcpy(o->values, o->initial, o->value_bytes);
    }
}

void objects_free(struct objects *o) {
    free(o->rows);
    free(o->values);
    free(o->initial);
    *o = (struct objects){0};
}
