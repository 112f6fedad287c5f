/** The distributed clocks of the emulated segment: their times, how they follow, and the reaction
 *  of devices whose SYNC0 cannot be used. */
#include <string.h>

#include "rt/bytes.h"
#include "segment_rig.h"

enum {
    DC_RECEIVE = 0x0900,
    DC_TIME = 0x0910,
    DC_OFFSET = 0x0920,
    DC_DELAY = 0x0928,
    DC_DIFFERENCE = 0x092C,
    DC_LOOP = 0x0930,
    DC_ACTIVATION = 0x0980,
    SYNC0_START = 0x0990,
    SYNC0_CYCLE = 0x09A0,
    MS = 1000000,
};

static uint64_t number(const struct rig *rig, unsigned size) {
    return fsn_read_bits(rig->data, 0, 8 * size);
}

static uint64_t read(struct rig *rig, uint16_t station, uint16_t address, uint16_t size) {
    CHECK(datagram(rig, FPRD, station, address, NULL, size) == 1);
    return number(rig, size);
}

static void put(struct rig *rig, uint16_t station, uint16_t address, uint64_t value,
                uint16_t size) {
    uint8_t bytes[8];
    fsn_put64(bytes, value);
    CHECK(datagram(rig, FPWR, station, address, bytes, size) == 1);
}

/** Distributes the time of the first SubDevice, a frame each millisecond. */
static void distribute(struct rig *rig, unsigned frames) {
    for (unsigned i = 0; i < frames; i++) {
        CHECK(datagram(rig, FRMW, 1001, DC_TIME, NULL, 8) >= 1);
    }
}

static void set(struct rig *rig, uint32_t position, uint64_t offset_ns, int32_t drift_ppb,
                uint32_t forward_ns) {
    const struct fsn_segment_clock clock = {
        .offset_ns = offset_ns, .drift_ppb = drift_ppb, .forward_ns = forward_ns};
    CHECK(fsn_segment_set_clock(rig->segment, position, &clock) == FSN_OK);
}

static struct rig set_up_clocks(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    set(&rig, 0, 5000, 0, 700);
    set(&rig, 1, 9000000, 40000, 300);
    return rig;
}

/** A write latches when the frame came, and came back; times are those of each clock. */
static void receive_times_show_the_way(void) {
    struct rig rig = set_up_clocks();
    set(&rig, 1, 9000000, 0, 300);
    const uint32_t zero = 0;
    CHECK(datagram(&rig, BWR, 0, DC_RECEIVE, &zero, 4) == 2);
    const uint64_t sent = rig.now_ns;
    CHECK(read(&rig, 1001, DC_RECEIVE, 4) == (uint32_t)(sent + 5000));
    CHECK(read(&rig, 1001, DC_RECEIVE + 4, 4) == (uint32_t)(sent + 5000 + 2 * (700 + 300)));
    CHECK(read(&rig, 1001, 0x0918, 8) == sent + 5000);
    CHECK(read(&rig, 1002, 0x0918, 8) == sent + 700 + 9000000);
    CHECK(read(&rig, 1002, DC_RECEIVE + 4, 4) == (uint32_t)(sent + 700 + 9000000 + 2 * 300));
    tear_down(&rig);
}

static void time_is_local_time_and_offset(void) {
    struct rig rig = set_up_clocks();
    CHECK(read(&rig, 1001, DC_TIME, 8) == rig.now_ns + 5000);
    put(&rig, 1001, DC_OFFSET, 1000000, 8);
    CHECK(read(&rig, 1001, DC_TIME, 8) == rig.now_ns + 1005000);
    /* 40 ppm fast: after a second 40 us more have passed. */
    const uint64_t before = read(&rig, 1002, DC_TIME, 8);
    rig.now_ns += 999 * (uint64_t)MS;
    CHECK(read(&rig, 1002, DC_TIME, 8) - before == 1000 * (uint64_t)MS + 40000);
    tear_down(&rig);
}

/** The control loop removes distance and drift; the sign of the difference gives the side. */
static void a_clock_follows_the_reference(void) {
    for (int side = 0; side < 2; side++) {
        struct rig rig = set_up_clocks();
        const uint64_t apart = side == 0 ? 8995000 - 20000 : 8995000 + 20000;
        put(&rig, 1002, DC_DELAY, 700, 4);
        put(&rig, 1002, DC_OFFSET, 0 - apart, 8); /* 20 us before, or after */
        put(&rig, 1002, DC_LOOP, 0x1000, 2);
        distribute(&rig, 1);
        const uint32_t first = (uint32_t)read(&rig, 1002, DC_DIFFERENCE, 4);
        CHECK((first & 0x7FFFFFFF) > 500 && (first >> 31) == (uint32_t)side);
        distribute(&rig, 600);
        CHECK((read(&rig, 1002, DC_DIFFERENCE, 4) & 0x7FFFFFFF) < 50);
        const uint64_t reference = read(&rig, 1001, DC_TIME, 8);
        const int64_t left = (int64_t)(read(&rig, 1002, DC_TIME, 8) - reference - MS - 700);
        CHECK(left < 100 && left > -100); /* a millisecond and the way later */
        tear_down(&rig);
    }
}

/** The reference is set by whoever writes its time. */
static void the_reference_can_be_set(void) {
    struct rig rig = set_up_clocks();
    for (int i = 0; i < 800; i++) {
        put(&rig, 1001, DC_TIME, rig.now_ns + MS + 12000, 4); /* 7 us ahead of it */
    }
    const int64_t left = (int64_t)(read(&rig, 1001, DC_TIME, 8) - rig.now_ns - 12000);
    CHECK(left < 100 && left > -100);
    CHECK(datagram(&rig, FPWR, 1001, DC_TIME, NULL, 2) == 1); /* half a time is not a time */
    tear_down(&rig);
}

static void who_has_no_clock_says_so(void) {
    struct rig rig = set_up_clocks();
    const struct fsn_segment_clock none = {.absent = true, .forward_ns = 300};
    CHECK(fsn_segment_set_clock(rig.segment, 1, &none) == FSN_OK);
    CHECK(read(&rig, 1001, 0x0008, 2) == 0x0C && read(&rig, 1002, 0x0008, 2) == 0);
    CHECK(datagram(&rig, BRD, 0, DC_TIME, NULL, 8) == 1);
    CHECK(datagram(&rig, FPWR, 1002, DC_ACTIVATION, "\0\3", 2) == 0);
    CHECK(datagram(&rig, BWR, 0, DC_RECEIVE, "\0\0\0\0", 4) == 2);
    const struct fsn_segment_clock wild = {.drift_ppb = 1000000};
    CHECK(fsn_segment_set_clock(rig.segment, 1, &wild) == FSN_E_ARG);
    CHECK(fsn_segment_set_clock(rig.segment, 2, &none) == FSN_E_ARG);
    CHECK(fsn_segment_set_clock(rig.segment, 0, NULL) == FSN_E_ARG);
    tear_down(&rig);
}

/** Of 32 bits its times show what is left of the same times, and what is written above is lost. */
static void a_clock_may_have_32_bits(void) {
    struct rig rig = set_up_clocks();
    const uint64_t offset =
        UINT64_C(0x2FFFFFFFF) - rig.now_ns; /* goes around with the next frames */
    CHECK(fsn_segment_set_clock_bits(rig.segment, 1, 32) == FSN_OK);
    set(&rig, 1, 0, 0, 300); /* another clock in the same device */
    CHECK(read(&rig, 1001, 0x0008, 2) == 0x0C && read(&rig, 1002, 0x0008, 2) == 0x04);
    fsn_segment_power_cycle(rig.segment, 1);
    set_stations(&rig);
    CHECK(read(&rig, 1002, 0x0008, 2) == 0x04);
    put(&rig, 1002, DC_OFFSET, offset, 8);
    CHECK(read(&rig, 1002, DC_OFFSET, 8) == (uint32_t)offset);
    CHECK(read(&rig, 1002, DC_TIME, 8) == (uint32_t)(rig.now_ns + 700 + offset));
    put(&rig, 1002, SYNC0_START, UINT64_C(0x500000000) + MS, 8);
    CHECK(read(&rig, 1002, SYNC0_START, 8) == MS);
    const uint32_t zero = 0;
    CHECK(datagram(&rig, BWR, 0, DC_RECEIVE, &zero, 4) == 2);
    CHECK(read(&rig, 1002, 0x0918, 8) >> 32 == 0);
    CHECK(fsn_segment_set_clock_bits(rig.segment, 1, 64) == FSN_OK);
    CHECK(read(&rig, 1002, 0x0008, 2) == 0x0C);
    CHECK(read(&rig, 1002, DC_TIME, 8) == rig.now_ns + 700 + (uint32_t)offset);
    CHECK(fsn_segment_set_clock_bits(rig.segment, 1, 48) == FSN_E_ARG);
    CHECK(fsn_segment_set_clock_bits(rig.segment, 2, 32) == FSN_E_ARG);
    tear_down(&rig);
}

/* -- SYNC0 ---------------------------------------------------------------------------------- */

static uint16_t code(const struct rig *rig, uint32_t position) {
    uint16_t code;
    (void)fsn_segment_al_status(rig->segment, position, &code);
    return code;
}

/** Brings the second SubDevice to SAFEOP; its SYNC0 begins so much later, each millisecond. */
static void start_sync(struct rig *rig, int64_t later_ns) {
    const uint64_t now = read(rig, 1002, DC_TIME, 8);
    put(rig, 1002, SYNC0_CYCLE, MS, 4);
    put(rig, 1002, SYNC0_START, now + (uint64_t)later_ns, 8);
    put(rig, 1002, DC_ACTIVATION, 0x0300, 2);
    to_op(rig, 1002, 0x100, 8);
}

/** The clocks are the same but for the millisecond that a datagram of the rig takes. */
static struct rig set_up_synchronous(void) {
    struct rig rig = set_up_clocks();
    set(&rig, 0, 0, 0, 0);
    set(&rig, 1, 0, 0, 0);
    distribute(&rig, 2);
    return rig;
}

static void sync0_on_a_clock_that_nobody_sets_is_refused(void) {
    struct rig rig = set_up_clocks();
    start_sync(&rig, 100 * (int64_t)MS);
    CHECK(al(&rig, 1) == 0x14 && code(&rig, 1) == 0x002C);
    tear_down(&rig);
    rig = set_up_synchronous(); /* and where the time stops to come */
    start_sync(&rig, 100 * (int64_t)MS);
    CHECK(al(&rig, 1) == 8);
    rig.now_ns += 900 * (uint64_t)MS;
    CHECK(write16(&rig, FPWR, 1002, 0x0420, 0) == 1); /* no watchdog of outputs */
    CHECK(al(&rig, 1) == 8);
    rig.now_ns += 2000 * (uint64_t)MS;
    fsn_segment_idle(rig.segment, rig.now_ns);
    CHECK(al(&rig, 1) == 0x14 && code(&rig, 1) == 0x002C);
    tear_down(&rig);
    rig = set_up_clocks(); /* and on one that is 9 ms away */
    distribute(&rig, 50);
    start_sync(&rig, 100 * (int64_t)MS);
    CHECK(al(&rig, 1) == 0x14 && code(&rig, 1) == 0x002C);
    tear_down(&rig);
}

static void a_start_that_has_passed_never_comes(void) {
    struct rig rig = set_up_synchronous();
    start_sync(&rig, -1);
    CHECK(al(&rig, 1) == 0x14 && code(&rig, 1) == 0x002D);
    tear_down(&rig);
}

/** Pulses of both widths come at the start that was written, whole cycles later, and over the end
 * of 32 bits; a start that has passed comes to 32 bits when the time has gone around. */
static void pulses_begin_where_they_were_started(void) {
    for (uint32_t bits = 32; bits <= 64; bits += 32) {
        struct rig rig = set_up_synchronous();
        uint64_t pulse;
        CHECK(fsn_segment_set_clock_bits(rig.segment, 1, bits) == FSN_OK);
        CHECK(fsn_segment_next_pulse(rig.segment, 1, &pulse) == FSN_E_STATE);
        put(&rig, 1002, DC_OFFSET, UINT64_C(0x100000000) - rig.now_ns - 50 * MS, 8);
        const uint64_t now = read(&rig, 1002, DC_TIME, 8); /* 50 ms before the end of 32 bits */
        const uint64_t start_ns = rig.now_ns + 80 * (uint64_t)MS;
        put(&rig, 1002, SYNC0_CYCLE, 3 * MS, 4);
        put(&rig, 1002, SYNC0_START, now + 80 * (uint64_t)MS, 8);
        put(&rig, 1002, DC_ACTIVATION, 0x0300, 2);
        CHECK(fsn_segment_next_pulse(rig.segment, 1, &pulse) == FSN_OK && pulse == start_ns);
        rig.now_ns += 200 * (uint64_t)MS;
        (void)read(&rig, 1002, DC_TIME, 8);
        CHECK(fsn_segment_next_pulse(rig.segment, 1, &pulse) == FSN_OK);
        CHECK(pulse > rig.now_ns && pulse <= rig.now_ns + 3 * MS);
        CHECK((pulse - start_ns) % (3 * MS) == 0);

        const uint64_t passed = read(&rig, 1002, DC_TIME, 8) - 1000;
        const uint64_t around_ns = rig.now_ns - 1000 + UINT64_C(0x100000000);
        put(&rig, 1002, SYNC0_START, passed, 8);
        put(&rig, 1002, DC_ACTIVATION, 0x0300, 2);
        const fsn_status status = fsn_segment_next_pulse(rig.segment, 1, &pulse);
        CHECK(bits == 64 ? status == FSN_E_STATE : status == FSN_OK && pulse == around_ns);
        tear_down(&rig);
    }
    struct rig rig = set_up_synchronous();
    CHECK(fsn_segment_next_pulse(rig.segment, 0, NULL) == FSN_E_ARG);
    uint64_t pulse;
    CHECK(fsn_segment_next_pulse(rig.segment, 2, &pulse) == FSN_E_ARG);
    tear_down(&rig);
}

/** A device of 32 bits whose start has passed goes to OP when the time has gone around. */
static void a_start_that_has_passed_comes_around_in_32_bits(void) {
    struct rig rig = set_up_synchronous();
    CHECK(fsn_segment_set_clock_bits(rig.segment, 1, 32) == FSN_OK);
    start_sync(&rig, -1);
    CHECK(al(&rig, 1) == 0x14 && code(&rig, 1) == 0x002D);
    rig.now_ns += UINT64_C(0x100000000);
    distribute(&rig, 2);
    CHECK(write16(&rig, FPWR, 1002, 0x0120, 0x14) == 1 &&
          write16(&rig, FPWR, 1002, 0x0120, 8) == 1);
    CHECK(al(&rig, 1) == 8);
    tear_down(&rig);
}

/** Outputs near the pulse, always: a device cannot assign them to a cycle. */
static void outputs_belong_between_the_pulses(void) {
    for (int64_t phase = 0; phase < MS; phase += MS / 8) {
        struct rig rig = set_up_synchronous();
        start_sync(&rig, 20 * (int64_t)MS - phase);
        CHECK(al(&rig, 1) == 8);
        for (int i = 0; i < 100; i++) {
            CHECK(datagram(&rig, LWR, 0x100, 0, NULL, 8) == 1);
            distribute(&rig, i % 10 == 0);
        }
        const bool near = phase < MS / 8 || phase > MS - MS / 8;
        CHECK(al(&rig, 1) == (near ? 0x14 : 8) && code(&rig, 1) == (near ? 0x001A : 0));
        tear_down(&rig);
    }
}

int main(void) {
    receive_times_show_the_way();
    time_is_local_time_and_offset();
    a_clock_follows_the_reference();
    the_reference_can_be_set();
    who_has_no_clock_says_so();
    a_clock_may_have_32_bits();
    pulses_begin_where_they_were_started();
    a_start_that_has_passed_comes_around_in_32_bits();
    sync0_on_a_clock_that_nobody_sets_is_refused();
    a_start_that_has_passed_never_comes();
    outputs_belong_between_the_pulses();
    return 0;
}
