/** Data between the cyclic thread and others on a processor as weak as C11 permits: the real
 * sources run in a model checker (weak/weak.h), in which each load returns every value that it may.
 * Then each order in them is weakened in turn, which must lead to a violation. */
#define _GNU_SOURCE

#include <inttypes.h>

#include "client/client.c"
#include "core/access.c"

#include "builder.h"

enum { IMAGE = 16, WORDS = 64, OUTPUTS = 2 };

static struct fsn_core core;
static struct fsn_rt *const rt = &core.rt;
static uint8_t image[IMAGE];
static _Atomic uint64_t words[4][WORDS];
static uint64_t results; /**< complete sets that a reader got */

static void fill(uint64_t number) {
    memcpy(image, &number, 8);
    memcpy(image + 8, &number, 8);
}

/** Expects a whole set that is not older than the one before; returns its number. */
static uint64_t check(const void *set, uint64_t least) {
    uint64_t pair[2];
    memcpy(pair, set, sizeof pair);
    if (pair[0] != pair[1] || pair[0] < least) {
        weak_violation();
    }
    results++;
    return pair[0];
}

static void prepare(void) {
    memset(&core, 0, sizeof core);
    memset(words, 0, sizeof words);
    weak_before_store = NULL;
    rt->image = image;
    rt->image_bytes = IMAGE;
}

static void snapshots(void) {
    static struct fsn_rt_shown shown;
    prepare();
    rt->snapshot.shown = &shown;
    for (uint32_t n = 0; n < FSN_RT_PICTURES; n++) {
        rt->snapshot.words[n] = words[n];
    }
    for (uint64_t n = 1; n <= 4; n++) {
        fill(n);
        fsn_rt_publish(rt);
    }
    weak_thread(1);
    uint64_t least = 0;
    for (int i = 0; i < 2; i++) {
        uint8_t set[IMAGE];
        if (try_snapshot(rt, NULL, NULL, set)) {
            least = check(set, least);
        }
    }
}

/** One of four cycles is read, or the last one; only two slots for four cycles are overwritten. */
static void recorder(void) {
    prepare();
    rt->recorder.words = words[0];
    rt->recorder.slots = weak_choose(2) == 0 ? 2 : 4;
    rt->recorder.slot_words = 1 + fsn_words_of(sizeof(struct fsn_cycle)) + IMAGE / 8;
    while (rt->statistics.cycles < 4) {
        fill(++rt->statistics.cycles);
        fsn_rt_record(rt, 0);
    }
    weak_thread(1);
    const bool kept = rt->recorder.slots == 4;
    const uint64_t cycle = kept ? fsn_core_last_cycle(&core) : 1 + weak_choose(4);
    uint8_t set[IMAGE];
    const fsn_status status = fsn_core_record(&core, cycle, NULL, NULL, set);
    if ((status == FSN_OK && check(set, cycle) != cycle) ||
        (status != FSN_OK && kept && cycle > 0)) {
        weak_violation();
    }
}

static struct fsn_shared_inputs inputs;
static struct fsn_shared_client shown;

/** The cycle has read what is prepared for a client before it stores the first word of its own. */
static void use_client(const volatile void *at, uint64_t value) {
    (void)value;
    if (at == &inputs.shown.begun || at == &shown.state) {
        weak_data(rt->clients.client, false);
    }
}

/** The thread of the socket prepares a client. */
static void add_client(void) {
    weak_data(rt->clients.client, true);
    atomic_store_explicit(&rt->clients.present, 1, memory_order_release);
    weak_before_store = use_client;
}

static void inputs_of_clients(void) {
    prepare();
    inputs.picture_words = WORDS;
    inputs.image_bytes = IMAGE;
    inputs.pictures_at = (uint64_t)((uint8_t *)words - (uint8_t *)&inputs);
    inputs.open = 1;
    rt->clients.inputs = &inputs;
    rt->clients.pictures = words[0];
    weak_thread(1);
    add_client();
    weak_thread(0);
    while (rt->statistics.cycles < FSN_SHARED_PICTURES + 2) {
        fill(++rt->statistics.cycles);
        fsn_rt_clients_show(rt, false);
    }
    weak_thread(1);
    uint8_t set[IMAGE];
    struct fsn_realtime client = {.fd = -1, .inputs = &inputs, .image = set};
    struct fsn_realtime_cycle cycle;
    if (fsn_realtime_wait(&client, 0, &cycle) == FSN_OK && check(set, 1) != cycle.cycle) {
        weak_violation();
    }
}

static void outputs_of_clients(void) {
    static struct {
        struct fsn_shared_outputs head;
        _Atomic uint64_t sets[FSN_SHARED_SETS][1 + OUTPUTS];
    } shared;
    static const uint32_t symbols[OUTPUTS] = {0, 1};
    uint64_t sent[OUTPUTS], values[OUTPUTS] = {0}, fresh[OUTPUTS] = {0};
    struct fsn_rt_output places[OUTPUTS] = {{0, 64, true}, {64, 64, true}};
    prepare();
    shared.head.count = OUTPUTS;
    shared.head.sets_at = (uint64_t)((uint8_t *)shared.sets - (uint8_t *)&shared);
    struct fsn_realtime client = {.outputs = &shared.head, .values = sent};
    rt->outputs = places;
    rt->clients.client[0] = (struct fsn_rt_client){.sent = &shared.head.sent,
                                                   .set = {shared.sets[0], shared.sets[1]},
                                                   .symbols = symbols,
                                                   .values = values,
                                                   .fresh = fresh,
                                                   .shown = &shown,
                                                   .count = OUTPUTS,
                                                   .misses = 9};
    add_client();
    for (uint64_t n = 1; n <= 3; n++) {
        sent[0] = sent[1] = client.cycle.cycle = n;
        fsn_realtime_send(&client);
    }
    weak_thread(1);
    uint64_t least = 0;
    for (int i = 0; i < 2; i++) {
        fill(0);
        fsn_rt_clients_write(rt);
        if (rt->clients.client[0].taken > 0) {
            least = check(image, least);
        }
    }
}

static void triple_sets(void) {
    struct fsn_triple triple;
    struct set {
        uint64_t number;
    } sets[FSN_TRIPLE_SETS];
    uint64_t last = 0;
    weak_before_store = NULL;
    fsn_triple_init(&triple);
    for (uint32_t written = 0, taken = 0; written < 4 || taken < 3;) {
        const bool writes = written < 4 && (taken == 3 || weak_choose(2) == 0);
        weak_thread(writes ? 0 : 1);
        if (writes) {
            weak_data(&sets[triple.writer], true);
            sets[triple.writer].number = ++written;
            fsn_triple_publish(&triple);
            continue;
        }
        taken++;
        if (fsn_triple_take(&triple)) {
            weak_data(&sets[triple.reader], false);
            if (sets[triple.reader].number <= last) {
                weak_violation();
            }
            last = sets[triple.reader].number;
            results++;
        }
    }
}

/** The slot is written just before the head moves, and read just before the tail does. */
static void access_slot(const volatile void *at, uint64_t value) {
    struct fsn_rt_ring *ring = &rt->ring;
    if (at == &ring->head || at == &ring->tail) {
        weak_data(&ring->slot[(value - 1) % FSN_RT_EVENTS], at == &ring->head);
    }
}

static void events(void) {
    prepare();
    weak_before_store = access_slot;
    rt->ring.head = weak_choose(2) == 0 ? 0 : FSN_RT_EVENTS - 1; /* one slot left */
    for (uint32_t pushed = 0, taken = 0; pushed < 2 || taken < 2;) {
        const bool pushes = pushed < 2 && (taken == 2 || weak_choose(2) == 0);
        weak_thread(pushes ? 0 : 1);
        struct fsn_event event = {0};
        if (pushes) {
            pushed++;
            fsn_rt_push_event(rt, &event);
        } else {
            taken++;
            results += fsn_core_event(&core, &event);
        }
    }
}

/** With this order weakened, some run violates something. */
static void expect_needed(void (*run)(void), const struct weak_site *site, enum weak_order as) {
    if (!weak_explore(run, site, as).violated) {
        fprintf(stderr, "%s:%d: order %d instead of %d violates nothing\n", site->file, site->line,
                (int)as, (int)site->order);
        exit(1);
    }
}

/** No run violates anything, and every order in the source is needed. */
static void explore(const char *name, void (*run)(void)) {
    struct weak_site sites[WEAK_SITES];
    results = 0;
    const struct weak_result result = weak_explore(run, NULL, memory_order_relaxed);
    const uint32_t count = weak_sites(sites);
    printf("%s: %u orders, %" PRIu64 " runs, %" PRIu64 " sets read\n", name, count, result.runs,
           results);
    CHECK(!result.violated && results > 0 && count > 0);
    for (uint32_t i = 0; i < count; i++) {
        if (sites[i].order < memory_order_acq_rel) {
            expect_needed(run, &sites[i], memory_order_relaxed);
            continue;
        }
        expect_needed(run, &sites[i], memory_order_acquire);
        expect_needed(run, &sites[i], memory_order_release);
    }
}

int main(void) {
    explore("snapshot", snapshots);
    explore("recorder", recorder);
    explore("inputs of clients", inputs_of_clients);
    explore("outputs of clients", outputs_of_clients);
    explore("triple sets", triple_sets);
    explore("events", events);
    return 0;
}
