#include "control/jobs/job.h"

#include "live/fsoe_objects.h"
#include "plan/plan_internal.h"

struct range {
    uint16_t from, to; /**< both inclusive */
    const char *why;
};

/** For every SubDevice. */
static const struct range always[] = {
    {0xE000, 0xEFFF, "it belongs to a safety module: its project and its own tool write it"},
    {0xF980, 0xF98F, "it is an FSoE address: set it at the device or with its maker's tool"},
};

/** While the bus runs, for every SubDevice. */
static const struct range running[] = {
    {0x1600, 0x1BFF, "it maps process data, which the plan fixes while the bus runs"},
    {0x1C00, 0x1C3F, "it sets up a sync manager, which the plan fixes while the bus runs"},
};

/** For SubDevices with FSoE frames. */
static const struct range safety[] = {
    {0x1011, 0x1011, "it would restore parameters of a SubDevice with a safety connection"},
    {0x1600, 0x1BFF, "it maps process data of a SubDevice with a safety connection"},
    {0x1C00, 0x1C3F, "it assigns process data of a SubDevice with a safety connection"},
    {0x6600, 0x67FF, "it is a safety object of a drive"},
};

static const char *find(const struct range *ranges, size_t count, uint16_t index) {
    for (size_t i = 0; i < count; i++) {
        if (index >= ranges[i].from && index <= ranges[i].to) {
            return ranges[i].why;
        }
    }
    return NULL;
}

/** Whether it is an end of a connection, or its process data contains an FSoE frame. */
static bool carries_safety(const struct fsn_plan *plan, uint32_t subdevice) {
    struct fsn_connection_info c;
    for (uint32_t i = 0; fsn_plan_connection(plan, i, &c) == FSN_OK; i++) {
        if (c.main_subdevice == subdevice || c.sub_subdevice == subdevice) {
            return true;
        }
    }
    struct fsn_block_info block;
    for (uint32_t i = 0; fsn_plan_block(plan, i, &block) == FSN_OK; i++) {
        if (fsn_known_sm(plan, block.sm).subdevice == subdevice) {
            return true;
        }
    }
    return false;
}

/** Whether an entry with this index is between two bits of a sync manager. */
static bool is_between(const struct fsn_plan *plan, uint32_t sm, uint16_t index, uint32_t from,
                       uint32_t to) {
    uint32_t behind;
    for (uint32_t e = fsn_sm_entries(plan, sm, &behind); e < behind; e++) {
        const struct fsn_entry_record entry = fsn_read_entry(plan, e);
        if (entry.index == index && entry.bit_offset >= from && entry.bit_offset < to) {
            return true;
        }
    }
    return false;
}

/** Whether an object contains parameters, information or diagnosis (0x8nnx to 0xAnnx) of the module
 *  whose frame, at a byte of a sync manager, is mapped from 0x6nnx or 0x7nnx. */
static bool is_of_module(const struct fsn_plan *plan, const struct fsn_block_info *frame,
                         uint16_t index) {
    const uint16_t parameters =
        fsn_parameter_object(fsn_object_at(plan, frame->sm, 8 * frame->byte_offset));
    return parameters >> 12 == 9 && index >> 12 >= 8 && index >> 12 <= 0xA &&
           (index & 0xFF0) == (parameters & 0xFF0);
}

/** Relation of an object to the FSoE frames of a SubDevice; NULL: none. */
static const char *find_in_frames(const struct fsn_plan *plan, uint32_t subdevice, uint16_t index) {
    struct fsn_block_info frame;
    for (uint32_t i = 0; fsn_plan_block(plan, i, &frame) == FSN_OK; i++) {
        if (fsn_known_sm(plan, frame.sm).subdevice != subdevice) {
            continue;
        }
        if (is_between(plan, frame.sm, index, 8 * frame.byte_offset,
                       8 * (frame.byte_offset + frame.frame_bytes))) {
            return "it is mapped into an FSoE frame";
        }
        if (is_of_module(plan, &frame, index)) {
            return "it belongs to the module of an FSoE frame: its project and its own tool write "
                   "it";
        }
    }
    return NULL;
}

const char *fsn_guard_write(const struct fsn_plan *plan, uint32_t subdevice, uint16_t index,
                            bool bus_runs) {
    const char *why = find(always, sizeof always / sizeof always[0], index);
    if (why == NULL && carries_safety(plan, subdevice)) {
        why = find(safety, sizeof safety / sizeof safety[0], index);
    }
    if (why == NULL && index != 0) {
        why = find_in_frames(plan, subdevice, index);
    }
    if (why == NULL && bus_runs) {
        why = find(running, sizeof running / sizeof running[0], index);
    }
    return why;
}
