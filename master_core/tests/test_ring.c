/** Which way of a ring is lost, and the name of its gap. */
#include "live/ring.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "builder.h"

enum { MEMBERS = 4, CYCLES = 20 };

/* -- ways ----------------------------------------------------------------------------------- */

/** Twenty cycles with this many frames: by the port where they were sent, then by that of arrival.
 */
static uint8_t after(struct fsn_ring_watch *watch, struct fsn_ring_counts *counts,
                     const uint32_t came[4], bool both_linked) {
    counts->sent += CYCLES;
    for (unsigned i = 0; i < 4; i++) {
        counts->came[i / 2][i % 2] += came[i];
    }
    CHECK(fsn_ring_judge(watch, counts, both_linked));
    return watch->ring.state;
}

static void each_way_is_judged(void) {
    static const struct {
        uint32_t came[4];
        bool both_linked;
        unsigned judgements; /**< until it is noticed */
        uint8_t state, ways[2];
    } cases[] = {
        {{20, 0, 0, 20}, true, 2, FSN_RING_OPEN, {0, 0}},   /* a cable in the middle */
        {{0, 0, 0, 20}, true, 2, FSN_RING_OPEN, {0, 0}},    /* the first one */
        {{20, 0, 0, 0}, true, 2, FSN_RING_OPEN, {0, 0}},    /* the last one */
        {{0, 20, 0, 0}, true, 2, FSN_RING_ONE_WAY, {1, 0}}, /* one pair of wires of a cable */
        {{20, 0, 1, 0}, true, 2, FSN_RING_ONE_WAY, {0, 1}},
        {{0, 0, 0, 0}, false, 2, FSN_RING_OPEN, {0, 0}}, /* both cables out */
        {{0, 0, 0, 0}, true, 10, FSN_RING_OPEN, {0, 0}}, /* no answer */
    };
    static const uint32_t whole[4] = {0, 20, 20, 0};
    static const uint32_t few[4] = {0, 1, 1, 0};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        /* Counters go round at any time. */
        struct fsn_ring_counts counts = {.sent = UINT32_MAX - 30, .came = {{0, UINT32_MAX - 30}}};
        struct fsn_ring_watch watch = {.last = counts};
        CHECK(watch.ring.state == FSN_RING_UNKNOWN);
        CHECK(after(&watch, &counts, whole, true) == FSN_RING_CLOSED);
        CHECK(watch.ring.ways[0] == 1 && watch.ring.ways[1] == 1 && watch.ring.breaks == 0);
        for (unsigned n = 1; n < cases[i].judgements; n++) {
            CHECK(after(&watch, &counts, cases[i].came, cases[i].both_linked) == FSN_RING_CLOSED);
            CHECK(watch.ring.breaks == 0);
        }
        for (unsigned n = 0; n < 3; n++) {
            CHECK(after(&watch, &counts, cases[i].came, cases[i].both_linked) == cases[i].state);
            CHECK(memcmp(watch.ring.ways, cases[i].ways, 2) == 0 && watch.ring.breaks == 1);
        }
        CHECK(after(&watch, &counts, few, true) == FSN_RING_CLOSED);
        for (unsigned n = 0; n < cases[i].judgements; n++) {
            (void)after(&watch, &counts, cases[i].came, cases[i].both_linked);
        }
        CHECK(watch.ring.state == cases[i].state && watch.ring.breaks == 2);
    }
}

static void one_bad_judgement_is_forgotten(void) {
    static const uint32_t whole[4] = {0, 20, 20, 0}, half[4] = {20, 0, 0, 20};
    struct fsn_ring_counts counts = {0};
    struct fsn_ring_watch watch = {0};
    for (unsigned n = 0; n < 3; n++) {
        CHECK(after(&watch, &counts, whole, true) == FSN_RING_CLOSED);
        CHECK(after(&watch, &counts, half, true) == FSN_RING_CLOSED);
    }
    CHECK(watch.ring.breaks == 0);
}

/** Too few cycles are not conclusive, and are judged with those that follow. */
static void a_slow_cycle_is_waited_for(void) {
    struct fsn_ring_counts counts = {.sent = 3, .came = {{0, 3}, {3, 0}}};
    struct fsn_ring_watch watch = {0};
    CHECK(!fsn_ring_judge(&watch, &counts, true) && watch.ring.state == FSN_RING_UNKNOWN);
    counts.sent = 4;
    CHECK(fsn_ring_judge(&watch, &counts, true) && watch.ring.state == FSN_RING_CLOSED);
}

/* -- gaps ----------------------------------------------------------------------------------- */

struct place {
    uint8_t had[MEMBERS], has[MEMBERS]; /**< UINT8_MAX: does not answer */
    bool links[2];
    uint32_t turned; /**< frames of the first interface that came back there */
    uint8_t ways[2];
    const char *text;
};

enum { GONE = UINT8_MAX, SILENT = INT32_MAX }; /* the latter: no frame comes back */

#define LINE {3, 3, 3, 3}

static const struct place places[] = {
    {LINE, {2, 3, 3, 3}, {true, true}, 0, {0, 0}, "between near and a (ring position 0, port 0)"},
    {LINE,
     {2, 3, 3, 3},
     {false, true},
     0,
     {0, 0},
     "between near (no link) and a (ring position 0, port 0)"},
    {LINE,
     {3, 1, 2, 3},
     {true, true},
     9,
     {0, 0},
     "between b (ring position 1, port 1) and c (ring position 2, port 0)"},
    {LINE, {3, 3, 3, 1}, {true, true}, 9, {0, 0}, "between d (ring position 3, port 1) and near2"},
    {LINE,
     {3, 3, 3, 1},
     {true, false},
     9,
     {0, 0},
     "between d (ring position 3, port 1) and near2 (no link)"},
    /* Two gaps. */
    {LINE,
     {2, 3, 3, 1},
     {false, false},
     0,
     {0, 0},
     "between near (no link) and a (ring position 0, port 0); between d (ring position 3, port 1) "
     "and near2 (no link)"},
    {LINE,
     {2, 1, 2, 3},
     {true, true},
     0,
     {0, 0},
     "between near and a (ring position 0, port 0); between b (ring position 1, port 1) and c "
     "(ring "
     "position 2, port 0)"},
    /* No room for the third. */
    {LINE,
     {2, 1, 2, 1},
     {true, true},
     0,
     {0, 0},
     "between near and a (ring position 0, port 0); between b (ring position 1, port 1) and c "
     "(ring "
     "position 2, port 0)"},
    /* Already open at the start: it is unknown which ports had a link. */
    {{2, 3, 3, 3},
     {2, 3, 3, 3},
     {true, true},
     0,
     {0, 0},
     "between near and a (ring position 0, port 0)"},
    {{3, 1, 2, 3},
     {3, 1, 2, 3},
     {true, true},
     9,
     {0, 0},
     "between b (ring position 1) and c (ring position 2, port 0)"},
    {{3, 3, 3, 1}, {3, 3, 3, 1}, {true, true}, 9, {0, 0}, "between d (ring position 3) and near2"},
    {{3, 3, 3, 1},
     {3, 3, 3, 1},
     {true, false},
     0,
     {0, 0},
     "between d (ring position 3) and near2 (no link)"},
    /* A branch: the second leads to the third, its end, and on to the fourth by port 2. */
    {{3, 7, 1, 3},
     {3, 3, 1, 2},
     {true, true},
     9,
     {0, 0},
     "between b (ring position 1, port 2) and d (ring position 3, port 0)"},
    {{3, 7, 1, 3}, {3, 3, 1, 3}, {true, true}, 9, {0, 0}, "after b (ring position 1, port 2)"},
    /* SubDevices without power. */
    {LINE,
     {3, 1, GONE, 2},
     {true, true},
     9,
     {0, 0},
     "at c (ring position 2), which does not answer"},
    {LINE,
     {GONE, GONE, 2, 3},
     {false, true},
     0,
     {0, 0},
     "at a (ring position 0), which does not answer"},
    {LINE,
     {3, 3, 1, GONE},
     {true, false},
     9,
     {0, 0},
     "at d (ring position 3), which does not answer"},
    {LINE,
     {GONE, GONE, GONE, GONE},
     {false, true},
     0,
     {0, 0},
     "no SubDevice answers; near has no link, near2 has one"},
    {LINE,
     {GONE, GONE, GONE, GONE},
     {true, false},
     0,
     {0, 0},
     "no SubDevice answers; near has a link, near2 has none"},
    /* No link is down. */
    {LINE,
     {3, 3, 3, 3},
     {true, true},
     0,
     {0, 1},
     "every link is up, but no frame from near comes out at near2"},
    {LINE,
     {3, 3, 3, 3},
     {true, true},
     0,
     {1, 0},
     "every link is up, but no frame from near2 comes out at near"},
    {LINE, {3, 3, 3, 3}, {false, true}, 0, {0, 0}, "at near, which has no link"},
    {LINE, {3, 3, 3, 3}, {true, true}, SILENT, {0, 0}, "no frame comes back at either interface"},
};

static void gaps_are_named(void) {
    static const char *const names[MEMBERS] = {"a", "b", "c", "d"};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        const struct place *p = &places[i];
        const bool silent = p->turned == SILENT;
        const struct fsn_ring_watch watch = {
            .since.came = {{silent ? 0 : p->turned}, {silent ? 0 : 9}},
            .ring.ways = {p->ways[0], p->ways[1]}};
        const struct fsn_ring_end ends[2] = {{"near", p->links[0]}, {"near2", p->links[1]}};
        struct fsn_ring_member members[MEMBERS];
        char text[FSN_DETAIL_BYTES];
        for (size_t m = 0; m < MEMBERS; m++) {
            members[m] = (struct fsn_ring_member){names[m], p->has[m] != GONE, p->had[m],
                                                  p->has[m] != GONE ? p->has[m] : 0};
        }
        fsn_ring_place(&watch, members, MEMBERS, ends, text);
        if (strcmp(text, p->text) != 0) {
            fprintf(stderr, "case %zu: %s\n", i, text);
            exit(1);
        }
    }
}

static void the_longest_names_have_room(void) {
    char name[200];
    memset(name, 'n', sizeof name - 1);
    name[sizeof name - 1] = '\0';
    struct fsn_ring_member members[512];
    for (size_t m = 0; m < 512; m++) {
        members[m] = (struct fsn_ring_member){name, true, 3, m == 510 ? 1 : m == 511 ? 2 : 3};
    }
    const struct fsn_ring_end ends[2] = {{"near", true}, {"near2", true}};
    char text[FSN_DETAIL_BYTES];
    fsn_ring_place(&(struct fsn_ring_watch){0}, members, 512, ends, text);
    CHECK(strncmp(text, "between nnnn", 12) == 0);
    CHECK(strstr(text, "n (ring position 511, port 0)") != NULL);
}

static void states_have_words(void) {
    CHECK(strcmp(fsn_ring_text(FSN_RING_UNKNOWN), "unknown") == 0);
    CHECK(strcmp(fsn_ring_text(FSN_RING_ONE_WAY), "one way") == 0);
    CHECK(strcmp(fsn_ring_text(FSN_RING_ONE_WAY + 1), "?") == 0);
}

int main(void) {
    each_way_is_judged();
    one_bad_judgement_is_forgotten();
    a_slow_cycle_is_waited_for();
    gaps_are_named();
    the_longest_names_have_room();
    states_have_words();
    return 0;
}
