/* Runs a plan in a program that owns its process image: load, activate, cycle.
 * A real program fills the image from its EtherCAT stack in receive() and sends it in send(). */
#include <fsn/fsn.h>
#include <stdio.h>

struct my_bus {
    uint8_t image[65536];
    uint32_t base[4096], begin[1]; /* one datagram, from byte 0 on */
};

/* Tells the core where each sync manager lies. Here: one after the other. */
static fsn_status my_open(void *context, const struct fsn_plan *plan, struct fsn_bus_layout *out,
                          struct fsn_fault *fault) {
    struct my_bus *bus = context;
    (void)fault;
    uint32_t end = 0;
    for (uint32_t n = 0; n < fsn_plan_sm_count(plan); n++) {
        struct fsn_sm_info sm;
        if (n >= 4096 || fsn_plan_sm(plan, n, &sm) != FSN_OK || end > sizeof bus->image) {
            return FSN_E_SPACE;
        }
        bus->base[n] = sm.registered ? end : FSN_NONE;
        end += sm.registered ? sm.size_bytes : 0;
    }
    *out = (struct fsn_bus_layout){.image = bus->image,
                                   .image_bytes = end,
                                   .sm_base = bus->base,
                                   .datagram_begin = bus->begin,
                                   .datagram_count = 1};
    return end <= sizeof bus->image ? FSN_OK : FSN_E_SPACE;
}

/* Copies the input bytes of the SubDevices that answered into the image, leaves the others. */
static void my_receive(void *context, struct fsn_bus_input *input) {
    (void)context;
    input->wkc[0] = (struct fsn_wkc){.expected = 3, .actual = 3}; /* as the stack counted */
}

/* Hands the image to the stack. */
static void my_send(void *context) {
    (void)context;
}

int main(int argc, char **argv) {
    static struct my_bus bus;
    static uint8_t bytes[1 << 20];
    static const struct fsn_bus_ops ops = {
        .name = "mine", .open = my_open, .receive = my_receive, .send = my_send};
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL) {
        fprintf(stderr, "usage: embed PLAN.fsnplan\n");
        return 2;
    }
    const size_t len = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    struct fsn_plan *plan;
    struct fsn_core *core = NULL;
    struct fsn_fault fault;
    if (fsn_plan_load(bytes, len, &plan, &fault) != FSN_OK ||
        fsn_core_create(plan, &ops, &bus, &core, &fault) != FSN_OK) {
        fprintf(stderr, "refused: %s %d: %s\n", fsn_section_name(fault.section),
                (int)fault.copy_index, fault.rule);
        return 1;
    }
    fsn_plan_free(plan); /* the core holds it */
    for (uint64_t cycle = 0; cycle < 1000; cycle++) {
        if (fsn_core_cycle(core, cycle * 1000000u) != FSN_OK) {
            return 1;
        }
    }
    struct fsn_statistics s;
    if (fsn_core_snapshot(core, &s, NULL, NULL) == FSN_OK) {
        printf("fsn %s: %llu cycles, %u copies in %u pieces, %llu bytes moved, %llu WKC errors\n",
               fsn_version(), (unsigned long long)s.cycles, s.copies, s.merged_copies,
               (unsigned long long)s.bytes_copied, (unsigned long long)s.wkc_errors);
    }
    fsn_core_free(core);
    return 0;
}
