/** The core against a shadow: in each cycle the whole image is compared with one that was made by
 *  the list of transfers alone, also while SubDevices do not answer.
 *
 *  soak_copy COPIES    runs until so many copies were compared; fails at the first difference. */
#define _POSIX_C_SOURCE 200809L

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "builder.h"
#include "fsn/fsn.h"

enum {
    GROUPS = 8, /**< MainInstances */
    SUBS = 8,   /**< of each */
    FRAME = 11,
    SUBDEVICES = GROUPS * (SUBS + 1),
    PAIRS = GROUPS * SUBS,
    IMAGE_BYTES = 2 * FRAME * 2 * PAIRS,
    ABSENT_ONE_IN = 16, /**< SubDevices whose inputs stay as they are, in each cycle */
};

struct soak {
    uint8_t image[IMAGE_BYTES], shadow[IMAGE_BYTES];
    uint32_t base[2 * SUBDEVICES], begin[1];
    struct build_sm sms[SUBDEVICES][2];
    struct build_copy copies[2 * PAIRS];
    uint64_t seed, differing;
};

static uint32_t size_of(const struct soak *s, uint32_t sm) {
    return s->sms[sm / 2][sm % 2].size_bytes;
}

static uint64_t next(struct soak *s) {
    s->seed ^= s->seed << 13;
    s->seed ^= s->seed >> 7;
    s->seed ^= s->seed << 17;
    return s->seed;
}

static fsn_status open_bus(void *bus, const struct fsn_plan *plan, struct fsn_bus_layout *layout,
                           struct fsn_fault *fault) {
    struct soak *s = bus;
    (void)plan;
    (void)fault;
    *layout = (struct fsn_bus_layout){.image = s->image,
                                      .image_bytes = IMAGE_BYTES,
                                      .sm_base = s->base,
                                      .datagram_begin = s->begin,
                                      .datagram_count = 1};
    return FSN_OK;
}

/** New inputs of every SubDevice that answers, in the image and in the shadow. */
static void receive(void *bus, struct fsn_bus_input *input) {
    struct soak *s = bus;
    input->wkc[0] = (struct fsn_wkc){.expected = SUBDEVICES, .actual = SUBDEVICES};
    for (uint32_t sm = 1; sm < 2 * SUBDEVICES; sm += 2) {
        if (next(s) % ABSENT_ONE_IN == 0) {
            input->sm_stale[sm] = 1;
            input->wkc[0].actual--;
            continue;
        }
        for (uint32_t i = 0; i < size_of(s, sm); i += sizeof s->seed) {
            const uint64_t bytes = next(s);
            const uint32_t left = size_of(s, sm) - i;
            const size_t count = left < sizeof bytes ? left : sizeof bytes;
            memcpy(s->image + s->base[sm] + i, &bytes, count);
            memcpy(s->shadow + s->base[sm] + i, &bytes, count);
        }
    }
}

static void send_out(void *bus) {
    struct soak *s = bus;
    for (uint32_t c = 0; c < 2 * PAIRS; c++) {
        const struct build_copy *copy = &s->copies[c];
        memcpy(s->shadow + s->base[2 * copy->to] + copy->destination_byte,
               s->shadow + s->base[2 * copy->from + 1] + copy->source_byte, copy->size_bytes);
    }
    s->differing += memcmp(s->image, s->shadow, IMAGE_BYTES) != 0;
}

/** The subs of each main follow it, with a frame for each. */
static struct fsn_plan *lay_out(struct soak *s) {
    uint32_t at = 0;
    uint32_t pair = 0;
    for (uint32_t d = 0; d < SUBDEVICES; d++) {
        const bool main = d % (SUBS + 1) == 0;
        const uint32_t bytes = main ? SUBS * FRAME : FRAME;
        s->sms[d][0] = (struct build_sm){FSN_OUTPUT, bytes};
        s->sms[d][1] = (struct build_sm){FSN_INPUT, bytes};
        for (uint32_t side = 0; side < 2; side++) {
            s->base[2 * d + side] = at;
            at += bytes;
        }
        if (!main) {
            const uint32_t slot = d % (SUBS + 1) - 1;
            const uint32_t logic = d - slot - 1;
            s->copies[2 * pair] = (struct build_copy){logic, slot * FRAME, d, 0, FRAME};
            s->copies[2 * pair++ + 1] = (struct build_copy){d, 0, logic, slot * FRAME, FRAME};
        }
    }
    CHECK(at == IMAGE_BYTES && pair == PAIRS);
    struct build_copy sorted[2 * PAIRS]; /* build_plan() puts them in another order */
    memcpy(sorted, s->copies, sizeof sorted);
    size_t len;
    const struct build b = {.subdevices = SUBDEVICES,
                            .sm = (const struct build_sm(*)[2])s->sms,
                            .copies = sorted,
                            .pairs = PAIRS,
                            .cycle_ns = 1000000};
    uint8_t *bytes = build_plan(&b, &len);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    return plan;
}

int main(int count, char **words) {
    char *end = NULL;
    const uint64_t wanted = count == 2 ? strtoull(words[1], &end, 10) : 0;
    if (wanted == 0 || *end != '\0') {
        fprintf(stderr, "soak_copy COPIES: how many are compared, at least 1\n");
        return 2;
    }
    static struct soak soak = {.seed = 88172645463325252u};
    static const struct fsn_bus_ops ops = {
        .name = "shadow", .open = open_bus, .receive = receive, .send = send_out};
    struct fsn_plan *plan = lay_out(&soak);
    struct fsn_core *core;
    struct fsn_fault fault;
    CHECK(fsn_core_create(plan, &ops, &soak, &core, &fault) == FSN_OK);
    struct timespec from, to;
    clock_gettime(CLOCK_MONOTONIC, &from);
    uint64_t cycle = 0;
    while (cycle * 2 * PAIRS < wanted && soak.differing == 0) {
        cycle++;
        CHECK(fsn_core_cycle(core, cycle * 1000000) == FSN_OK);
    }
    clock_gettime(CLOCK_MONOTONIC, &to);
    printf("%" PRIu64 " copies in %" PRIu64 " cycles against a shadow, %.0f s: %s\n",
           cycle * 2 * PAIRS, cycle, difftime(to.tv_sec, from.tv_sec),
           soak.differing == 0 ? "none differs" : "the image DIFFERS in the last cycle");
    fsn_core_free(core);
    fsn_plan_free(plan);
    return soak.differing == 0 ? 0 : 1;
}
