#include "control/outputs/outputs.h"

#include <stdlib.h>
#include <string.h>

#include "plan/plan_internal.h"

struct output {
    struct fsn_symbol_info info;
    bool copied;          /**< a copy writes one of its bytes */
    uint32_t owner;       /**< client, or FSN_NOBODY */
    uint64_t value;       /**< last written value */
    uint32_t armed;       /**< client, or FSN_NOBODY */
    uint64_t armed_until; /**< monotonic, nanoseconds */
};

/** A symbol, to be found by its name and direction. */
struct named {
    const char *name;
    bool output;
    uint32_t symbol;
};

struct fsn_outputs {
    struct output *output;
    struct named *by_name; /**< sorted */
    uint32_t count;
    struct fsn_core *core; /**< NULL: none */
    bool closed;           /**< a stop is in progress */
    /* Outputs to be written together. */
    uint32_t *noted;
    uint64_t *noted_raw;
    size_t noted_count;
};

static int compare_names(const void *left, const void *right) {
    const struct named *a = left;
    const struct named *b = right;
    const int order = strcmp(a->name, b->name);
    return order != 0 ? order : (int)a->output - (int)b->output;
}

struct fsn_outputs *fsn_outputs_create(const struct fsn_plan *plan) {
    struct fsn_outputs *o = calloc(1, sizeof *o);
    if (o == NULL) {
        return NULL;
    }
    o->count = fsn_plan_symbol_count(plan);
    if (!FSN_NEW(o->output, o->count) || !FSN_NEW(o->by_name, o->count) ||
        !FSN_NEW(o->noted, o->count) || !FSN_NEW(o->noted_raw, o->count)) {
        fsn_outputs_free(o);
        return NULL;
    }
    for (uint32_t i = 0; i < o->count; i++) {
        o->output[i].info = fsn_known_symbol(plan, i);
        o->output[i].copied = fsn_is_copied(plan, &o->output[i].info);
        const struct fsn_symbol_info *info = &o->output[i].info;
        o->by_name[i] = (struct named){info->name, info->output != 0, i};
    }
    qsort(o->by_name, o->count, sizeof *o->by_name, compare_names);
    return o;
}

void fsn_outputs_free(struct fsn_outputs *outputs) {
    if (outputs != NULL) {
        free(outputs->output);
        free(outputs->by_name);
        free(outputs->noted);
        free(outputs->noted_raw);
        free(outputs);
    }
}

static bool has_place(const struct fsn_outputs *o, uint32_t symbol) {
    return o->core != NULL && fsn_core_sm_base(o->core, o->output[symbol].info.sm) != FSN_NONE;
}

/** Stores a value for the next write_noted(); a closed output keeps its value. */
static void note(struct fsn_outputs *o, uint32_t symbol, uint64_t raw) {
    if (fsn_core_is_open(o->core, symbol)) {
        o->noted[o->noted_count] = symbol;
        o->noted_raw[o->noted_count++] = raw;
    }
}

/** Writes the stored values, all in one cycle. The core refuses only closed outputs. */
static void write_noted(struct fsn_outputs *o) {
    if (o->noted_count > 0 &&
        fsn_core_set_outputs(o->core, o->noted_count, o->noted, o->noted_raw) == FSN_OK) {
        for (size_t i = 0; i < o->noted_count; i++) {
            o->output[o->noted[i]].value = o->noted_raw[i];
        }
    }
    o->noted_count = 0;
}

void fsn_outputs_attach(struct fsn_outputs *outputs, struct fsn_core *core) {
    outputs->core = core;
    outputs->closed = false;
    for (uint32_t i = 0; i < outputs->count; i++) {
        struct output *output = &outputs->output[i];
        output->owner = FSN_NOBODY;
        output->armed = FSN_NOBODY;
        output->value = 0; /* the initial value in the core */
        if (output->info.stop_value != 0) {
            note(outputs, i, output->info.stop_value);
        }
    }
    write_noted(outputs);
}

static bool fall_back(struct fsn_outputs *o, uint32_t symbol, fsn_fallback_fn fallback,
                      void *self) {
    struct output *output = &o->output[symbol];
    if (output->owner == FSN_NOBODY) {
        return false;
    }
    output->owner = FSN_NOBODY;
    note(o, symbol, output->info.stop_value);
    if (fallback != NULL) {
        fallback(self, symbol);
    }
    return true;
}

void fsn_outputs_close(struct fsn_outputs *outputs, fsn_fallback_fn fallback, void *self) {
    outputs->closed = true;
    for (uint32_t i = 0; i < outputs->count; i++) {
        outputs->output[i].armed = FSN_NOBODY;
        fall_back(outputs, i, fallback, self);
    }
    write_noted(outputs);
}

uint32_t fsn_outputs_find(const struct fsn_outputs *outputs, const char *name, bool output) {
    const struct named wanted = {name, output, FSN_NONE};
    const struct named *found =
        bsearch(&wanted, outputs->by_name, outputs->count, sizeof wanted, compare_names);
    return found != NULL ? found->symbol : FSN_NONE;
}

struct fsn_output_state fsn_outputs_state(const struct fsn_outputs *outputs, uint32_t symbol) {
    const struct output *output = &outputs->output[symbol];
    return (struct fsn_output_state){output->owner, output->armed,
                                     fsn_core_is_open(outputs->core, symbol)};
}

/** Common rules of writing and arming. */
static fsn_status check_open(const struct fsn_outputs *o, uint32_t symbol, uint32_t client,
                             struct fsn_refusal *refusal) {
    const struct output *output = &o->output[symbol];
    const char *name = output->info.name;
    if (o->core == NULL) {
        return fsn_refusal_set(refusal, FSN_E_STATE, "send start first", "the bus is stopped");
    }
    if (o->closed) {
        return fsn_refusal_set(refusal, FSN_E_STATE, NULL, "the bus is being stopped");
    }
    if (output->info.output == 0) {
        return fsn_refusal_set(refusal, FSN_E_CLOSED, "get reads it", "%.120s is an input", name);
    }
    if (output->copied) {
        return fsn_refusal_set(refusal, FSN_E_CLOSED, "the transfers of the network write it",
                               "%.120s belongs to a copy", name);
    }
    if (!has_place(o, symbol)) {
        return fsn_refusal_set(refusal, FSN_E_CLOSED, NULL,
                               "%.120s has no place in the process image", name);
    }
    if (!fsn_core_is_open(o->core, symbol)) { /* GCOVR_EXCL_START: no plan that is loaded has such
                                               * a symbol; a second lock before safety frames */
        return fsn_refusal_set(refusal, FSN_E_CLOSED, "only the ends of a connection write it",
                               "%.120s belongs to an FSoE frame", name);
    } /* GCOVR_EXCL_STOP */
    if (output->owner != FSN_NOBODY && output->owner != client) {
        return fsn_refusal_set(
            refusal, FSN_E_CLOSED,
            "one client at a time; it is free when that client goes or is silent",
            "%.120s is written by client %u", name, (unsigned)output->owner);
    }
    return FSN_OK;
}

fsn_status fsn_outputs_check(const struct fsn_outputs *outputs, uint32_t symbol, uint32_t client,
                             uint64_t raw, uint64_t now_ns, struct fsn_refusal *refusal) {
    const struct output *output = &outputs->output[symbol];
    FSN_TRY(check_open(outputs, symbol, client, refusal));
    const bool edge = raw != output->value && raw != output->info.stop_value;
    const bool armed = output->armed == client && now_ns < output->armed_until;
    if (output->info.restart_relevant != 0 && edge && !armed) {
        return fsn_refusal_set(refusal, FSN_E_CLOSED, "arm it first; that allows one edge",
                               "%.120s can restart a machine and is not armed", output->info.name);
    }
    return FSN_OK;
}

void fsn_outputs_write(struct fsn_outputs *outputs, uint32_t client, struct fsn_wanted *wanted,
                       size_t count) {
    for (size_t i = 0; i < count; i++) {
        struct fsn_wanted *w = &wanted[i];
        struct output *output = &outputs->output[w->symbol];
        w->edge = output->info.restart_relevant != 0 && w->raw != output->value;
        if (w->edge && w->raw != output->info.stop_value) {
            output->armed = FSN_NOBODY;
        }
        output->owner = client;
        note(outputs, w->symbol, w->raw);
    }
    write_noted(outputs);
}

fsn_status fsn_outputs_arm(struct fsn_outputs *outputs, uint32_t symbol, uint32_t client,
                           uint64_t now_ns, struct fsn_refusal *refusal) {
    struct output *output = &outputs->output[symbol];
    FSN_TRY(check_open(outputs, symbol, client, refusal));
    if (output->info.restart_relevant == 0) {
        return fsn_refusal_set(refusal, FSN_E_ARG, "set writes it",
                               "%.120s is not restart relevant and needs no arming",
                               output->info.name);
    }
    if (output->armed != FSN_NOBODY && output->armed != client && now_ns < output->armed_until) {
        return fsn_refusal_set(refusal, FSN_E_CLOSED, NULL, "%.120s is armed by client %u",
                               output->info.name, (unsigned)output->armed);
    }
    output->armed = client;
    output->armed_until = now_ns + FSN_ARM_MS * UINT64_C(1000000);
    return FSN_OK;
}

bool fsn_outputs_has(const struct fsn_outputs *outputs, uint32_t client) {
    for (uint32_t i = 0; i < outputs->count; i++) {
        if (outputs->output[i].owner == client || outputs->output[i].armed == client) {
            return true;
        }
    }
    return false;
}

size_t fsn_outputs_take_back(struct fsn_outputs *outputs, uint32_t client, fsn_fallback_fn fallback,
                             void *self) {
    size_t taken = 0;
    for (uint32_t i = 0; i < outputs->count; i++) {
        struct output *output = &outputs->output[i];
        if (output->armed == client) {
            output->armed = FSN_NOBODY;
        }
        if (output->owner == client) {
            taken += fall_back(outputs, i, fallback, self);
        }
    }
    write_noted(outputs);
    return taken;
}
