#include "live/frames.h"

#include <stdlib.h>
#include <string.h>

#include "live/port.h"
#include "rt/prefault.h"

enum {
    CMD_LRW = 12,
    DATAGRAM_HEAD = 10,
    DATAGRAM_TAIL = 2,
    DC_TIME = 0x0910,
    DC_BYTES = 8,
    DC_DATAGRAM = DATAGRAM_HEAD + DC_BYTES + DATAGRAM_TAIL,
    DC_SET_BYTES = 4, /**< number of bytes that a clock compares */
    DC_SET_DATAGRAM = DATAGRAM_HEAD + DC_SET_BYTES + DATAGRAM_TAIL,
    MORE = 0x8000,
};

static void write_head(struct fsn_wire_frame *frame) {
    /* Broadcast, from a locally administered address; EtherCAT ignores both. */
    static const uint8_t ethernet[] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x02,
                                       0x46, 0x53, 0x4E, 0x00, 0x01, 0x88, 0xA4};
    memcpy(frame->sent, ethernet, sizeof ethernet);
    fsn_put16(frame->sent + 14, (frame->len_bytes - 16) | 0x1000);
    fsn_put16(frame->sent + FSN_WIRE_NOP + 6, FSN_WIRE_MARK_BYTES | MORE);
}

/** Fills one frame; its position in the image is already known. */
static void build(struct fsn_wire_frame *frame, uint32_t logical, bool with_dc, bool dc_host) {
    const uint32_t lrw_end = FSN_WIRE_DATA + frame->size_bytes + DATAGRAM_TAIL;
    const uint32_t set_bytes = with_dc && dc_host ? DC_SET_DATAGRAM : 0;
    frame->len_bytes = lrw_end + set_bytes + (with_dc ? DC_DATAGRAM : 0);
    write_head(frame);
    uint8_t *lrw = frame->sent + FSN_WIRE_LRW;
    lrw[0] = CMD_LRW;
    fsn_put32(lrw + 2, logical);
    fsn_put16(lrw + 6, frame->size_bytes | (with_dc ? MORE : 0));
    if (set_bytes > 0) {
        frame->dc_set = lrw_end;
        fsn_put16(frame->sent + lrw_end + 4, DC_TIME);
        fsn_put16(frame->sent + lrw_end + 6, DC_SET_BYTES | MORE);
    }
    if (with_dc) {
        frame->dc = lrw_end + set_bytes;
        fsn_put16(frame->sent + frame->dc + 4, DC_TIME);
        fsn_put16(frame->sent + frame->dc + 6, DC_BYTES);
    }
}

/** Inputs of the plan in the order of the image. */
static bool list_inputs(const struct fsn_plan *plan, struct fsn_frames *frames) {
    struct fsn_wire *wire = &frames->wire;
    const uint32_t sms = plan->count[FSN_SEC_SM];
    if (!FSN_NEW_PREFAULTED(wire->inputs, sms)) {
        return false;
    }
    uint32_t count = 0;
    for (uint32_t d = 0; d < frames->image.datagram_count; d++) {
        struct fsn_wire_frame *frame = &wire->frames[d];
        frame->first_input = count;
        for (uint32_t sm = 0; sm < sms; sm++) {
            const struct fsn_sm_info info = fsn_known_sm(plan, sm);
            if (frames->image.sm_base[sm] == FSN_NONE || frames->image.sm_datagram[sm] != d ||
                info.direction != FSN_INPUT) {
                continue;
            }
            wire->inputs[count++] = (struct fsn_wire_input){
                .sm = sm,
                .subdevice = info.subdevice,
                .group = fsn_plan_group_of(plan, info.subdevice),
                .image_byte = frames->image.sm_base[sm],
                .frame_byte = FSN_WIRE_DATA + frames->image.sm_base[sm] - frame->image_byte,
                .size_bytes = info.size_bytes,
            };
        }
        frame->input_count = count - frame->first_input;
    }
    return true;
}

/** Share of each group in the working counter of each datagram. */
static bool list_groups(const struct fsn_plan *plan, struct fsn_frames *frames) {
    struct fsn_wire *wire = &frames->wire;
    const uint32_t count = fsn_plan_group_count(plan);
    const uint32_t datagrams = frames->image.datagram_count;
    if (!FSN_NEW_PREFAULTED(wire->groups, count) ||
        !FSN_NEW_PREFAULTED(frames->group_wkc, (size_t)count * datagrams)) {
        return false;
    }
    wire->group_count = count;
    for (uint32_t g = 0; g < count; g++) {
        wire->groups[g].wkc = frames->group_wkc + (size_t)g * datagrams;
    }
    for (uint32_t sm = 0; sm < plan->count[FSN_SEC_SM]; sm++) {
        const uint32_t group = fsn_plan_group_of(plan, fsn_known_sm(plan, sm).subdevice);
        if (group != FSN_NONE) {
            wire->groups[group].wkc[frames->image.sm_datagram[sm]] +=
                fsn_image_wkc(plan, &frames->image, sm);
        }
    }
    return true;
}

/** Places the datagrams of the image, and determines the frame that carries the DC time: the last
 *  one with room, or a further one. Returns its number, or the number of frames without DC. */
static uint32_t place(struct fsn_frames *frames, bool with_dc, bool dc_host) {
    const uint32_t dc_bytes = DC_DATAGRAM + (dc_host ? DC_SET_DATAGRAM : 0);
    struct fsn_wire *wire = &frames->wire;
    const struct fsn_image *image = &frames->image;
    uint32_t dc_frame = FSN_NONE;
    for (uint32_t d = 0; d < image->datagram_count; d++) {
        const uint32_t begin = image->datagram_begin[d];
        const uint32_t end =
            d + 1 < image->datagram_count ? image->datagram_begin[d + 1] : image->bytes;
        struct fsn_wire_frame *frame = &wire->frames[d];
        frame->image_byte = begin;
        /* An LRW without data is not a valid datagram for a SubDevice controller. */
        frame->size_bytes = end > begin ? end - begin : 1;
        frame->expected = image->expected[d];
        if (frame->size_bytes + dc_bytes <= FSN_WIRE_LRW_BYTES) {
            dc_frame = d;
        }
    }
    wire->frame_count = image->datagram_count;
    if (with_dc && dc_frame == FSN_NONE) {
        dc_frame = wire->frame_count++;
        wire->frames[dc_frame].size_bytes = 1;
    }
    return with_dc ? dc_frame : FSN_NONE;
}

fsn_status fsn_frames_create(const struct fsn_plan *plan, uint16_t dc_station, bool dc_host,
                             struct fsn_frames *frames) {
    *frames = (struct fsn_frames){.wire.sockets = {-1, -1}};
    FSN_TRY(fsn_image_create(plan, FSN_WIRE_LRW_BYTES, &frames->image));
    struct fsn_wire *wire = &frames->wire;
    const uint32_t datagrams = frames->image.datagram_count;
    if (!FSN_NEW_PREFAULTED(frames->bytes, frames->image.bytes) ||
        !FSN_NEW_PREFAULTED(wire->frames, datagrams) ||
        !FSN_NEW_PREFAULTED(wire->answers, plan->count[FSN_SEC_SUBDEVICE])) {
        return FSN_E_NOMEM;
    }
    wire->image = frames->bytes;
    wire->datagram_count = datagrams;
    atomic_init(&wire->dc_station, dc_station);
    const uint32_t dc_frame = place(frames, dc_station != 0, dc_host);
    if (wire->frame_count > FSN_WIRE_FRAMES) {
        return FSN_E_BUS_IMAGE;
    }
    frames->storage = fsn_calloc_prefaulted(wire->frame_count, (size_t)3 * FSN_WIRE_MOST);
    if (frames->storage == NULL || !list_inputs(plan, frames) || !list_groups(plan, frames)) {
        return FSN_E_NOMEM;
    }
    for (uint32_t f = 0; f < wire->frame_count; f++) {
        /* A datagram without process data uses an address that is not mapped. */
        const uint32_t logical =
            f < datagrams ? wire->frames[f].image_byte : frames->image.bytes + 1;
        struct fsn_wire_frame *frame = &wire->frames[f];
        frame->sent = frames->storage + (size_t)3 * FSN_WIRE_MOST * f;
        frame->reply[0] = frame->sent + FSN_WIRE_MOST;
        frame->reply[1] = frame->reply[0] + FSN_WIRE_MOST;
        build(frame, logical, f == dc_frame, dc_host);
    }
    return FSN_OK;
}

void fsn_frames_sign(struct fsn_frames *frames, uint16_t tag) {
    for (uint32_t f = 0; f < frames->wire.frame_count; f++) {
        uint8_t *at = frames->wire.frames[f].sent + FSN_PORT_TAG;
        at[0] = (uint8_t)(tag >> 8);
        at[1] = (uint8_t)tag;
    }
}

void fsn_frames_free(struct fsn_frames *frames) {
    struct fsn_wire *wire = &frames->wire;
    free(frames->storage);
    free(wire->frames);
    free(wire->inputs);
    free(wire->groups);
    free(frames->group_wkc);
    free((void *)wire->answers);
    free(frames->bytes);
    fsn_image_free(&frames->image);
    *frames = (struct fsn_frames){.wire.sockets = {-1, -1}};
}
