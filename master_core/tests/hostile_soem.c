/** SubDevices that answer nonsense: the SOEM backend against a segment whose answers are damaged on
 *  their way back. Nothing is expected but that the MainDevice lives, ends and copies whole frames.
 *
 *  hostile_soem ROUNDS [SEED]; run it under ASan. Skipped (77) without a network namespace. */
#define _GNU_SOURCE

#include <arpa/inet.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "builder.h"
#include "fsn/fsn.h"
#include "fsn/live.h"
#include "fsn/segment.h"

enum { SKIPPED = 77, ETHERCAT = 0x88A4, HEAD = 16, DATAGRAM_HEAD = 10, ROUND_MS = 400 };
enum {
    CMD_FPWR = 5,
    REG_SII = 0x0500,
    REG_AL_CONTROL = 0x0120,
    REG_SII_DATA = 0x0508,
    REG_MAILBOX = 0x0800,
    ASKED = 16,
    PATIENCE_MS = 120000 /**< only reached when a bus never opens */
};
enum { REG_LINKS = 0x0110, REG_PORT_TIMES = 0x0900, REG_LATCHED = 0x0918 };

/** Fields that every answer has, whatever else is damaged. */
enum lie { NO_LIE, NO_LINKS, WILD_CLOCKS, ROUND_SII, NO_MAILBOX, NO_SII, NO_ENTRY };

struct wire {
    struct fsn_segment *segment;
    int socket;
    uint64_t random; /**< of the thread that answers */
    uint64_t own_random;
    atomic_uint one_in;           /**< one of this many answers is damaged; 0: none */
    atomic_uint lie;              /**< enum lie */
    atomic_bool requested[ASKED]; /**< for PREOP, by station; of the thread that answers */
    atomic_uint asked_as;         /**< mailbox counter of the first request for an entry */
    atomic_bool asked_again;      /**< with another one */
    atomic_bool stop;
};

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static uint32_t pick(struct wire *w, uint32_t below) {
    return next_random(&w->random) % below;
}

static uint32_t pick_own(struct wire *w, uint32_t below) {
    return next_random(&w->own_random) % below;
}

/** Data, working counters, lengths, heads: any byte after the Ethernet head may change, and the
 *  packet may be cut off or be longer. */
static size_t damage(struct wire *w, uint8_t *frame, size_t len) {
    static const uint8_t liked[] = {0, 1, 0x7F, 0x80, 0xFF, 0xFE};
    for (uint32_t n = 1 + pick(w, 4); n > 0 && len > HEAD; n--) {
        const size_t at = 14 + pick(w, (uint32_t)(len - 14));
        frame[at] = pick(w, 2) ? liked[pick(w, sizeof liked)] : (uint8_t)pick(w, 256);
    }
    if (pick(w, 8) == 0) {
        len = 14 + pick(w, (uint32_t)(len - 14));
    } else if (pick(w, 8) == 0) {
        const size_t longer = len + pick(w, 200);
        len = longer > 1514 ? 1514 : longer;
    }
    return len;
}

/** A clock that jumps from one end of its range to the other with every register that is read. */
static void go_wild(uint8_t *data, size_t size, uint16_t address) {
    static unsigned turn;
    memset(data, turn % 2 == 0 ? 0x00 : 0xFF, size);
    data[size - 1] = turn++ % 2 == 0 ? 0x80 : 0x7F;
    if (address == REG_LATCHED) {
        memset(data, 0, size - 1);
        data[size - 1] = 0x80;
    }
}

/** No port has a link though the frame came through one, the clocks are wild, or the SII has no
 * end. */
static void lie(uint8_t *frame, size_t len, unsigned what) {
    /* A category of an unused type, whose length ends where it begins. */
    static const uint8_t back_to_itself[] = {0x77, 0x77, 0xFE, 0xFF};
    for (size_t at = HEAD; at + DATAGRAM_HEAD + 2 <= len;) {
        const uint16_t address = (uint16_t)(frame[at + 4] | frame[at + 5] << 8);
        const size_t size = (size_t)(frame[at + 6] | (frame[at + 7] & 7) << 8);
        const bool more = (frame[at + 7] & 0x80) != 0;
        uint8_t *data = frame + at + DATAGRAM_HEAD;
        if (at + DATAGRAM_HEAD + size + 2 > len) {
            return;
        }
        if (what == NO_LINKS && address == REG_LINKS) {
            memset(data, 0, size);
        } else if (what == ROUND_SII && address == REG_SII_DATA && size >= 4) {
            memcpy(data, back_to_itself, 4);
        } else if (what == WILD_CLOCKS && (size == 4 || size == 8) && address >= REG_PORT_TIMES &&
                   address <= REG_LATCHED) {
            go_wild(data, size, address);
        }
        if (!more) {
            return;
        }
        at += DATAGRAM_HEAD + size + 2;
    }
}

/** Whether it requests the first entry of the first output PDO, by a mailbox that is lost however
 *  often it is sent: what is requested later has another counter. */
static bool is_lost_request(struct wire *w, const uint8_t *frame) {
    static const uint8_t upload[] = {0x00, 0x20, 0x40, 0x00, 0x16, 0x01};
    const uint8_t *mailbox = frame + HEAD + DATAGRAM_HEAD;
    if (frame[HEAD] != CMD_FPWR || memcmp(mailbox + 6, upload, sizeof upload) != 0) {
        return false;
    }
    unsigned none = 0;
    const unsigned counter = mailbox[5] >> 4;
    if (atomic_compare_exchange_strong(&w->asked_as, &none, counter) || none == counter) {
        return true;
    }
    atomic_store(&w->asked_again, true);
    return false;
}

/** Whether a frame is lost on its way there: those that set up the mailbox of a SubDevice, until it
 *  was requested PREOP without one; or those that read the SII of the second one. */
static bool is_lost(struct wire *w, const uint8_t *frame) {
    const uint16_t address = (uint16_t)(frame[HEAD + 4] | frame[HEAD + 5] << 8);
    const unsigned which = frame[HEAD + 2] % ASKED;
    if (atomic_load(&w->lie) == NO_SII) {
        return which == 2 && address >= REG_SII && address < REG_SII + 16;
    }
    if (atomic_load(&w->lie) == NO_ENTRY) {
        return !atomic_load(&w->asked_again) && is_lost_request(w, frame);
    }
    if (frame[HEAD] != CMD_FPWR || atomic_load(&w->lie) != NO_MAILBOX) {
        return false;
    }
    if (address == REG_AL_CONTROL && (frame[HEAD + DATAGRAM_HEAD] & 0x0F) == FSN_AL_PREOP) {
        atomic_store(&w->requested[which], true);
    }
    return address == REG_MAILBOX && !atomic_load(&w->requested[which]);
}

static void *answer(void *argument) {
    struct wire *w = argument;
    while (!atomic_load(&w->stop)) {
        uint8_t frame[1600] = {0};
        const ssize_t got = recv(w->socket, frame, sizeof frame, 0);
        if (got <= HEAD + DATAGRAM_HEAD || is_lost(w, frame)) {
            continue;
        }
        size_t len = fsn_segment_frame(w->segment, frame, (size_t)got, now_ns());
        lie(frame, len, atomic_load(&w->lie));
        const unsigned one_in = atomic_load(&w->one_in);
        if (len > 0 && one_in > 0 && pick(w, one_in) == 0) {
            len = damage(w, frame, len);
        }
        if (len > 0) {
            (void)!send(w->socket, frame, len, 0);
        }
    }
    return NULL;
}

static int open_far(void) {
    const int fd = socket(AF_PACKET, SOCK_RAW, htons(ETHERCAT));
    const struct sockaddr_ll at = {.sll_family = AF_PACKET,
                                   .sll_protocol = htons(ETHERCAT),
                                   .sll_ifindex = (int)if_nametoindex("far")};
    const struct timeval patience = {.tv_usec = 20000};
    CHECK(fd >= 0 && bind(fd, (const struct sockaddr *)&at, sizeof at) == 0);
    CHECK(setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) == 0);
    return fd;
}

/** Opens the bus, with damage from the beginning or after it is open, and lets it run for a while.
 */
static bool play(struct wire *w, struct fsn_plan *plan, bool from_the_beginning, unsigned one_in) {
    const struct fsn_live_options options = {.interface = "near", .dc_every = 3};
    struct fsn_core *core;
    struct fsn_fault fault;
    void *bus;
    atomic_store(&w->one_in, from_the_beginning ? one_in : 0);
    CHECK(fsn_backend_soem()->create(&options, &bus, NULL) == FSN_OK);
    const bool open = fsn_core_create(plan, fsn_backend_soem()->ops, bus, &core, &fault) == FSN_OK;
    if (open) {
        const struct fsn_thread_options thread = {.cycle_ns = 1000000};
        CHECK(fsn_core_start(core, &thread, NULL) == FSN_OK);
        atomic_store(&w->one_in, one_in);
        const uint64_t end = now_ns() + ROUND_MS * UINT64_C(1000000);
        while (now_ns() < end) {
            fsn_core_poll(core, FSN_AL_OP, now_ns());
            if (pick_own(w, 100) == 0) {
                fsn_segment_power_cycle(w->segment, pick_own(w, 2));
            }
            usleep(1000);
        }
        fsn_core_free(core);
    }
    fsn_backend_soem()->free(bus);
    atomic_store(&w->one_in, 0);
    usleep(50000);
    return open;
}

/** Whether the bus opens, damaged only after that: SOEM waits for milliseconds, so that a busy
 *  machine needs several attempts. */
static bool opens(struct wire *w, struct fsn_plan *plan, enum lie what, unsigned one_in) {
    const uint64_t end = now_ns() + PATIENCE_MS * UINT64_C(1000000);
    bool open = false;
    while (!open && now_ns() < end) {
        atomic_store(&w->lie, NO_LIE);
        for (int i = 0; i < ASKED; i++) {
            atomic_store(&w->requested[i], false);
        }
        atomic_store(&w->asked_as, 0);
        atomic_store(&w->asked_again, false);
        atomic_store(&w->lie, what);
        open = play(w, plan, false, one_in);
    }
    atomic_store(&w->lie, NO_LIE);
    return open;
}

/** A SubDevice whose SII does not come is reported as one that could not be read, in good time, and
 * not as another one. */
static bool tells_of_an_sii_that_does_not_come(struct wire *w, const struct fsn_plan *plan) {
    const struct fsn_live_options options = {.interface = "near"};
    const uint64_t end = now_ns() + PATIENCE_MS * UINT64_C(1000000);
    bool logged = false;
    atomic_store(&w->lie, NO_SII);
    while (!logged && now_ns() < end) {
        struct fsn_core *core;
        struct fsn_fault fault;
        void *bus;
        CHECK(fsn_backend_soem()->create(&options, &bus, NULL) == FSN_OK);
        const fsn_status status =
            fsn_core_create(plan, fsn_backend_soem()->ops, bus, &core, &fault);
        CHECK(status != FSN_OK && status != FSN_E_BUS_IDENTITY);
        logged = status == FSN_E_BUS_STATE && strstr(fault.detail, "SII could not be read") != NULL;
        fsn_backend_soem()->free(bus);
    }
    atomic_store(&w->lie, NO_LIE);
    return logged;
}

int main(int argc, char **argv) {
    const unsigned rounds = argc > 1 ? (unsigned)atoi(argv[1]) : 4;
    if ((unshare(CLONE_NEWNET) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) ||
        system("ip link set lo up && ip link add near type veth peer name far && "
               "ip link set near up && ip link set far up") != 0) {
        fprintf(stderr, "skipped: no network namespace with a veth pair can be made here\n");
        return SKIPPED;
    }
    size_t len;
    uint8_t *bytes = build_full(&len);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    const uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    struct wire w = {.random = seed, .own_random = seed + 1, .socket = open_far()};
    CHECK(fsn_segment_create(plan, &w.segment) == FSN_OK);
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, answer, &w) == 0);
    unsigned opened = 0;
    for (unsigned what = NO_LINKS; what <= ROUND_SII; what++) {
        atomic_store(&w.lie, what);
        (void)play(&w, plan, true, 0);
    }
    CHECK(tells_of_an_sii_that_does_not_come(&w, plan));
    CHECK(opens(&w, plan, NO_MAILBOX, 0));
    /* What a lost frame keeps from being checked is requested again. */
    CHECK(opens(&w, plan, NO_ENTRY, 0) && atomic_load(&w.asked_again));
    for (unsigned i = 0; i < rounds; i++) {
        /* With more damage than that SOEM looks for SubDevices for minutes. */
        const bool from_the_beginning = i % 2 == 0;
        opened +=
            play(&w, plan, from_the_beginning, (from_the_beginning ? 8 : 2) + pick_own(&w, 54));
    }
    CHECK(rounds < 2 || opened > 0 || opens(&w, plan, NO_LIE, 30)); /* a healthy bus */
    atomic_store(&w.stop, true);
    pthread_join(thread, NULL);
    close(w.socket);
    fsn_segment_free(w.segment);
    fsn_plan_free(plan);
    printf("%u rounds of damaged answers, the bus opened in %u\n", rounds, opened);
    return 0;
}
