/** An axis of a client in the cycle: its objects among the symbols, and its values in each
 *  cycle. */
#include <stdio.h>
#include <string.h>

#include "client/axis_own.h"
#include "fsn/client.h"

enum { AXES = 8, AXIS_STEP = 0x800, MODE_OBJECT = 0x6060 };

/** An object of an axis. */
struct object {
    uint16_t index; /**< of axis 0 */
    uint8_t bits;
    bool output;
    size_t at; /**< in struct fsn_axis_symbols */
};

#define OBJECT(index, bits, output, name)                                                          \
    {index, bits, output, offsetof(struct fsn_axis_symbols, name)}

static const struct object objects[] = {
    OBJECT(0x6041, 16, false, statusword),      OBJECT(0x6061, 8, false, mode_display),
    OBJECT(0x6064, 32, false, actual_position), OBJECT(0x606C, 32, false, actual_velocity),
    OBJECT(0x6077, 16, false, actual_torque),   OBJECT(0x6040, 16, true, controlword),
    OBJECT(MODE_OBJECT, 8, true, mode),         OBJECT(0x607A, 32, true, target_position),
    OBJECT(0x60FF, 32, true, target_velocity),  OBJECT(0x6071, 16, true, target_torque),
};

/** The object to find, and the fault to fill. */
struct search {
    const struct fsn_realtime *realtime;
    const struct fsn_axis_options *options;
    struct fsn_axis_symbols *symbols;
    struct fsn_realtime_fault *fault;
};

static fsn_status refuse(const struct search *search, fsn_status status, const char *text) {
    if (search->fault != NULL) {
        *search->fault = (struct fsn_realtime_fault){.status = status};
        snprintf(search->fault->text, sizeof search->fault->text, "axis %u of %.100s: %.350s",
                 (unsigned)search->options->number, search->options->subdevice, text);
    }
    return status;
}

static int32_t *place_of(const struct search *search, const struct object *object) {
    return (int32_t *)(void *)((char *)search->symbols + object->at);
}

static uint16_t index_of(const struct search *search, const struct object *object) {
    return (uint16_t)(object->index + AXIS_STEP * search->options->number);
}

/** Finds one object; a missing object is not an error yet. */
static fsn_status find(const struct search *search, const struct object *object) {
    const uint16_t index = index_of(search, object);
    int32_t *place = place_of(search, object);
    struct fsn_realtime_symbol info;
    char text[260];
    *place = FSN_REALTIME_NONE;
    for (uint32_t i = 0; fsn_realtime_symbol(search->realtime, i, &info) == FSN_OK; i++) {
        if (info.index != index || info.subindex != 0 || info.output != object->output ||
            info.bits == 0 || strcmp(info.subdevice, search->options->subdevice) != 0) {
            continue;
        }
        if (info.bits != object->bits) {
            snprintf(text, sizeof text, "%.120s has %u bits, 0x%04x has %u", info.name,
                     (unsigned)info.bits, (unsigned)index, (unsigned)object->bits);
            return refuse(search, FSN_E_ARG, text);
        }
        if (info.output && !info.owned) {
            snprintf(text, sizeof text,
                     "%.120s is not an output of this client: open it with that name, or with "
                     "%.60s.*",
                     info.name, search->options->subdevice);
            return refuse(search, FSN_E_CLOSED, text);
        }
        *place = (int32_t)i;
        return FSN_OK;
    }
    return FSN_OK;
}

/** Refuses if an object is not mapped. */
static fsn_status need(const struct search *search, uint16_t index, const char *why) {
    for (size_t i = 0; i < sizeof objects / sizeof objects[0]; i++) {
        if (objects[i].index == index && *place_of(search, &objects[i]) == FSN_REALTIME_NONE) {
            char text[260];
            snprintf(text, sizeof text, "0x%04x is not mapped as an %s: %.100s",
                     (unsigned)index_of(search, &objects[i]),
                     objects[i].output ? "output" : "input", why);
            return refuse(search, FSN_E_ARG, text);
        }
    }
    return FSN_OK;
}

/** The object with the target of a mode; 0 if there is none. */
static uint16_t target_of(int mode) {
    switch (mode) {
    case FSN_AXIS_PP:
    case FSN_AXIS_CSP:
        return 0x607A;
    case FSN_AXIS_PV:
    case FSN_AXIS_CSV:
        return 0x60FF;
    case FSN_AXIS_CST:
        return 0x6071;
    default:
        return 0;
    }
}

static fsn_status need_all(const struct search *search) {
    const struct fsn_axis_symbols *found = search->symbols;
    const uint16_t target = target_of(search->options->config.mode);
    fsn_status status = need(search, 0x6040, "unknown axis");
    if (status == FSN_OK) {
        status = need(search, 0x6041, "the state of the drive is not visible");
    }
    if (status == FSN_OK && target != 0) {
        status = need(search, target, "the mode takes its target from there");
    }
    if (status == FSN_OK && found->target_position != FSN_REALTIME_NONE) {
        status = need(search, 0x6064, "the first target is the position of the axis");
    }
    if (status == FSN_OK && found->mode != FSN_REALTIME_NONE) {
        status = need(search, 0x6061, "the mode that the drive has taken is not visible");
    }
    return status;
}

/** Modes that are supported by the mapped objects. */
static uint16_t mapped_modes(const struct search *search) {
    const struct fsn_axis_symbols *found = search->symbols;
    const uint16_t wanted = search->options->config.modes;
    uint16_t modes = 0;
    for (int mode = FSN_AXIS_PP; mode <= FSN_AXIS_CST; mode++) {
        const uint16_t target = target_of(mode);
        const bool has = target == 0 ||
                         (target == 0x607A && found->target_position != FSN_REALTIME_NONE) ||
                         (target == 0x60FF && found->target_velocity != FSN_REALTIME_NONE) ||
                         (target == 0x6071 && found->target_torque != FSN_REALTIME_NONE);
        modes |= (uint16_t)(has ? 1 << mode : 0);
    }
    return wanted != 0 ? modes & wanted : modes;
}

static fsn_status find_torque_off(const struct search *search) {
    const char *name = search->options->torque_off;
    search->symbols->torque_off = FSN_REALTIME_NONE;
    if (name == NULL) {
        return FSN_OK;
    }
    search->symbols->torque_off = fsn_realtime_input(search->realtime, name);
    if (search->symbols->torque_off == FSN_REALTIME_NONE || search->options->torque_off_mask == 0) {
        char text[260];
        snprintf(text, sizeof text, "no input %.120s with the bit for STO, or no bit of it", name);
        return refuse(search, FSN_E_ARG, text);
    }
    return FSN_OK;
}

fsn_status fsn_realtime_axis_open(const struct fsn_realtime *realtime,
                                  const struct fsn_axis_options *options,
                                  struct fsn_realtime_axis *axis,
                                  struct fsn_realtime_fault *fault) {
    const struct search search = {realtime, options, &axis->symbols, fault};
    if (options->number >= AXES) {
        return refuse(&search, FSN_E_ARG, "a device has axes 0 to 7");
    }
    fsn_status status = find_torque_off(&search);
    for (size_t i = 0; status == FSN_OK && i < sizeof objects / sizeof objects[0]; i++) {
        status = find(&search, &objects[i]);
    }
    status = status == FSN_OK ? need_all(&search) : status;
    if (status != FSN_OK) {
        return status;
    }
    struct fsn_axis_config config = options->config;
    config.modes = mapped_modes(&search);
    axis->torque_off_mask = options->torque_off_mask;
    axis->torque_off_low = options->torque_off_low;
    if (fsn_axis_init(&axis->axis, &config) != FSN_OK) {
        return refuse(
            &search, FSN_E_ARG,
            "its mode is none of PP, PV, HM, CSP, CSV, CST, the drive does not have it, or "
            "its limit is 0: CSP needs max_step, PV and CSV max_velocity, CST max_torque");
    }
    return FSN_OK;
}

/** The low bits of a value with its sign. */
static int32_t number(const struct fsn_realtime *realtime, int32_t symbol, unsigned bits) {
    const uint32_t raw = (uint32_t)fsn_realtime_get(realtime, symbol);
    const uint32_t sign = UINT32_C(1) << (bits - 1);
    return (int32_t)((int64_t)(raw ^ sign) - (int64_t)sign);
}

static void put(struct fsn_realtime *realtime, int32_t symbol, int32_t value) {
    if (symbol != FSN_REALTIME_NONE) {
        /* Ownership was checked when the axis was opened. */
        const fsn_status done = fsn_realtime_set(realtime, symbol, (uint64_t)(int64_t)value);
        (void)done;
    }
}

void fsn_realtime_axis_step(struct fsn_realtime_axis *axis, struct fsn_realtime *realtime,
                            const struct fsn_realtime_cycle *cycle) {
    const struct fsn_axis_symbols *at = &axis->symbols;
    const bool bit = (fsn_realtime_get(realtime, at->torque_off) & axis->torque_off_mask) != 0;
    const struct fsn_axis_inputs inputs = {
        .now_ns = cycle->now_ns,
        .statusword = (uint16_t)fsn_realtime_get(realtime, at->statusword),
        .mode = at->mode_display != FSN_REALTIME_NONE
                    ? (int8_t)number(realtime, at->mode_display, 8)
                    : axis->axis.config.mode,
        .torque_off = at->torque_off != FSN_REALTIME_NONE && bit != axis->torque_off_low,
        .position = number(realtime, at->actual_position, 32),
        .velocity = number(realtime, at->actual_velocity, 32),
        .torque = (int16_t)number(realtime, at->actual_torque, 16)};
    fsn_axis_step(&axis->axis, &inputs);
    const struct fsn_axis_outputs *out = &axis->axis.outputs;
    put(realtime, at->controlword, out->controlword);
    put(realtime, at->mode, out->mode);
    put(realtime, at->target_position, out->position);
    put(realtime, at->target_velocity, out->velocity);
    put(realtime, at->target_torque, out->torque);
}
