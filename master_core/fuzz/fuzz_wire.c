/** Fuzz target: the cyclic wire against packets of any kind. Fits libFuzzer and driver.c.
 *
 *  The input is a script: send a cycle, give back its frame with bytes changed, give back an older
 *  one, give in any bytes at all, receive. Whatever comes, outputs stay ours, an input is whole
 * from one reply to a frame of this cycle or what it was, and an old reply never counts. */
#include "fuzz.h"

#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "live/frames.h"

uint64_t fuzz_reached;

enum { MOST = 1600, OLD = 8, STEPS = 64 };

struct rig {
    struct fsn_frames frames;
    int far;
    uint8_t old[OLD][MOST]; /**< frames as sent, by cycle modulo OLD */
    size_t len_bytes;
    uint8_t marks[STEPS][FSN_WIRE_MARK_BYTES]; /**< of the packets given in */
    uint32_t given;
};

static const struct fsn_plan *the_plan(void) {
    static struct fsn_plan *plan;
    if (plan == NULL) {
        size_t len;
        uint8_t *bytes = build_estop(&len);
        CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
        free(bytes);
    }
    return plan;
}

/** Every input begins from the start: a finding is repeated by that input alone. */
static struct rig *make_rig(void) {
    struct rig *rig = calloc(1, sizeof *rig);
    CHECK(rig != NULL);
    CHECK(fsn_frames_create(the_plan(), 0x1001, true, &rig->frames) == FSN_OK);
    int pair[2];
    CHECK(socketpair(AF_UNIX, SOCK_SEQPACKET, 0, pair) == 0);
    rig->frames.wire.sockets[0] = pair[0];
    rig->far = pair[1];
    rig->frames.wire.run = 0x46534E31;
    rig->frames.wire.dc_every = 2;
    return rig;
}

static void free_rig(struct rig *rig) {
    close(rig->frames.wire.sockets[0]);
    close(rig->far);
    fsn_frames_free(&rig->frames);
    free(rig);
}

static void send_cycle(struct rig *rig) {
    fsn_wire_send(&rig->frames.wire);
    uint8_t *frame = rig->old[rig->frames.wire.cycle % OLD];
    const ssize_t got = recv(rig->far, frame, MOST, MSG_DONTWAIT);
    rig->len_bytes = got > 0 ? (size_t)got : 0;
}

static void give(struct rig *rig, const uint8_t *packet, size_t len_bytes) {
    if (len_bytes > 0 && send(rig->far, packet, len_bytes, MSG_DONTWAIT) > 0 &&
        len_bytes >= FSN_WIRE_MARK + FSN_WIRE_MARK_BYTES) {
        memcpy(rig->marks[rig->given++], packet + FSN_WIRE_MARK, FSN_WIRE_MARK_BYTES);
    }
}

/** Whether a packet named this run and this cycle: damage may make one of an older frame. */
static bool named(const struct rig *rig) {
    const uint8_t *sent = rig->frames.wire.frames[0].sent + FSN_WIRE_MARK;
    for (uint32_t i = 0; i < rig->given; i++) {
        if (memcmp(rig->marks[i], sent, FSN_WIRE_MARK_BYTES) == 0) {
            return true;
        }
    }
    return false;
}

/** A frame of this cycle, or of `back` cycles ago, with some bytes changed. */
static void answer(struct rig *rig, struct input *in, uint32_t back) {
    uint8_t reply[MOST];
    memcpy(reply, rig->old[(rig->frames.wire.cycle - back) % OLD], MOST);
    size_t len = rig->len_bytes;
    for (unsigned n = input_byte(in) % 8; n > 0 && len > 0; n--) {
        const size_t at = input_word(in) % len;
        reply[at] = input_byte(in);
    }
    if (input_byte(in) > 240) {
        len = input_word(in) % MOST;
    }
    give(rig, reply, len);
}

static void any_bytes(struct rig *rig, struct input *in) {
    uint8_t packet[MOST] = {0};
    const size_t len = 1 + input_word(in) % (MOST - 1);
    for (size_t i = 0; i < len && in->left > 0; i++) {
        packet[i] = input_byte(in);
    }
    give(rig, packet, len);
}

static void receive(struct rig *rig) {
    uint8_t before[256];
    struct fsn_wkc wkc[4] = {{0}};
    uint8_t stale[8] = {0};
    struct fsn_bus_input input = {.wkc = wkc, .sm_stale = stale};
    const struct fsn_frames *f = &rig->frames;
    CHECK(f->image.bytes <= sizeof before && f->wire.frame_count == 1);
    memcpy(before, f->bytes, f->image.bytes);
    fsn_wire_receive(&rig->frames.wire, &input);
    const struct fsn_wire_frame *frame = &f->wire.frames[0];
    CHECK(named(rig) || !frame->back[0]); /* no reply but one to the frame of this cycle */
    CHECK(input.counts.lost_frames == (f->wire.cycle != 0 && !frame->back[0]));
    for (uint32_t i = 0; i < frame->input_count; i++) {
        const struct fsn_wire_input *in = &f->wire.inputs[i];
        const bool kept =
            memcmp(f->bytes + in->image_byte, before + in->image_byte, in->size_bytes) == 0;
        CHECK(kept ||
              (frame->back[0] && memcmp(f->bytes + in->image_byte, frame->reply[0] + in->frame_byte,
                                        in->size_bytes) == 0));
        memcpy(before + in->image_byte, f->bytes + in->image_byte, in->size_bytes);
    }
    CHECK(memcmp(before, f->bytes, f->image.bytes) == 0); /* outputs, and all between */
    fuzz_reached += frame->back[0];
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct rig *rig = make_rig();
    struct input in = {data, size};
    send_cycle(rig);
    for (int step = 0; step < STEPS && in.left > 0; step++) {
        const uint8_t what = input_byte(&in);
        switch (what % 8) {
        case 0:
        case 1:
            send_cycle(rig);
            break;
        case 2:
        case 3:
        case 4:
            answer(rig, &in, 0);
            break;
        case 5:
            answer(rig, &in, 1 + what / 8 % (OLD - 1));
            break;
        case 6:
            any_bytes(rig, &in);
            break;
        default:
            receive(rig);
            break;
        }
    }
    receive(rig);
    free_rig(rig);
    return 0;
}
